"""A scenario's runs: the continuous or the sampled loop around any controller, from rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mrac_design.arrays import FloatArray
from mrac_design.controller.linearisation import Linearisation
from mrac_design.controller.robot_step import build_robot_step
from mrac_design.controller.step import ControllerStep
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.robot import RobotDynamics
from mrac_design.simulation.closed_loop import ForceLoop, build_force_loop, resting_state
from mrac_design.simulation.contact import retreating
from mrac_design.simulation.engine import Engine, build_engine
from mrac_design.simulation.readout import force_loop_trajectory
from mrac_design.simulation.run import Progress, Recording, RunSettings, run
from mrac_design.simulation.sampled_loop import (
    ComputationalDelay,
    build_sampled_loop,
    resting_start,
    sampled_trajectory,
)
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import Scenario
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


def scenario_inputs(
    scenario: Scenario, heart: PiecewisePolynomial, reference: PiecewisePolynomial
) -> PiecewisePolynomial:
    """All inputs of the scenario's loop over a heart position (m) and force reference (N).

    Both are k channels over the whole run. The surface's own steps are added to the heart; a
    sampled loop also gets the sensor's noise and bias; what the contact needs comes last.
    """
    sampling, contact = scenario.sampling, scenario.contact.build(scenario.stiffness)
    signals = [heart, reference]
    if scenario.contact.retreat.levels != (0.0,):
        signals[0] = retreating(heart, scenario.contact.retreat)
    if isinstance(sampling, SampledMeasurement):
        signals.append(
            sampling.force_sensor.errors(
                axes=heart.channels, period=sampling.domain.period, duration=heart.end
            )
        )
    return stack(*signals, *contact.exogenous(signals[0]))


def ready_loop(
    scenario: Scenario,
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controller: ControllerStep,
    *,
    force: FloatArray,
) -> ReadyLoop:
    """The loop of `scenario` with `controller` on every force axis, at rest on `force` (N), (k,).

    The controller must be of the scenario's time domain. Raises SingularPostureError for a home
    posture beyond the scenario's limit.
    """
    robot, limit = dynamics.description, scenario.simulation.condition_limit
    controllers = [controller] * len(robot.force_axes)
    contact = scenario.contact.build(scenario.stiffness)
    friction, sampling = scenario.friction.build(), scenario.sampling
    if isinstance(sampling, Continuous):
        loop = build_force_loop(
            dynamics, linearisation, controllers, contact=contact, friction=friction
        )
        return ReadyLoop(
            loop=loop,
            state=resting_state(loop, posture=robot.home, force=force, condition_limit=limit),
            held=None,
            readout=lambda recording, engine: force_loop_trajectory(loop, recording, engine=engine),
        )
    sampled = build_sampled_loop(
        dynamics,
        build_robot_step(dynamics, linearisation, controllers, time_domain=sampling.domain),
        contact=contact,
        friction=friction,
        delay=ComputationalDelay(sampling.delay),
        sensor=sampling.force_sensor.build(),
        joints=sampling.encoder.build(),
    )
    start = resting_start(sampled, posture=robot.home, force=force, condition_limit=limit)
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
