"""The sampled loop of a scenario, ready for the simulation and for the clock alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.robot_step import RobotStep
from mrac_design.errors import ParameterError
from mrac_design.export.gain_set import GainSet, robot_step_of
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.robot import RobotDynamics
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.sampled_loop import (
    ComputationalDelay,
    SampledForceLoop,
    SampledStart,
    build_sampled_loop,
    resting_start,
)
from mrac_design.simulation.sampling_choices import (
    EncoderChoice,
    ForceSensorChoice,
    SampledMeasurement,
    Sampling,
)
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.schedule import Schedule, build_schedule
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem, Kinks
from mrac_design.simulation.tableau import RK4
from mrac_design.study import exogenous_inputs, scenario_motion
from mrac_design.time_domain import Continuous


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RealtimeExperiment:
    """A controller at one rate in its loop, at rest before the first period."""

    step: RobotStep
    """The controller that is exported."""
    sampled: SampledForceLoop
    """The loop around it."""
    plant: HybridSystem
    """The loop without the controller, see `plant_side`."""
    inputs: PiecewisePolynomial
    """Heart position (m), force reference (N), noise (N), k channels each, and the contact's."""
    start: SampledStart
    """Where the loop starts from."""
    resting_force: FloatArray
    """Force it is at rest at (N), shape (k,)."""
    delay: int
    """Whole samples between a measurement and its torque."""
    settings: RunSettings
    """Length, integration step and, as period of the records, the sampling period."""

    def schedule(self) -> Schedule:
        """Intervals of the run; each period begins with an update and a record."""
        return build_schedule(
            self.inputs,
            duration=self.settings.duration,
            step=self.settings.step,
            record_period=self.settings.record_period,
            sampling_period=self.settings.record_period,
        )


def build_experiment(
    scenario: Scenario, gains: GainSet, dynamics: RobotDynamics, *, rate: float, delay: int | None
) -> RealtimeExperiment:
    """The loop of `scenario` under the controller `gains` sampled at `rate` (Hz).

    Sensors, tissue and friction are the scenario's; a scenario in continuous time measures
    exactly. `delay` is in whole samples; None is the scenario's own, and 1 for a continuous one.
    Raises ParameterError for a rate that is not positive or a run shorter than a period, and the
    errors of `resting_start`.
    """
    duration = scenario.simulation.duration
    if not (0 < rate < float("inf") and duration * rate >= 1):
        raise ParameterError("rate", rate, f"must be in Hz, with a period within {duration:g} s")
    sampling = _sampling(scenario.sampling, rate, delay)
    step = robot_step_of(gains, scenario.robot, sampling.domain)
    sampled = build_sampled_loop(
        dynamics,
        step,
        contact=scenario.contact.build(scenario.stiffness),
        friction=scenario.friction.build(),
        delay=ComputationalDelay(sampling.delay),
        sensor=sampling.force_sensor.build(),
        joints=sampling.encoder.build(),
        # The simulated robot of the runner is advanced period by period, without looking back.
        kinks=Kinks.CROSSED,
    )
    inputs = exogenous_inputs(
        replace(scenario, sampling=sampling), dynamics, scenario_motion(scenario)
    )
    resting = scenario.reference.initial
    return RealtimeExperiment(
        step=step,
        sampled=sampled,
        plant=plant_side(sampled),
        inputs=inputs,
        start=resting_start(
            sampled,
            posture=dynamics.description.home,
            force=resting,
            condition_limit=scenario.simulation.condition_limit,
        ),
        resting_force=resting,
        delay=sampling.delay,
        settings=RunSettings(
            duration=duration, step=scenario.simulation.step, record_period=step.time_domain.period
        ),
    )


_EXACT_FORCE = ForceSensorChoice(
    noise=0.0, bias=0.0, resolution=0.0, decimation=1, mode_frequency=0.0, mode_damping=0.0, seed=0
)
_EXACT_JOINTS = EncoderChoice(counts_per_turn=0.0, velocity_cutoff=0.0)


def _sampling(sampling: Sampling, rate: float, delay: int | None) -> SampledMeasurement:
    if isinstance(sampling, Continuous):
        return SampledMeasurement(
            rate=rate,
            delay=1 if delay is None else delay,
            force_sensor=_EXACT_FORCE,
            encoder=_EXACT_JOINTS,
        )
    return replace(sampling, rate=rate, delay=sampling.delay if delay is None else delay)


def simulated_torque(experiment: RealtimeExperiment) -> FloatArray:
    """Efforts computed in each period of the plain simulation (N·m or N), shape (N, n).

    Raises SimulationError when the loop is unstable at this rate.
    """
    loop = experiment.sampled.loop
    recording = run(
        build_engine(loop.system, RK4, input_powers=experiment.inputs.degree + 1),
        loop.system,
        inputs=experiment.inputs,
        parameters=loop.parameter_values,
        initial_state=experiment.start.state,
        initial_held=experiment.start.held,
        settings=experiment.settings,
    )
    outputs = loop.system.outputs.split(np.asarray(recording.outputs))
    return readonly(outputs["computed_effort"])


TOLD = "told"
"""Block of the plant side's memory: q, q̇ (n,), force, reference (k,), what the controller sees."""


def plant_side(sampled: SampledForceLoop) -> HybridSystem:
    """The loop without its controller: robot and tissue, and at sampling instants the sensors.

    The equations are the loop's own. Its memory is the loop's and a block `TOLD`, renewed at every
    sampling instant; whoever runs it puts the torques into the memory's pipeline.
    """
    system = sampled.loop.system
    update = system.update
    assert update is not None
    k, n = len(sampled.loop.controllers), sampled.step.robot.joint_count
    held = Layout((*system.held.blocks, (TOLD, 2 * n + 2 * k)))
    x, v, p = (layout.symbols("s") for layout in (system.state, system.inputs, system.parameters))
    z = held.symbols("held")
    own = z[: system.held.size]
    states, before = system.state.split(x), held.split(z)
    after = system.held.split(update(x, own, v, p))
    seen = sampled.joints.read(
        before, states["joint_position"], states["joint_velocity"], system.parameters.split(p)
    )
    reference = system.inputs.split(v)["reference"]
    told = ca.vertcat(seen.position, seen.velocity, after["measured_force"], reference)
    controller = {"controller", "pipeline", *(name for name, _ in sampled.step.signals.blocks)}
    sensed = {name: value for name, value in after.items() if name not in controller}
    arguments, names = [x, z, v, p], list(ARGUMENT_NAMES)
    following = held.join({**before, **sensed, TOLD: told})
    nothing = ca.Function("output", arguments, [ca.SX(0, 1)], names, ["output"])
    return replace(
        system,
        held=held,
        outputs=Layout(()),
        rate=ca.Function("rate", arguments, [system.rate(x, own, v, p)], names, ["rate"]),
        output=nothing,
        update=ca.Function("update", arguments, [following], names, ["next_held"]),
    )
