"""A serial robot in numbers: its parts, gravity, tool and task."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.robot.formulas import (
    DH_CONVENTION,
    dh_table,
    drive_table,
    inertial_table,
    number,
)
from mrac_design.robot.parts import (
    AXIS_NAMES,
    PHYSICAL_TOLERANCE,
    Body,
    Joint,
    TaskDefinition,
    store_array,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotDescription:
    """A serial robot: all numbers its equations of motion need, and where they come from."""

    name: str
    """Short name of the robot."""
    provenance: str
    """Where the numbers come from and what is assumed, for people to read."""
    joints: tuple[Joint, ...]
    """Joints from the base to the tool, n of them."""
    bodies: tuple[Body, ...]
    """Body moved by each joint, n of them."""
    gravity: FloatArray
    """g, acceleration of gravity in the base frame (m/s²), shape (3,)."""
    tool_tip: FloatArray
    """Tool tip in the last link frame (m), shape (3,)."""
    tool_axis: FloatArray
    """Unit vector along the tool in the last link frame (–), shape (3,)."""
    task: TaskDefinition
    """The task whose Jacobian is inverted."""

    def __post_init__(self) -> None:
        for name in ("gravity", "tool_tip", "tool_axis"):
            store_array(self, name, (3,))
        if len(self.bodies) != len(self.joints) or not self.joints:
            raise ParameterError(
                "bodies", len(self.bodies), f"one body per joint needed, {len(self.joints)} joints"
            )
        length = float(np.linalg.norm(self.tool_axis))
        if abs(length - 1) > PHYSICAL_TOLERANCE:
            raise ParameterError("tool_axis", self.tool_axis.tolist(), f"length {length:g}, not 1")
        if self.task.size != self.joint_count:
            raise ParameterError(
                "task",
                f"{self.task.size} components",
                f"the task Jacobian must be square: {self.joint_count} joints need "
                f"{self.joint_count} components",
            )
        names = [joint.name for joint in self.joints]
        if len(set(names)) != len(names):
            raise ParameterError("joints", ", ".join(names), "joint names must differ")

    @property
    def joint_count(self) -> int:
        """n, the number of joints."""
        return len(self.joints)

    @property
    def home(self) -> FloatArray:
        """Joint variables at the home posture (rad or m), shape (n,)."""
        return readonly([joint.home for joint in self.joints])

    @property
    def effort_limits(self) -> FloatArray:
        """Largest joint efforts (N·m or N), shape (n,)."""
        return readonly([joint.effort_limit for joint in self.joints])

    @property
    def transmission(self) -> FloatArray:
        """Motor torque per unit of joint effort (1, or m for a pinion), shape (n,)."""
        return readonly([joint.transmission for joint in self.joints])

    @property
    def motor_torque_limits(self) -> FloatArray:
        """Largest motor torques (N·m), shape (n,)."""
        return readonly([joint.motor_torque_limit for joint in self.joints])

    @property
    def force_axes(self) -> tuple[str, ...]:
        """Names of the force-controlled base-frame axes, in the order of the task."""
        return tuple(AXIS_NAMES[component] for component in self.task.position)

    def _repr_markdown_(self) -> str:
        tip, axis = (", ".join(map(number, values)) for values in (self.tool_tip, self.tool_axis))
        held = [AXIS_NAMES[component] for component in self.task.tool_axis]
        task = f"tip {', '.join(self.force_axes)}" + (
            f"; tool axis {', '.join(held)}" if held else ""
        )
        return "\n\n".join(
            (
                f"**{self.name}**",
                self.provenance,
                f"Modified Denavit-Hartenberg, {DH_CONVENTION}:",
                dh_table(self.joints),
                inertial_table(self.bodies),
                drive_table(self.joints),
                f"Tool tip ({tip}) m and tool axis ({axis}) in the last frame. Task: {task}.",
            )
        )
