"""Inertial parameters as a vector, so that plant and controller can hold different ones.

Per body, at the origin of its link frame: mass m, first moments (mx, my, mz) = m c, inertia
(Ixx, Iyy, Izz, Ixy, Ixz, Iyz), and the drive's inertia Ia. The equations of motion are linear
in all of these (Khalil and Dombre, ch. 9). Entries that are zero in the description are left
out of the vector: they stay structural zeros in the generated code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.robot.description import RobotDescription
from mrac_design.robot.parts import Body

_LETTERS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz", "Ia")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyInertia:
    """Symbolic inertial parameters of one body at the origin of its link frame."""

    mass: ca.SX
    """m (kg), scalar."""
    first_moment: ca.SX
    """h = m c (kg·m), shape (3, 1)."""
    inertia: ca.SX
    """I at the link origin (kg·m²), shape (3, 3), symmetric."""
    drive_inertia: ca.SX
    """Ia (kg·m² or kg), scalar."""


def inertial_parameters(description: RobotDescription) -> FloatArray:
    """The description's own parameter vector, shape (p,); order as in `parameter_names`."""
    return scaled_parameters(description, 1.0)


def parameter_names(description: RobotDescription) -> tuple[str, ...]:
    """Names of the vector's entries, a letter and the body's number, as "mx2"; length p."""
    values = _standard_values(description)
    return tuple(
        f"{letter}{number}"
        for number, row in enumerate(values, 1)
        for letter, value in zip(_LETTERS, row, strict=True)
        if value != 0
    )


def scaled_parameters(
    description: RobotDescription, body_scale: float | Sequence[float]
) -> FloatArray:
    """Parameters with every body's mass, first moment, inertia and drive inertia multiplied.

    `body_scale` is one factor for all bodies or one for each; 1.05 is 5 % too much. Scaling
    a body as a whole keeps it physically possible. Shape (p,). Raises ParameterError for a
    wrong number of factors or one that is not positive.
    """
    factors = np.asarray(body_scale, dtype=np.float64)
    if factors.shape not in ((), (description.joint_count,)):
        raise ParameterError(
            "body_scale",
            body_scale,
            f"needs one factor, or one for each of {description.joint_count} bodies",
        )
    if not np.all(np.isfinite(factors) & (factors > 0)):
        raise ParameterError("body_scale", body_scale, "factors must be positive and finite")
    values = _standard_values(description)
    scaled = values * np.broadcast_to(factors, (description.joint_count,))[:, None]
    return readonly(scaled[values != 0])


def friction_parameters(description: RobotDescription) -> FloatArray:
    """Coulomb efforts of all joints, then viscous coefficients, shape (2n,)."""
    return readonly(
        [joint.coulomb_friction for joint in description.joints]
        + [joint.viscous_friction for joint in description.joints]
    )


def unpack_parameters(description: RobotDescription, parameters: ca.SX) -> tuple[BodyInertia, ...]:
    """Symbolic parameters of each body from the vector, with the zeros put back; length n."""
    present = _standard_values(description) != 0
    entries = iter(ca.vertsplit(parameters))
    bodies = []
    for row in present:
        m, mx, my, mz, xx, yy, zz, xy, xz, yz, drive = (
            next(entries) if used else ca.SX(0) for used in row
        )
        bodies.append(
            BodyInertia(
                mass=m,
                first_moment=ca.vertcat(mx, my, mz),
                inertia=ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
                drive_inertia=drive,
            )
        )
    return tuple(bodies)


def inertia_at_origin(body: Body) -> FloatArray:
    """Inertia tensor at the link frame's origin (kg·m²), shape (3, 3); Steiner's theorem."""
    c = body.centre_of_mass
    return readonly(body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c)))


def _standard_values(description: RobotDescription) -> FloatArray:
    """All 11 parameters of each body, zeros included, shape (n, 11)."""
    rows = []
    for joint, body in zip(description.joints, description.bodies, strict=True):
        inertia = inertia_at_origin(body)
        rows.append(
            [
                body.mass,
                *(body.mass * body.centre_of_mass),
                *np.diag(inertia),
                inertia[0, 1],
                inertia[0, 2],
                inertia[1, 2],
                joint.drive_inertia,
            ]
        )
    return np.array(rows)
