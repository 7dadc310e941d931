"""Names, units and labels for what a force loop records."""

from __future__ import annotations

from mrac_design.controller.adaptive import BIAS
from mrac_design.design import gain_names
from mrac_design.simulation.closed_loop import ForceLoop
from mrac_design.simulation.run import Recording
from mrac_design.simulation.trajectory import Signal, Trajectory

_BY_AXIS = {
    "force": ("N", "contact force"),
    "desired_force": ("N", "desired force, the pre-filtered reference"),
    "model_force": ("N", "output of the reference model"),
    "force_reference": ("N", "force reference before the pre-filter"),
    "tip": ("m", "tool tip position"),
    "heart": ("m", "heart surface position"),
    "command": ("m/s²", "acceleration commanded by the force controller"),
    "augmented_error": ("N", "augmented error"),
}
_BY_JOINT = {
    "joint_position": ("rad or m", "joint position"),
    "joint_velocity": ("rad/s or m/s", "joint velocity"),
}


def force_loop_trajectory(loop: ForceLoop, recording: Recording, *, engine: str) -> Trajectory:
    """Signals of a recorded run of `loop`; motor torques are efforts through the transmission."""
    robot = loop.dynamics.description
    outputs = loop.system.outputs.split(recording.outputs)
    joints = tuple(joint.name for joint in robot.joints)
    signals = {
        name: Signal(values=outputs[name], unit=unit, labels=robot.force_axes, description=text)
        for name, (unit, text) in _BY_AXIS.items()
    }
    signals |= {
        name: Signal(values=outputs[name], unit=unit, labels=joints, description=text)
        for name, (unit, text) in _BY_JOINT.items()
    }
    signals["torque"] = Signal(
        values=outputs["effort"] * robot.transmission,
        unit="N·m",
        labels=joints,
        description="motor torque",
    )
    gains = outputs["adapted_gains"]
    per_axis = gains.shape[1] // len(robot.force_axes)
    names = (*gain_names(per_axis // 2 - 2), BIAS)  # r1', n + 1 of S, n + 1 of T and the bias
    signals["adapted_gains"] = Signal(
        values=gains,
        unit="1",
        labels=tuple(f"{axis} {name}" for axis in robot.force_axes for name in names),
        description="adapted gains, scaled to order one",
    )
    return Trajectory(time=recording.time, signals=signals, engine=engine, events=recording.events)
