"""A robot's equations as CasADi functions with named inputs and outputs.

All functions are built of SX expressions, so that code generated from them is straight-line
arithmetic. Inertial parameters are an input of every function that needs them: the plant and
the controller's model are the same functions with different numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
from numpy.typing import ArrayLike

from mrac_design.robot.description import RobotDescription
from mrac_design.robot.kinematics import (
    joint_transforms,
    link_motions,
    select_task,
    tool_accelerations,
    tool_kinematics,
)
from mrac_design.robot.linear_algebra import solve_symmetric
from mrac_design.robot.parameters import parameter_names, unpack_parameters
from mrac_design.robot.rigid_body import (
    coriolis_matrix,
    joint_efforts,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)
from mrac_design.robot.task_solution import solve_task


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotDynamics:
    """Kinematics and rigid-body dynamics of one robot; n joints, m task components.

    Inputs: q (n,) rad or m, qd (n,), qdd (n,), torque (n,) joint efforts in N·m or N,
    parameters (p,) as `inertial_parameters` orders them. Friction and contact are not included.
    """

    description: RobotDescription
    """The robot these functions belong to."""
    forward_kinematics: ca.Function
    """(q) → rotation (3, 3) of the last frame, tip (3,) in m, tool_axis (3,); base frame."""
    task_position: ca.Function
    """(q) → position (m,): tip components in m, then tool-axis components."""
    task_jacobian: ca.Function
    """(q) → jacobian J (m, n) of the task position."""
    jacobian: ca.Function
    """(q) → jacobian (6, n), geometric, at the tool tip, linear part first; base frame."""
    task_bias_acceleration: ca.Function
    """(q, qd) → bias J̇q̇ (m,) in m/s² and 1/s²."""
    joint_acceleration: ca.Function
    """(q, qd, acceleration (m,)) → qdd = J⁻¹(ẍ − J̇q̇), (n,): the joints' part of exact
    linearisation [Z 2-4]."""
    mass_matrix: ca.Function
    """(q, parameters) → mass_matrix M (n, n), symmetric positive definite, drives included."""
    velocity_torque: ca.Function
    """(q, qd, parameters) → torque V = C q̇ (n,), Coriolis and centrifugal."""
    coriolis_matrix: ca.Function
    """(q, qd, parameters) → coriolis_matrix C (n, n) with Ṁ − 2C skew-symmetric."""
    gravity_torque: ca.Function
    """(q, parameters) → torque G (n,)."""
    bias_torque: ca.Function
    """(q, qd, parameters) → torque V + G (n,) in one pass, cheaper than the two apart."""
    inverse_dynamics: ca.Function
    """(q, qd, qdd, parameters) → torque M q̈ + V + G (n,) by recursive Newton-Euler."""
    forward_dynamics: ca.Function
    """(q, qd, torque, parameters) → qdd = M⁻¹(Γ − V − G), (n,), by L D Lᵀ."""
    energy: ca.Function
    """(q, qd, parameters) → kinetic, potential (J, scalars)."""
    rigid_body_terms: ca.Function
    """(q, qd, torque, parameters) → mass_matrix, bias_torque, task_jacobian,
    task_bias_acceleration, qdd: everything a simulation needs, sharing all it can."""


def build_dynamics(description: RobotDescription) -> RobotDynamics:
    """Derive the equations of a robot; takes about a tenth of a second.

    Raises ParameterError when the joints cannot serve the task at any posture.
    """
    n = description.joint_count
    q, qd, qdd, torque = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd", "torque"))
    parameters = ca.SX.sym("parameters", len(parameter_names(description)))
    acceleration = ca.SX.sym("acceleration", description.task.size)
    bodies = unpack_parameters(description, parameters)
    transforms = joint_transforms(description, q)
    tool = tool_kinematics(description, transforms)
    at_rest, no_gravity, gravity = ca.SX.zeros(n), [0.0, 0.0, 0.0], -description.gravity

    def efforts(rates: ca.SX, changes: ca.SX, base: ArrayLike) -> ca.SX:
        links = link_motions(transforms, rates, changes, base)
        return joint_efforts(transforms, links, bodies, changes)

    moving = link_motions(transforms, qd, at_rest, gravity)
    tip, axis = tool_accelerations(description, tool.rotation, moving[-1])
    # Gravity rides along in the pass shared with the efforts; the tip's part is taken off.
    bias = select_task(description, tip - gravity, axis)
    free = tool_accelerations(
        description, tool.rotation, link_motions(transforms, qd, at_rest, no_gravity)[-1]
    )
    task_bias = select_task(description, *free)
    task_jacobian = select_task(description, tool.linear_jacobian, tool.axis_jacobian)
    matrix = mass_matrix(transforms, bodies)
    bias_torque = joint_efforts(transforms, moving, bodies, at_rest)
    solution = solve_symmetric(matrix, torque - bias_torque)
    coriolis = coriolis_matrix(transforms, bodies, qd)
    inputs = {"q": q, "qd": qd, "qdd": qdd, "torque": torque, "parameters": parameters}
    inputs["acceleration"] = acceleration

    def function(name: str, needed: str, **outputs: ca.SX) -> ca.Function:
        names = needed.split()
        expressions = ca.cse([ca.densify(expression) for expression in outputs.values()])
        return ca.Function(name, [inputs[key] for key in names], expressions, names, list(outputs))

    return RobotDynamics(
        description=description,
        forward_kinematics=function(
            "forward_kinematics", "q", rotation=tool.rotation, tip=tool.tip, tool_axis=tool.axis
        ),
        task_position=function(
            "task_position", "q", position=select_task(description, tool.tip, tool.axis)
        ),
        task_jacobian=function("task_jacobian", "q", jacobian=task_jacobian),
        jacobian=function(
            "jacobian", "q", jacobian=ca.vertcat(tool.linear_jacobian, tool.angular_jacobian)
        ),
        task_bias_acceleration=function("task_bias_acceleration", "q qd", bias=task_bias),
        joint_acceleration=function(
            "joint_acceleration",
            "q qd acceleration",
            qdd=solve_task(description, tool, acceleration - task_bias),
        ),
        mass_matrix=function("mass_matrix", "q parameters", mass_matrix=matrix),
        velocity_torque=function(
            "velocity_torque", "q qd parameters", torque=efforts(qd, at_rest, no_gravity)
        ),
        coriolis_matrix=function("coriolis_matrix", "q qd parameters", coriolis_matrix=coriolis),
        gravity_torque=function(
            "gravity_torque", "q parameters", torque=efforts(at_rest, at_rest, gravity)
        ),
        bias_torque=function("bias_torque", "q qd parameters", torque=bias_torque),
        inverse_dynamics=function(
            "inverse_dynamics", "q qd qdd parameters", torque=efforts(qd, qdd, gravity)
        ),
        forward_dynamics=function("forward_dynamics", "q qd torque parameters", qdd=solution),
        energy=function(
            "energy",
            "q qd parameters",
            kinetic=kinetic_energy(matrix, qd),
            potential=potential_energy(transforms, bodies, ca.SX(description.gravity)),
        ),
        rigid_body_terms=function(
            "rigid_body_terms",
            "q qd torque parameters",
            mass_matrix=matrix,
            bias_torque=bias_torque,
            task_jacobian=task_jacobian,
            task_bias_acceleration=bias,
            qdd=solution,
        ),
    )
