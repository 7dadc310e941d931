r"""Exact linearisation in task space with the measured force [Z 2-4].

    Γ = M q̈* + V + G + JᵀFe,    q̈* = J⁻¹ (f* − J̇ q̇)     ⇒     Ẍ = f*

which is [Z 3] multiplied by Jᵀ; with the robot's true parameters the cancellation is exact. On the
force axes f* = u − K2 Ẋ; the components of the tool axis are held by critically damped PD control.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.robot import RobotDynamics, scaled_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModelError:
    """How far the controller's model of the robot is from the true one."""

    body_scale: float
    """Factor on mass, first moment and inertia of every body; 1 is a perfect model."""
    first_joint_scale: float
    """Factor on the first joint's row of the model (its torque); 1 is a perfect model."""

    def __post_init__(self) -> None:
        for name in ("body_scale", "first_joint_scale"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ParameterError(name, value, "must be a finite factor > 0")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearisation:
    """The linearising torque as a CasADi function with its parameters."""

    parameters: Layout
    """Names of the parameters' entries."""
    parameter_values: FloatArray
    """Parameters, shape (parameters.size,)."""
    torque: ca.Function
    """(q, qd, force N (k,), command m/s² (k,), parameters) -> joint efforts (n,)."""


def build_linearisation(
    dynamics: RobotDynamics,
    *,
    velocity_gain: float,
    tool_axis_bandwidth: float,
    model_error: RobotModelError,
) -> Linearisation:
    """Linearising torque of `dynamics`, k force axes first in the task.

    `velocity_gain` is K2 (1/s) >= 0; `tool_axis_bandwidth` (rad/s) > 0 places the tool axis's PD.
    The tool axis is held where it points at the home posture.
    """
    if not 0 <= velocity_gain < float("inf"):
        raise ParameterError("K2", velocity_gain, "the velocity gain must be a finite number >= 0")
    if not 0 < tool_axis_bandwidth < float("inf"):
        raise ParameterError("tool axis bandwidth", tool_axis_bandwidth, "must be > 0 rad/s")
    robot = dynamics.description
    values: dict[str, ArrayLike] = {
        "inertia": scaled_parameters(robot, model_error.body_scale),
        "torque_scale": [model_error.first_joint_scale] + [1.0] * (robot.joint_count - 1),
        "velocity_gain": velocity_gain,
        "tool_axis_gains": [tool_axis_bandwidth**2, 2 * tool_axis_bandwidth],
        "tool_axis_target": home_task_position(dynamics)[len(robot.force_axes) :],
    }
    parameters = Layout(tuple((name, np.size(value)) for name, value in values.items()))
    return Linearisation(
        parameters=parameters,
        parameter_values=parameters.pack(values),
        torque=_torque_function(dynamics, parameters),
    )


def home_task_position(dynamics: RobotDynamics) -> FloatArray:
    """Task position at the home posture (m, –), shape (m,)."""
    return readonly(dynamics.task_position(dynamics.description.home).full().ravel())


def _torque_function(dynamics: RobotDynamics, layout: Layout) -> ca.Function:
    robot = dynamics.description
    n, k = robot.joint_count, len(robot.force_axes)
    q, qd = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    force, command, p = ca.SX.sym("force", k), ca.SX.sym("command", k), layout.symbols("parameters")
    symbols = layout.split(p)
    J = dynamics.task_jacobian(q)
    velocity = J @ qd
    stiffness, damping = symbols["tool_axis_gains"][0], symbols["tool_axis_gains"][1]
    tool_axis = dynamics.task_position(q)[k:, :]
    acceleration = ca.vertcat(
        command - symbols["velocity_gain"] * velocity[:k],
        stiffness * (symbols["tool_axis_target"] - tool_axis) - damping * velocity[k:, :],
    )
    qdd = dynamics.joint_acceleration(q, qd, acceleration)
    free = dynamics.inverse_dynamics(q, qd, qdd, symbols["inertia"])
    torque = symbols["torque_scale"] * free + J[:k, :].T @ force
    return ca.Function(
        "linearising_torque",
        [q, qd, force, command, p],
        [torque],
        ["q", "qd", "force", "command", "parameters"],
        ["torque"],
    )
