"""Solves J x = b for the task Jacobian, using what a robot with a wrist offers.

When the tool tip lies on the line along the tool axis through the last frame's origin,
tip = origin + ℓ a with a constant ℓ, the tip's rows less ℓ times the axis' rows are those of
the origin, which the wrist does not move. The system then falls apart into small blocks. A
unit vector's rate is normal to it, so two known components of ȧ give the third; that fails only
where the axis has no third component, and there the task itself is singular.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from mrac_design.errors import ParameterError
from mrac_design.robot.description import RobotDescription
from mrac_design.robot.kinematics import ToolKinematics, select_task
from mrac_design.robot.linear_algebra import StructurallySingularError, solve_square


def solve_task(description: RobotDescription, tool: ToolKinematics, right: ca.SX) -> ca.SX:
    """x with J x = right; `right` of shape (m, k) in the task's order, x of shape (n, k).

    Infinite or NaN at a singular posture (see `check_posture`). Raises ParameterError when the
    joints cannot serve the task at any posture.
    """
    task = description.task
    count = len(task.position)
    length = float(description.tool_tip @ description.tool_axis)
    on_axis = np.array_equal(description.tool_tip, length * description.tool_axis)
    if not on_axis:
        jacobian = select_task(description, tool.linear_jacobian, tool.axis_jacobian)
        return _solve(jacobian, right)
    axis_rates = {
        component: right[count + index, :] for index, component in enumerate(task.tool_axis)
    }
    if len(axis_rates) == 2:
        (third,) = {0, 1, 2} - set(axis_rates)
        along = sum(tool.axis[component] * rate for component, rate in axis_rates.items())
        axis_rates[third] = -along / tool.axis[third]
    rows, rights = [], []
    for index, component in enumerate(task.position):
        if component in axis_rates:
            rows.append(tool.origin_jacobian[component, :])
            rights.append(right[index, :] - length * axis_rates[component])
        else:
            rows.append(tool.linear_jacobian[component, :])
            rights.append(right[index, :])
    rows += [tool.axis_jacobian[component, :] for component in task.tool_axis]
    rights += [right[count + index, :] for index in range(len(task.tool_axis))]
    return _solve(ca.vertcat(*rows), ca.vertcat(*rights))


def _solve(jacobian: ca.SX, right: ca.SX) -> ca.SX:
    try:
        return solve_square(jacobian, right)
    except StructurallySingularError as error:
        raise ParameterError(
            "task",
            f"{jacobian.size1()} components",
            "the joints cannot move all of them independently at any posture; choose others",
        ) from error
