"""A scenario's runs: the continuous or the sampled loop around any controller, from rest."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from threading import Lock

from mrac_design.arrays import FloatArray
from mrac_design.controller.linearisation import Linearisation
from mrac_design.controller.step import ControllerStep
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.robot import RobotDynamics
from mrac_design.simulation.closed_loop import ForceLoop, build_force_loop, resting_state
from mrac_design.simulation.engine import Engine, NativeEngine, build_engine
from mrac_design.simulation.readout import force_loop_trajectory
from mrac_design.simulation.run import Progress, Recording, RunSettings, run
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.system import Kinks
from mrac_design.simulation.tableau import RK4
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.time_domain import Continuous


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadyLoop:
    """A loop at rest on the heart, whatever its time domain."""

    loop: ForceLoop
    """The equations."""
    state: FloatArray
    """Initial state."""
    held: FloatArray | None
    """Memory before the first sample; none in continuous time."""
    readout: Callable[[Recording, str], Trajectory]
    """Signals of a recording made on a named engine."""


def ready_loop(
    scenario: Scenario,
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controller: ControllerStep,
    *,
    kinks: Kinks = Kinks.LOCATED,
) -> ReadyLoop:
    """The loop of `scenario` with `controller` on every force axis, at rest on the first reference.

    The controller must be of the scenario's time domain. Raises SingularPostureError for a home
    posture beyond the scenario's limit.
    """
    robot, sampling = dynamics.description, scenario.sampling
    controllers = [controller] * len(robot.force_axes)
    if not isinstance(sampling, Continuous):
        return _ready_sampled(scenario, sampling, dynamics, linearisation, controllers, kinks)
    loop = build_force_loop(
        dynamics,
        linearisation,
        controllers,
        contact=scenario.contact.build(scenario.stiffness),
        friction=scenario.friction.build(),
        kinks=kinks,
    )
    state = resting_state(
        loop,
        posture=robot.home,
        force=scenario.reference.initial,
        condition_limit=scenario.simulation.condition_limit,
    )
    return ReadyLoop(
        loop=loop,
        state=state,
        held=None,
        readout=lambda recording, engine: force_loop_trajectory(loop, recording, engine=engine),
    )


def _ready_sampled(
    scenario: Scenario,
    sampling: SampledMeasurement,
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controllers: Sequence[ControllerStep],
    kinks: Kinks,
) -> ReadyLoop:
    # Loaded where they are used: a continuous study needs neither.
    from mrac_design.controller.robot_step import build_robot_step
    from mrac_design.simulation.sampled_loop import (
        ComputationalDelay,
        build_sampled_loop,
        resting_start,
        sampled_trajectory,
    )

    sampled = build_sampled_loop(
        dynamics,
        build_robot_step(dynamics, linearisation, controllers, time_domain=sampling.domain),
        contact=scenario.contact.build(scenario.stiffness),
        friction=scenario.friction.build(),
        delay=ComputationalDelay(sampling.delay),
        sensor=sampling.force_sensor.build(),
        joints=sampling.encoder.build(),
        kinks=kinks,
    )
    start = resting_start(
        sampled,
        posture=dynamics.description.home,
        force=scenario.reference.initial,
        condition_limit=scenario.simulation.condition_limit,
    )
    return ReadyLoop(
        loop=sampled.loop,
        state=start.state,
        held=start.held,
        readout=lambda recording, engine: sampled_trajectory(sampled, recording, engine=engine),
    )


def simulate(
    scenario: Scenario,
    ready: ReadyLoop,
    inputs: PiecewisePolynomial,
    *,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> tuple[Trajectory, Engine]:
    """Run a loop over `inputs` (see `scenario_inputs`) and read its signals out.

    `engine` is one made for a loop that differs in parameters only; the one used is returned.
    """
    system, choice = ready.loop.system, scenario.simulation
    engine = engine or build_engine(system, RK4, input_powers=inputs.degree + 1)
    recording = run(
        engine,
        system,
        inputs=inputs,
        parameters=ready.loop.parameter_values,
        initial_state=ready.state,
        initial_held=ready.held,
        settings=RunSettings(
            duration=choice.duration, step=choice.step, record_period=choice.record_period
        ),
        progress=progress,
    )
    return ready.readout(recording, engine.name), engine


def simulate_side_by_side(
    scenario: Scenario,
    loops: Sequence[ReadyLoop],
    inputs: PiecewisePolynomial,
    *,
    progress: Progress | None = None,
) -> tuple[Trajectory, ...]:
    """Run loops that differ in parameters only, on one engine and as many threads as processors.

    Each trajectory has the very bits of a run by itself. When a run fails, or is cancelled, so
    are the others. The progress told is that of all of them.
    """
    engine = build_engine(loops[0].loop.system, RK4, input_powers=inputs.degree + 1)
    # CasADi's interpreter holds Python's lock: threads would only take turns.
    native = isinstance(engine, NativeEngine)
    workers = min(len(loops), len(os.sched_getaffinity(0))) if native else 1
    shares = _SharedProgress(len(loops), progress)
    with ThreadPoolExecutor(workers) as pool:
        runs = [
            pool.submit(
                simulate, scenario, ready, inputs, engine=engine, progress=partial(shares, number)
            )
            for number, ready in enumerate(loops)
        ]
        try:
            return tuple(finished.result()[0] for finished in runs)
        except BaseException:
            shares.cancel()
            raise


class _CancelledError(Exception):
    """Ends a run that nobody waits for any more."""


class _SharedProgress:
    """The finished share of several runs at once."""

    def __init__(self, count: int, progress: Progress | None) -> None:
        self._done = [0.0] * count
        self._progress = progress
        self._lock = Lock()
        self._cancelled = False

    def __call__(self, number: int, fraction: float) -> None:
        """Run `number` has come that far; raises where it should end."""
        with self._lock:
            if self._cancelled:
                raise _CancelledError
            self._done[number] = fraction
            if self._progress is not None:
                self._progress(sum(self._done) / len(self._done))

    def cancel(self) -> None:
        """Let every run end where it is asked for its progress next."""
        self._cancelled = True
