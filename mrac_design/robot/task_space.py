"""The robot seen at its tool: Mx Ẍ + Vx + Gx = Fsc − Fe [Z 2].

X holds the task components, so forces pair with them: N for the tip's components, N·m for
those of the tool axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from mrac_design.robot.dynamics import RobotDynamics
from mrac_design.robot.kinematics import joint_transforms, tool_kinematics
from mrac_design.robot.task_solution import solve_task


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaskSpaceModel:
    """Mx, Vx and Gx of one robot; inputs as in `RobotDynamics`. Not finite where J is singular."""

    dynamics: RobotDynamics
    """The joint-space functions these are made of."""
    Mx: ca.Function
    """(q, parameters) → Mx = J⁻ᵀ M J⁻¹, shape (m, m)."""
    Vx: ca.Function
    """(q, qd, parameters) → Vx = J⁻ᵀ V − Mx J̇q̇, shape (m,)."""
    Gx: ca.Function
    """(q, parameters) → Gx = J⁻ᵀ G, shape (m,)."""


def build_task_space(dynamics: RobotDynamics) -> TaskSpaceModel:
    """Derive the task-space terms of a robot [Z 2]."""
    q = ca.SX.sym("q", dynamics.mass_matrix.size1_in(0))
    qd = ca.SX.sym("qd", q.size1())
    parameters = ca.SX.sym("parameters", dynamics.mass_matrix.size1_in(1))
    tool = tool_kinematics(dynamics.description, joint_transforms(dynamics.description, q))
    inverse = solve_task(dynamics.description, tool, ca.SX(ca.DM.eye(q.size1())))
    Mx = inverse.T @ dynamics.mass_matrix(q, parameters) @ inverse
    bias = dynamics.task_bias_acceleration(q, qd)
    Vx = inverse.T @ dynamics.velocity_torque(q, qd, parameters) - Mx @ bias
    Gx = inverse.T @ dynamics.gravity_torque(q, parameters)
    at, moving = ["q", "parameters"], ["q", "qd", "parameters"]
    return TaskSpaceModel(
        dynamics=dynamics,
        Mx=ca.Function("Mx", [q, parameters], ca.cse([Mx]), at, ["Mx"]),
        Vx=ca.Function("Vx", [q, qd, parameters], ca.cse([Vx]), moving, ["Vx"]),
        Gx=ca.Function("Gx", [q, parameters], ca.cse([Gx]), at, ["Gx"]),
    )
