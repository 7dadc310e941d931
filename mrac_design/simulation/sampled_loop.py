"""The robot on the heart under a sampled controller, as one hybrid system.

    at sampling instants   Fe + noise ─► sensor ─► robot step ─► pipeline of d samples ─┐
                           q, q̇ ─► joint sensors ─────▲                                 │ hold
    in between             robot and tissue, continuous  ◄─────────── drive limits ◄─ Γ ┘

The controller is the very `RobotStep` that is exported; only the plant is integrated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.robot_step import RobotStep, saturated
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.robot import RobotDynamics, check_posture, inertial_parameters
from mrac_design.simulation.closed_loop import ForceLoop, Plant
from mrac_design.simulation.contact import Contact
from mrac_design.simulation.encoder import JointSensor
from mrac_design.simulation.friction import Friction
from mrac_design.simulation.readout import force_loop_trajectory
from mrac_design.simulation.run import Recording
from mrac_design.simulation.sensor import ForceSensing
from mrac_design.simulation.system import ARGUMENT_NAMES, MODES, Event, HybridSystem, Kinks
from mrac_design.simulation.trajectory import Signal, Trajectory


@dataclass(frozen=True, slots=True)
class ComputationalDelay:
    """Whole samples between a measurement and the instant its torque acts."""

    samples: int
    """Number of samples, ≥ 0; with 0 the torque acts at the instant of the measurement."""

    def __post_init__(self) -> None:
        if not (isinstance(self.samples, int) and self.samples >= 0):
            raise ParameterError("delay", self.samples, "must be a whole number of samples ≥ 0")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledForceLoop:
    """A closed loop around a sampled controller, ready to run."""

    loop: ForceLoop
    """The equations; inputs are heart position (m), force reference (N) and sensor noise (N),
    k of each, and what the contact asks for."""
    step: RobotStep
    """The controller inside."""
    sensor: ForceSensing
    """What it measures the force with."""
    joints: JointSensor
    """What it measures the joints with."""


def build_sampled_loop(
    dynamics: RobotDynamics,
    step: RobotStep,
    *,
    contact: Contact,
    friction: Friction,
    delay: ComputationalDelay,
    sensor: ForceSensing,
    joints: JointSensor,
    kinks: Kinks = Kinks.LOCATED,
) -> SampledForceLoop:
    """Close the loop of the true robot `dynamics` over the true `contact` and `friction`.

    The torque is held between samples (zero-order hold) and limited by the drives themselves.
    Events are the limits of the efforts, met at samples, and, where it can be lost, the contact.
    Raises ParameterError for a contact made for another number of axes, or a controller made for
    other axes or joints than the robot's.
    """
    robot = dynamics.description
    axes, n = len(robot.force_axes), robot.joint_count
    if (robot.force_axes, n) != (step.robot.force_axes, step.robot.joint_count):
        raise ParameterError(
            "robot", robot.name, f"has other joints or force axes than {step.robot.name}"
        )
    values: dict[str, ArrayLike] = {
        "inertia": inertial_parameters(robot),
        **contact.values(axes),
        **friction.values(robot),
        "drive_limit": robot.effort_limits,
        "controller": step.parameter_values,
        **sensor.parameters(),
        **joints.values(robot, step.time_domain.period),
    }
    parameters = Layout(tuple((name, int(np.size(value))) for name, value in values.items()))
    plant = Plant(dynamics=dynamics, contact=contact, friction=friction)
    events = (*plant.contact_events(), *plant.effort_events()) if kinks is Kinks.LOCATED else ()
    held = Layout(
        (
            ("controller", step.state.size),
            ("pipeline", n * (delay.samples + 1)),
            *sensor.memory(axes).blocks,
            *joints.memory(n).blocks,
            *step.signals.blocks,
            *([(MODES, len(events))] if events else []),
        )
    )
    state = Layout((("joint_position", n), ("joint_velocity", n), *sensor.state(axes).blocks))
    inputs = Layout(
        (("heart", axes), ("reference", axes), ("noise", axes), *contact.inputs(axes).blocks)
    )
    system = _system(plant, step, (sensor, joints), events, state, held, inputs, parameters)
    loop = ForceLoop(
        system=system,
        parameter_values=parameters.pack(values),
        dynamics=dynamics,
        controllers=step.controllers,
    )
    return SampledForceLoop(loop=loop, step=step, sensor=sensor, joints=joints)


def _system(
    plant: Plant,
    step: RobotStep,
    sensors: tuple[ForceSensing, JointSensor],
    events: tuple[Event, ...],
    state: Layout,
    held: Layout,
    inputs: Layout,
    parameters: Layout,
) -> HybridSystem:
    n = plant.dynamics.description.joint_count
    sensor, joints = sensors
    arguments = [
        state.symbols("state"),
        held.symbols("held"),
        inputs.symbols("input"),
        parameters.symbols("parameters"),
    ]
    layouts = (state, held, inputs, parameters)
    states, memory, exogenous, symbols = (
        layout.split(vector) for layout, vector in zip(layouts, arguments, strict=True)
    )
    q, qd = states["joint_position"], states["joint_velocity"]
    tip, force = plant.contact_force(states, exogenous, symbols)
    reading = sensor.sample(memory, force, exogenous["noise"], symbols, states)
    seen = joints.read(memory, q, qd, symbols)
    following, torque, signals = step.step(
        memory["controller"],
        seen.position,
        seen.velocity,
        reading["measured_force"],
        exogenous["reference"],
        symbols["controller"],
    )
    # The newest torque enters at the front; the one that acts leaves at the back.
    pipeline = ca.vertcat(torque, memory["pipeline"])[: memory["pipeline"].numel()]
    acting = memory["pipeline"][-n:]
    effort = saturated(acting, symbols["drive_limit"])
    pushing, functions = force, None
    if events:
        margin = symbols["drive_limit"] - ca.fabs(acting)
        functions = ca.vertcat(plant.contact_functions(states, exogenous, symbols), margin)
        made = memory[MODES][: len(plant.contact_events())]
        _, pushing = plant.contact_force(states, exogenous, symbols, made)
    moving = {
        "joint_position": qd,
        "joint_velocity": plant.acceleration(states, effort, pushing, symbols),
        **sensor.rate(states, pushing, symbols),
    }
    recorded = {
        "force": force,
        "measured_force": memory["measured_force"],
        "force_reference": exogenous["reference"],
        "tip": tip,
        "heart": exogenous["heart"],
        "effort": effort,
        "computed_effort": memory["pipeline"][:n],
        "joint_position": q,
        "joint_velocity": qd,
        **{name: memory[name] for name, _ in step.signals.blocks},
    }
    update = {
        "controller": following,
        "pipeline": pipeline,
        **reading,
        **seen.memory,
        **step.signals.split(signals),
        **({MODES: memory[MODES]} if events else {}),
    }

    def function(name: str, result: ca.SX, label: str) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [label])

    outputs = Layout(tuple((name, value.numel()) for name, value in recorded.items()))
    return HybridSystem(
        state=state,
        held=held,
        inputs=inputs,
        parameters=parameters,
        outputs=outputs,
        rate=function("rate", state.join(moving), "rate"),
        output=function("output", outputs.join(recorded), "output"),
        update=function("update", held.join(update), "next_held"),
        sampling_period=step.time_domain.period,
        events=events,
        event_functions=None
        if functions is None
        else function("event_functions", functions, "events"),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledStart:
    """Where a sampled loop starts from."""

    state: FloatArray
    """Initial state of the robot, shape (state.size,)."""
    held: FloatArray
    """Memory before the first sample, shape (held.size,)."""


def resting_start(
    sampled: SampledForceLoop, *, posture: ArrayLike, force: ArrayLike, condition_limit: float
) -> SampledStart:
    """The loop at rest at a posture, the controller settled on its force (N, k values).

    The torques still on their way are those that hold the robot at rest. Raises
    SingularPostureError when the task Jacobian's condition number there exceeds
    `condition_limit`.
    """
    loop, step = sampled.loop, sampled.step
    check_posture(loop.dynamics, posture, condition_limit)
    n = loop.dynamics.description.joint_count
    still = np.zeros(n)
    level, joints = readonly(np.ravel(force)), readonly(np.ravel(posture))
    settled = step.resting_state(level)
    _, torque, _ = step.step(settled, joints, still, level, level, step.parameter_values)
    layout = loop.system.held
    queue = layout.slices["pipeline"]
    memory: Mapping[str, ArrayLike] = {
        **{name: 0.0 for name, _ in layout.blocks},
        "controller": settled,
        "pipeline": np.tile(torque.full().ravel(), (queue.stop - queue.start) // n),
        **sampled.joints.resting(joints, loop.dynamics.description),
    }
    state = loop.system.state.pack(
        {"joint_position": posture, "joint_velocity": still, **sampled.sensor.resting(level)}
    )
    return SampledStart(state=readonly(state), held=layout.pack(memory))


def sampled_trajectory(
    sampled: SampledForceLoop, recording: Recording, *, engine: str
) -> Trajectory:
    """Signals of a recorded run: those of the continuous loop and what sampling adds to them."""
    plain = force_loop_trajectory(sampled.loop, recording, engine=engine)
    outputs = sampled.loop.system.outputs.split(np.asarray(recording.outputs))
    axes = sampled.loop.dynamics.description.force_axes
    added = {
        "measured_force": ("N", "contact force as the sensor read it last"),
        "applied_command": ("m/s²", "command that the limited torques carry out"),
    }
    signals = dict(plain.signals)
    for name, (unit, text) in added.items():
        signals[name] = Signal(values=outputs[name], unit=unit, labels=axes, description=text)
    return replace(plain, signals=signals)
