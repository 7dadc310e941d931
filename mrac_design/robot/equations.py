"""A robot's equations as SX expressions over one set of symbols, each derived when needed."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import casadi as ca
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray
from mrac_design.robot.description import RobotDescription
from mrac_design.robot.kinematics import (
    JointTransform,
    LinkMotion,
    ToolKinematics,
    joint_transforms,
    link_motions,
    select_task,
    tool_accelerations,
    tool_kinematics,
)
from mrac_design.robot.linear_algebra import solve_symmetric
from mrac_design.robot.parameters import BodyInertia, parameter_names, unpack_parameters
from mrac_design.robot.rigid_body import (
    coriolis_matrix,
    joint_efforts,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from mrac_design.robot.task_solution import solve_task

NO_GRAVITY = (0.0, 0.0, 0.0)
"""Acceleration of a base that gravity does not act on (m/s²)."""


class Equations:
    """Expressions that the functions of a robot are made of; n joints, m task components."""

    description: RobotDescription
    """The robot."""
    symbols: Mapping[str, ca.SX]
    """q, qd, qdd, torque (n,), acceleration (m,) and parameters (p,)."""
    at_rest: ca.SX
    """Joint rates or their changes of a robot that does not move, (n,)."""
    lifting: FloatArray
    """Acceleration of a base whose rising weighs like gravity (m/s²), (3,)."""

    def __init__(self, description: RobotDescription) -> None:
        n = description.joint_count
        sizes = dict.fromkeys(("q", "qd", "qdd", "torque"), n)
        sizes["parameters"] = len(parameter_names(description))
        sizes["acceleration"] = description.task.size
        self.description = description
        self.symbols = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        self.at_rest = ca.SX.zeros(n)
        self.lifting = -description.gravity

    def function(self, name: str, needed: str, outputs: Mapping[str, ca.SX]) -> ca.Function:
        """A function of the `needed` symbols, dense, with common subexpressions shared."""
        names = needed.split()
        expressions = ca.cse([ca.densify(expression) for expression in outputs.values()])
        symbols = [self.symbols[key] for key in names]
        return ca.Function(name, symbols, expressions, names, list(outputs))

    def links(self, rates: ca.SX, changes: ca.SX, base: ArrayLike) -> tuple[LinkMotion, ...]:
        """Motion of every link under joint rates and their changes on an accelerated base."""
        return link_motions(self.transforms, rates, changes, base)

    def efforts(self, rates: ca.SX, changes: ca.SX, base: ArrayLike) -> ca.SX:
        """Joint efforts that motion takes (N·m or N), (n,)."""
        links = self.links(rates, changes, base)
        return joint_efforts(self.transforms, links, self.bodies, changes)

    @cached_property
    def bodies(self) -> tuple[BodyInertia, ...]:
        """Inertia of every body in the symbols of the parameters."""
        return unpack_parameters(self.description, self.symbols["parameters"])

    @cached_property
    def transforms(self) -> tuple[JointTransform, ...]:
        """From each joint's frame to its parent's."""
        return joint_transforms(self.description, self.symbols["q"])

    @cached_property
    def tool(self) -> ToolKinematics:
        """Tip, tool axis and their Jacobians."""
        return tool_kinematics(self.description, self.transforms)

    @cached_property
    def moving(self) -> tuple[LinkMotion, ...]:
        """Links at the joint rates, none of them changing, with gravity as the base's rise."""
        return self.links(self.symbols["qd"], self.at_rest, self.lifting)

    @cached_property
    def task_position(self) -> ca.SX:
        """Tip and tool-axis components of the task, (m,)."""
        return select_task(self.description, self.tool.tip, self.tool.axis)

    @cached_property
    def jacobian(self) -> ca.SX:
        """Geometric Jacobian at the tool tip, (6, n)."""
        return ca.vertcat(self.tool.linear_jacobian, self.tool.angular_jacobian)

    @cached_property
    def task_bias(self) -> ca.SX:
        """J̇q̇, (m,)."""
        last = self.links(self.symbols["qd"], self.at_rest, NO_GRAVITY)[-1]
        free = tool_accelerations(self.description, self.tool.rotation, last)
        return select_task(self.description, *free)

    @cached_property
    def shared_task_bias(self) -> ca.SX:
        """J̇q̇, (m,), from the pass that gives the efforts too."""
        # Gravity rides along in that pass; the tip's part is taken off.
        tip, axis = tool_accelerations(self.description, self.tool.rotation, self.moving[-1])
        return select_task(self.description, tip - self.lifting, axis)

    @cached_property
    def task_jacobian(self) -> ca.SX:
        """J, (m, n)."""
        tool = self.tool
        return select_task(self.description, tool.linear_jacobian, tool.axis_jacobian)

    @cached_property
    def joint_acceleration(self) -> ca.SX:
        """J⁻¹(ẍ − J̇q̇), (n,)."""
        wanted = self.symbols["acceleration"] - self.task_bias
        return solve_task(self.description, self.tool, wanted)

    @cached_property
    def mass_matrix(self) -> ca.SX:
        """M, (n, n)."""
        return mass_matrix(self.transforms, self.bodies)

    @cached_property
    def bias_torque(self) -> ca.SX:
        """V + G, (n,)."""
        return joint_efforts(self.transforms, self.moving, self.bodies, self.at_rest)

    @cached_property
    def velocity_torque(self) -> ca.SX:
        """V, (n,)."""
        return self.efforts(self.symbols["qd"], self.at_rest, NO_GRAVITY)

    @cached_property
    def gravity_torque(self) -> ca.SX:
        """G, (n,)."""
        return self.efforts(self.at_rest, self.at_rest, self.lifting)

    @cached_property
    def coriolis_matrix(self) -> ca.SX:
        """C, (n, n)."""
        return coriolis_matrix(self.transforms, self.bodies, self.symbols["qd"])

    @cached_property
    def inverse_dynamics(self) -> ca.SX:
        """M q̈ + V + G, (n,)."""
        return self.efforts(self.symbols["qd"], self.symbols["qdd"], self.lifting)

    @cached_property
    def kinetic_energy(self) -> ca.SX:
        """q̇ᵀ M q̇ / 2."""
        return kinetic_energy(self.mass_matrix, self.symbols["qd"])

    @cached_property
    def potential_energy(self) -> ca.SX:
        """Weight times height, summed over the bodies."""
        return potential_energy(self.transforms, self.bodies, ca.SX(self.description.gravity))

    @cached_property
    def solution(self) -> ca.SX:
        """M⁻¹(Γ − V − G), (n,)."""
        return solve_symmetric(self.mass_matrix, self.symbols["torque"] - self.bias_torque)
