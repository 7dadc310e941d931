r"""What an error of the robot model does to the force axes, posture by posture.

With a model M̂ and a factor on each joint's row of the torque, S, the linearised robot answers

    Ẍ = (1 + Δ) (f* − J̇q̇) + J̇q̇ + J M⁻¹ (S Ĝ − G) + …,      1 + Δ = J M⁻¹ S M̂ J⁻¹ = Mx⁻¹ M̂x

instead of Ẍ = f* [Z 2-4]. A certificate tolerates ‖Δ‖ on the force axes up to a proved bound; what
an error of the inertial parameters really causes is computed here at many postures, which is a
check, not a proof. The error of gravity acts as a further, slowly varying disturbance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.linearisation import RobotModelError
from mrac_design.errors import ParameterError
from mrac_design.robot import (
    RobotDescription,
    RobotDynamics,
    inertial_parameters,
    scaled_parameters,
)
from mrac_design.robot.parts import JointType
from mrac_design.robot.posture import condition_numbers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InertiaMismatch:
    """‖Mx⁻¹ M̂x − 1‖ on the force axes over a set of postures."""

    model_error: RobotModelError
    """The error of the controller's model."""
    postures: FloatArray
    """Postures kept, (N, n)."""
    norms: FloatArray
    """Largest singular value of Δ on the force axes at each posture, (N,)."""
    gravity: FloatArray
    """Size of the acceleration that the error of gravity causes on the force axes (m/s²), (N,)."""
    left_out: int
    """Postures left out because they are too near a singular one."""

    @property
    def largest(self) -> float:
        """The worst mismatch met."""
        return float(self.norms.max())

    @property
    def worst_posture(self) -> FloatArray:
        """Where, (n,)."""
        return readonly(self.postures[int(np.argmax(self.norms))])

    def beyond(self, tolerated: float) -> int:
        """Number of postures whose mismatch exceeds a `tolerated` one."""
        return int((self.norms > tolerated).sum())


def inertia_mismatch(
    dynamics: RobotDynamics,
    model_error: RobotModelError,
    postures: ArrayLike,
    *,
    condition_limit: float,
) -> InertiaMismatch:
    """The mismatch at `postures` (N, n) whose Jacobian's condition number is within the limit.

    Raises ParameterError when none is left.
    """
    robot = dynamics.description
    rows = np.asarray(postures, dtype=float).reshape(-1, robot.joint_count)
    near = condition_numbers(dynamics, rows) <= condition_limit
    kept = rows[near]
    if not len(kept):
        raise ParameterError("postures", len(rows), "all of them are too near a singular one")
    n, k, count = robot.joint_count, len(robot.force_axes), len(kept)
    true, model = inertial_parameters(robot), scaled_parameters(robot, model_error.body_scale)
    M, M_hat = (_matrices(dynamics.mass_matrix, kept, p, n) for p in (true, model))
    J = _matrices(dynamics.task_jacobian, kept, None, n)
    row_scale = np.ones(n)
    row_scale[0] = model_error.first_joint_scale
    through = J @ np.linalg.solve(M, row_scale[:, None] * M_hat @ np.linalg.inv(J))
    delta = through[:, :k, :k] - np.eye(k)
    G, G_hat = (
        dynamics.gravity_torque.map(count)(kept.T, np.tile(p[:, None], count)).full().T
        for p in (true, model)
    )
    torque_error = row_scale * G_hat - G
    pull = (J @ np.linalg.solve(M, torque_error[:, :, None]))[:, :k, 0]
    return InertiaMismatch(
        model_error=model_error,
        postures=readonly(kept),
        norms=readonly(np.linalg.norm(delta, ord=2, axis=(1, 2))),
        gravity=readonly(np.linalg.norm(pull, axis=1)),
        left_out=int((~near).sum()),
    )


def posture_grid(robot: RobotDescription, *, slide: float, turn: float, points: int) -> FloatArray:
    """A full grid around the home posture, (points ** n, n).

    Prismatic joints within ±`slide` (m), revolute ones within ±`turn` (rad), `points` values each.
    Raises ParameterError for negative ranges or fewer than two points.
    """
    if points < 2 or slide < 0 or turn < 0:
        raise ParameterError(
            "posture grid", (slide, turn, points), "needs ranges >= 0 and at least 2 points"
        )
    spans = [slide if joint.type is JointType.PRISMATIC else turn for joint in robot.joints]
    values = [
        np.linspace(home - span, home + span, points)
        for home, span in zip(robot.home, spans, strict=True)
    ]
    return readonly(list(product(*values)))


def _matrices(function: object, postures: FloatArray, p: FloatArray | None, n: int) -> FloatArray:
    """A matrix-valued function of posture at all of them, (N, rows, n)."""
    count = len(postures)
    arguments = [postures.T] if p is None else [postures.T, np.tile(p[:, None], count)]
    flat = function.map(count)(*arguments).full()  # type: ignore[attr-defined]
    # CasADi lays the N matrices side by side.
    return np.asarray(flat.reshape(flat.shape[0], count, n).transpose(1, 0, 2))
