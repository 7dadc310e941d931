"""How far a posture is from those where the task Jacobian cannot be inverted."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError, SingularPostureError
from mrac_design.robot.dynamics import RobotDynamics


def condition_number(dynamics: RobotDynamics, q: ArrayLike) -> float:
    """Ratio of the largest to the smallest singular value of the task Jacobian at q (n,).

    Infinite at a singular posture. Rows in metres and rows of the unit tool axis are taken as
    they are, so the number depends on the unit of length (m).
    """
    return float(condition_numbers(dynamics, np.asarray(q, dtype=np.float64)[None, :])[0])


def condition_numbers(dynamics: RobotDynamics, postures: ArrayLike) -> FloatArray:
    """Condition numbers of the task Jacobian at N postures (N, n), shape (N,)."""
    n = dynamics.description.joint_count
    try:
        rows = readonly(postures, (-1, n))
    except ValueError as error:
        raise ParameterError("posture", postures, f"needs {n} joint variables") from error
    if not np.isfinite(rows).all():
        raise ParameterError("posture", rows.tolist(), "joint variables must be finite")
    if len(rows) == 0:
        return readonly([], (0,))
    flat = dynamics.task_jacobian.map(len(rows))(rows.T).full()
    # CasADi lays the N matrices side by side.
    jacobians = flat.reshape(flat.shape[0], len(rows), n).transpose(1, 0, 2)
    values = np.linalg.svd(jacobians, compute_uv=False)
    with np.errstate(divide="ignore"):
        ratios = values[:, 0] / values[:, -1]
    # Beyond 1/eps the smallest singular value is rounding.
    ratios[ratios > 1 / np.finfo(np.float64).eps] = math.inf
    return readonly(ratios)


def check_posture(dynamics: RobotDynamics, q: ArrayLike, limit: float) -> float:
    """The condition number at q, or SingularPostureError when it exceeds `limit`."""
    number = condition_number(dynamics, q)
    if number > limit:
        raise SingularPostureError(number, limit, np.asarray(q, dtype=np.float64).tolist())
    return number
