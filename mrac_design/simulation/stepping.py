"""A hybrid system under an integration method as straight-line programs, for any machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from mrac_design.arrays import FloatArray
from mrac_design.codegen.ordering import ordered
from mrac_design.codegen.passes import fuse_products, hoist_settled, share_reciprocals
from mrac_design.codegen.reading import call_program, operations_as_written, read_function
from mrac_design.codegen.straight_line import FMA, Builder, OperationCount, StraightLine
from mrac_design.codegen.trigonometry import lower_trigonometry
from mrac_design.simulation.event_search import only
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import ButcherTableau

ARGUMENTS = ("x", "z", "v", "p")
"""Names of state, held memory, input and parameters in the programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A function of (x, z, v, p) in two parts: once per run, and once per call."""

    setup: StraightLine
    """p and what else never changes → `prepared`."""
    body: StraightLine
    """(x, z, v, p, prepared) → the function's output."""
    written: OperationCount
    """Arithmetic of the function as it was given."""

    @property
    def per_call(self) -> OperationCount:
        """Arithmetic of one call after optimisation; a sine with its cosine counts as two."""
        return self.body.count()


def prepare(function: ca.Function, *, names: Sequence[str] = ARGUMENTS) -> Prepared:
    """Optimise an SX function of (x, z, v, p): see the passes of `mrac_design.codegen`."""
    program = share_reciprocals(read_function(function, inputs=names), settled=["p"])
    setup, body = hoist_settled(program, ["p"])
    return Prepared(setup=setup, body=body, written=operations_as_written(function))


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """The rate of a system with events together with its event functions, prepared."""

    rate: Prepared
    """The rate alone; its setup serves all."""
    hold: StraightLine
    """(x, z, v, p, prepared) → kept: what depends on the memory z alone, made when it changes."""
    both: StraightLine
    """(x, z and kept, v, p, prepared) → rate, events, as the machines run it."""
    events: StraightLine
    """(x, z and kept, v, p, prepared) → events, the same operations as in `both`."""


def prepare_watched(system: HybridSystem) -> Watched:
    """Optimise rate and event functions as one, as they have much in common."""
    assert system.event_functions is not None
    arguments = system.arguments()
    together = ca.Function(
        "watched",
        arguments,
        [system.rate(*arguments), system.event_functions(*arguments)],
        list(ARGUMENTS),
        ["rate", "events"],
    )
    prepared = prepare(together)
    hold, body = _hold(prepared)
    both = finished(body)
    alone = Prepared(setup=prepared.setup, body=only(body, "rate"), written=prepared.written)
    return Watched(rate=alone, hold=hold, both=both, events=only(both, "events"))


def _hold(prepared: Prepared) -> tuple[StraightLine, StraightLine]:
    """What depends on the memory alone, and the body that finds it behind the memory."""
    sizes = dict(prepared.body.inputs)
    named = replace(
        prepared.body,
        inputs=tuple(
            ("settled" if n == "prepared" else n, size) for n, size in prepared.body.inputs
        ),
    )
    hold, rest = hoist_settled(named, ["z", "p", "settled"])
    kept = hold.output("prepared")
    builder = Builder()
    given = {
        name: builder.input(name, size + len(kept) if name == "z" else size)
        for name, size in sizes.items()
    }
    memory = given["z"]
    given["z"] = memory[: sizes["z"]]
    body = builder.finish(call_program(builder, rest, [*given.values(), memory[sizes["z"] :]]))
    return replace(hold, inputs=prepared.body.inputs, outputs=(("kept", kept),)), body


def finished(program: StraightLine) -> StraightLine:
    """A program as the machines run it: sines written out, products fused with sums, ordered."""
    return ordered(fuse_products(lower_trigonometry(program)))


def step_program(
    system: HybridSystem,
    rate: Prepared,
    method: ButcherTableau,
    powers: int,
    *,
    watched: Watched | None = None,
) -> StraightLine:
    """(x, z, segment, s, h, p, prepared) → following, used: one step of length h from s.

    `segment` holds the inputs' coefficients, channel by channel in ascending powers of the time s
    since its beginning; `used` is h. A system that is `watched` knows its
    rate at the beginning of a step, which is one more input, `slope`.
    """
    builder = Builder()
    x = builder.input("x", system.state.size)
    z = builder.input("z", dict(rate.body.inputs)["z"])
    segment = builder.input("segment", system.inputs.size * powers)
    s, h = builder.input("s", 1)[0], builder.input("h", 1)[0]
    p = builder.input("p", system.parameters.size)
    prepared = builder.input("prepared", len(rate.setup.output("prepared")))
    channels = [segment[i : i + powers] for i in range(0, len(segment), powers)]
    known = [] if watched is None else [builder.input("slope", system.state.size)]
    body = finished(rate.body) if watched is None else watched.both
    following = _runge_kutta(builder, body, method, x, channels, (z, p, prepared), s, h, known)
    return builder.finish({"following": following, "used": [h]})


def _runge_kutta(
    builder: Builder,
    body: StraightLine,
    method: ButcherTableau,
    x: list[int],
    channels: list[list[int]],
    fixed: tuple[list[int], list[int], list[int]],
    s: int,
    h: int,
    known: list[list[int]],
) -> list[int]:
    z, p, prepared = fixed
    stages = list(known)
    for row, fraction in list(zip(method.a, method.c, strict=True))[len(known) :]:
        time = builder.add(s, builder.multiply(builder.constant(float(fraction)), h))
        v = [_horner(builder, channel, time) for channel in channels]
        y = _combined(builder, x, h, stages, row)
        stages.append(call_program(builder, body, [y, z, v, p, prepared])["rate"])
    return _combined(builder, x, h, stages, method.b)


def _combined(
    builder: Builder, x: list[int], h: int, stages: list[list[int]], weights: FloatArray
) -> list[int]:
    """x + h Σ weight · stage, in the order of the generated C."""
    used = [
        (builder.constant(float(w)), k) for w, k in zip(weights, stages, strict=False) if w != 0
    ]
    if not used:
        return x
    (first, slope), *others = used
    following = []
    for i in range(len(x)):
        value = builder.multiply(first, slope[i])
        for weight, k in others:
            value = builder.apply(FMA, weight, k[i], value)
        following.append(builder.apply(FMA, h, value, x[i]))
    return following


def input_values(builder: Builder, segment: list[int], powers: int, time: int) -> list[int]:
    """Values of the inputs at a time since the beginning of their segment."""
    channels = (segment[i : i + powers] for i in range(0, len(segment), powers))
    return [_horner(builder, channel, time) for channel in channels]


def _horner(builder: Builder, coefficients: list[int], s: int) -> int:
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = builder.add(builder.multiply(value, s), coefficient)
    return value
