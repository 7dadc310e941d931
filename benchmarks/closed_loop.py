"""The closed loop, one run and many, by everyone who is installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from benchmarks.casadi_peer import CasadiExternal
from benchmarks.control_peer import PythonControl
from benchmarks.heyoka_peer import HeyokaBatch, HeyokaRun
from benchmarks.measure import Result, interleaved, timed
from benchmarks.problem import RECORD, Problem, five_joint_loop
from mrac_design.simulation.dormand_prince_8 import DORMAND_PRINCE_8
from mrac_design.simulation.lanes import LANES, Case, LaneEngine
from mrac_design.simulation.method import Method
from mrac_design.simulation.reduction import tracking_reduction
from mrac_design.simulation.schedule import build_schedule
from mrac_design.simulation.system import Kinks
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from mrac_design.simulation.verner_7 import VERNER_7

ACCEPTED = 2e-2
"""Largest force error (N) with which a contestant counts as solving the problem."""
OWN = "mrac_design"
OURS: tuple[tuple[str, Method, float], ...] = (
    ("RK4 1 ms", RK4, 1e-3),
    ("RK4 0.5 ms", RK4, 5e-4),
    ("RK4 0.1 ms", RK4, 1e-4),
    ("Dormand–Prince 5, 1 ms", DORMAND_PRINCE_5, 1e-3),
    ("Dormand–Prince 5, 0.5 ms", DORMAND_PRINCE_5, 5e-4),
    ("Verner 7, 1 ms", VERNER_7, 1e-3),
    ("Verner 7, 0.5 ms", VERNER_7, 5e-4),
    *(
        (f"Dormand–Prince 8, {1e3 * step:g} ms", DORMAND_PRINCE_8, step)
        for step in (4e-3, 3e-3, 2e-3, 1.6e-3, 1e-3, 5e-4)
    ),
)
SLOW = 0.5
"""Simulated seconds of the peer that is a thousand times slower."""


@dataclass(slots=True)
class Contestant:
    """Someone who solves the problem."""

    name: str
    run: Callable[[], np.ndarray]
    """Does the work."""
    forces: Callable[[np.ndarray], np.ndarray]
    """Forces at the records (N) from what `run` returns."""
    setup: float
    per_call: float
    """Simulated seconds × runs in a call."""
    note: str = ""


def single_runs(problem: Problem, compiler: str, *, rounds: int, say) -> list[Result]:
    """Processor time (ms) per simulated second of one run."""
    contestants = [_ours(problem, compiler, *item) for item in OURS]
    located = five_joint_loop(problem.duration, kinks=Kinks.LOCATED)
    with_events = _ours(located, compiler, "Dormand–Prince 8, 2 ms", DORMAND_PRINCE_8, 2e-3)
    with_events.name = "the same with events located, Dormand–Prince 8, 2 ms"
    contestants.append(with_events)
    if find_spec("heyoka"):
        contestants += [
            _heyoka(problem, t, fold=f) for f in (False, True) for t in (1e-4, 1e-6, 1e-8)
        ]
    else:
        say("heyoka is not installed: left out (pip install 'mrac-design[bench]')")
    contestants += [_casadi(problem, compiler, generated=flag) for flag in (True, False)]
    if find_spec("control"):
        contestants.append(_python_control(problem))
    else:
        say("python-control is not installed: left out")
    return _measured(contestants, problem.reference(), rounds=rounds, say=say)


def ensembles(problem: Problem, compiler: str, *, rounds: int, say) -> list[Result]:
    """Processor time (ms) per simulated second of one of many runs with random parameters."""
    parameters = random_parameters(problem, LANES)
    contestants = [_our_lanes(problem, compiler, parameters, *item) for item in OURS]
    if find_spec("heyoka"):
        contestants += [_heyoka_lanes(problem, parameters, t) for t in (1e-4, 1e-6)]
    contestants.append(
        replace(_casadi(problem, compiler, generated=True), note="one run after the other")
    )
    return _measured(contestants, problem.reference(), rounds=rounds, say=say)


def random_parameters(problem: Problem, count: int) -> np.ndarray:
    """Tissue and body masses scaled at random; the first column is the problem itself."""
    layout, generator = problem.system.parameters, np.random.default_rng(1)
    columns = []
    for number in range(count):
        values = problem.parameters
        if number:
            values[layout.slices["stiffness"]] *= generator.uniform(0.6, 1.5)
            values[layout.slices["inertia"]] *= generator.uniform(0.9, 1.1)
        columns.append(values)
    return np.array(columns).T.copy()


def _ours(problem: Problem, compiler: str, name: str, method: Method, step: float) -> Contestant:
    engine, setup = timed(lambda: problem.engine(method, compiler))
    return Contestant(
        f"{OWN}, {name}", lambda: problem.run(engine, step), lambda f: f, setup, problem.duration
    )


def _heyoka(problem: Problem, tolerance: float, *, fold: bool) -> Contestant:
    run, setup = timed(lambda: HeyokaRun(problem, tolerance, fold=fold))
    family = "heyoka for these parameters only" if fold else "heyoka"
    return Contestant(
        f"{family}, tolerance {tolerance:g}", run, problem.forces, setup, problem.duration,
        "states only, no outputs",
    )  # fmt: skip


def _casadi(problem: Problem, compiler: str, *, generated: bool) -> Contestant:
    run, setup = timed(lambda: CasadiExternal(problem, 5e-4, compiler, generated=generated))
    name = "external in mapaccum" if generated else "own machine in mapaccum"
    return Contestant(
        f"CasADi {name}, RK4 0.5 ms", run, problem.forces, setup, problem.duration,
        "states only, no outputs",
    )  # fmt: skip


def _python_control(problem: Problem) -> Contestant:
    short = replace(problem, duration=SLOW)
    run, setup = timed(lambda: PythonControl(short, 1e-6))
    return Contestant(
        "python-control, NumPy right-hand side, RK45 1e-6", run, short.forces, setup, SLOW,
        f"the first {SLOW:g} s, straight-line code",
    )  # fmt: skip


def _our_lanes(
    problem: Problem,
    compiler: str,
    parameters: np.ndarray,
    name: str,
    method: Method,
    step: float,
) -> Contestant:
    reduction = tracking_reduction(problem.system.outputs, settling=0.1)
    engine, setup = timed(
        lambda: LaneEngine(
            problem.system,
            method,
            reduction,
            input_powers=problem.inputs.degree + 1,
            compiler=compiler,
        )
    )
    cases = [
        Case(parameters=column, initial_state=problem.state, inputs=problem.inputs)
        for column in parameters.T
    ]
    schedule = build_schedule(
        problem.inputs,
        duration=problem.duration,
        step=step,
        record_period=RECORD,
        sampling_period=None,
        spanning=engine.spanning,
    )
    scalar = problem.engine(method, compiler)
    # A lane has the bits of the scalar run, so that one tells the error.
    return Contestant(
        f"{OWN}, {LANES} lanes, {name}",
        lambda: engine.accumulate(schedule, cases),
        lambda _: problem.run(scalar, step),
        setup,
        problem.duration * LANES,
    )


def _heyoka_lanes(problem: Problem, parameters: np.ndarray, tolerance: float) -> Contestant:
    run, setup = timed(lambda: HeyokaBatch(problem, tolerance, LANES))
    return Contestant(
        f"heyoka, batch of {LANES}, tolerance {tolerance:g}",
        lambda: run(parameters),
        lambda states: problem.forces(states[:, :, 0]),
        setup,
        problem.duration * LANES,
        "states only, no figures of merit",
    )


def _measured(
    contestants: list[Contestant], reference: np.ndarray, *, rounds: int, say
) -> list[Result]:
    agreed, errors = [], {}
    for contestant in contestants:
        forces = contestant.forces(contestant.run())
        error = float(np.abs(forces - reference[: len(forces)]).max())
        if error < ACCEPTED:
            agreed.append(contestant)
            errors[contestant.name] = error
        else:
            say(f"{contestant.name} is {error:.2g} N off and is not timed")
    times = interleaved({c.name: c.run for c in agreed}, rounds=rounds)
    return [
        Result(
            name=c.name,
            turns=1e3 * times[c.name] / c.per_call,
            error=errors[c.name],
            setup=c.setup,
            note=c.note,
        )
        for c in agreed
    ]
