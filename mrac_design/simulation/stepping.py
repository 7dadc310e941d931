"""A hybrid system under an integration method as straight-line programs, for any machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from mrac_design.arrays import FloatArray
from mrac_design.codegen.ordering import ordered
from mrac_design.codegen.passes import fuse_products, hoist_settled, share_reciprocals
from mrac_design.codegen.reading import call_program, operations_as_written, read_function
from mrac_design.codegen.straight_line import Builder, OperationCount, StraightLine
from mrac_design.codegen.taylor import SeriesEvaluator
from mrac_design.codegen.trigonometry import lower_trigonometry
from mrac_design.simulation.method import ErrorControl, TaylorSeries
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import ButcherTableau

ARGUMENTS = ("x", "z", "v", "p")
"""Names of state, held memory, input and parameters in the programs."""
_SAFETY = 0.9


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


def finished(program: StraightLine) -> StraightLine:
    """A program as the machines run it: sines written out, products fused with sums, ordered."""
    return ordered(fuse_products(lower_trigonometry(program)))


def step_program(
    system: HybridSystem, rate: Prepared, method: ButcherTableau | TaylorSeries, powers: int
) -> StraightLine:
    """(x, z, segment, s, h, p, prepared) → following, used: one step of at most h from s.

    `segment` holds the inputs' coefficients, channel by channel in ascending powers of the time s
    since its beginning; `used` ≤ h is the length of the step.
    """
    builder = Builder()
    x = builder.input("x", system.state.size)
    z = builder.input("z", system.held.size)
    segment = builder.input("segment", system.inputs.size * powers)
    s, h = builder.input("s", 1)[0], builder.input("h", 1)[0]
    p = builder.input("p", system.parameters.size)
    prepared = builder.input("prepared", len(rate.setup.output("prepared")))
    channels = [segment[i : i + powers] for i in range(0, len(segment), powers)]
    if isinstance(method, ButcherTableau):
        body = finished(rate.body)
        following = _runge_kutta(builder, body, method, x, channels, (z, p, prepared), s, h)
        return builder.finish({"following": following, "used": [h]})
    terms = _taylor_terms(builder, rate.body, method.order, x, channels, (z, p, prepared), s, h)
    share = builder.constant(1.0)
    if method.control is not None:
        share = _allowed_share(builder, terms, method.control)
    following = []
    for entry in terms:
        value = entry[-1]
        for term in entry[-2::-1]:
            value = builder.add(builder.multiply(value, share), term)
        following.append(value)
    used = builder.multiply(h, share)
    return finished(builder.finish({"following": following, "used": [used]}))


def _runge_kutta(
    builder: Builder,
    body: StraightLine,
    method: ButcherTableau,
    x: list[int],
    channels: list[list[int]],
    fixed: tuple[list[int], list[int], list[int]],
    s: int,
    h: int,
) -> list[int]:
    z, p, prepared = fixed
    stages: list[list[int]] = []
    for row, fraction in zip(method.a, method.c, strict=True):
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
    return [
        builder.add(
            x[i], builder.multiply(h, builder.total([builder.multiply(w, k[i]) for w, k in used]))
        )
        for i in range(len(x))
    ]


def _taylor_terms(
    builder: Builder,
    body: StraightLine,
    order: int,
    x: list[int],
    channels: list[list[int]],
    fixed: tuple[list[int], list[int], list[int]],
    s: int,
    h: int,
) -> list[list[int]]:
    """Terms x⁽ᵏ⁾ hᵏ / k!, k = 0 … order, of every entry of the state."""
    states = [[position] for position in x]
    inputs = [_scaled_shift(builder, channel, s, h) for channel in channels]
    z, p, prepared = ([[position] for position in group] for group in fixed)
    evaluator = SeriesEvaluator(
        builder,
        body,
        [states, z, inputs, p, prepared],
        moving=[True, False, True, False, False],
    )
    for k in range(order):
        factor = builder.multiply(h, builder.constant(1 / (k + 1)))
        slopes = evaluator.advance()["rate"]
        for series, slope in zip(states, slopes, strict=True):
            series.append(builder.multiply(slope, factor))
    return states


def _scaled_shift(builder: Builder, channel: list[int], s: int, h: int) -> list[int]:
    """Coefficients about s, in powers of time over h, of a polynomial about 0."""
    shifted = list(channel)
    for low in range(len(channel) - 1):
        for k in range(len(channel) - 2, low - 1, -1):
            shifted[k] = builder.add(shifted[k], builder.multiply(shifted[k + 1], s))
    power = h
    for k in range(1, len(channel)):
        shifted[k] = builder.multiply(shifted[k], power)
        power = builder.multiply(power, h)
    return shifted


def _allowed_share(builder: Builder, terms: list[list[int]], control: ErrorControl) -> int:
    """Share of the step after which every last term is within its tolerance, at most 1.

    The last terms shrink with the order-th power of the share; roots are taken by square roots,
    which all machines round alike, of a power not above the order, so on the safe side.
    """
    order = len(terms[0]) - 1
    relative = builder.constant(control.relative)
    worst = builder.constant(0.0)
    for entry in terms:
        allowed = builder.multiply(relative, builder.apply(ca.OP_FABS, entry[0]))
        excess = builder.subtract(builder.apply(ca.OP_FABS, entry[-1]), allowed)
        worst = builder.apply(ca.OP_FMAX, excess, worst)
    ratio = builder.multiply(worst, builder.constant(1 / control.absolute))
    one = builder.constant(1.0)
    # A run that left the finite numbers goes on in whole steps; who reads it reports it.
    large = builder.apply(
        ca.OP_AND,
        builder.apply(ca.OP_LT, one, ratio),
        builder.apply(ca.OP_LT, ratio, builder.constant(1e300)),
    )
    share = builder.divide(one, builder.apply(ca.OP_FMAX, ratio, one))
    for _ in range(order.bit_length() - 1):
        share = builder.apply(ca.OP_SQRT, share)
    short = builder.multiply(builder.constant(_SAFETY), share)
    return builder.total(
        [
            builder.apply(ca.OP_IF_ELSE_ZERO, large, short),
            builder.apply(ca.OP_IF_ELSE_ZERO, builder.apply(ca.OP_NOT, large), one),
        ]
    )


def input_values(builder: Builder, segment: list[int], powers: int, time: int) -> list[int]:
    """Values of the inputs at a time since the beginning of their segment."""
    channels = (segment[i : i + powers] for i in range(0, len(segment), powers))
    return [_horner(builder, channel, time) for channel in channels]


def _horner(builder: Builder, coefficients: list[int], s: int) -> int:
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = builder.add(builder.multiply(value, s), coefficient)
    return value
