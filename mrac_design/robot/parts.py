"""What a robot is made of: joints in modified Denavit-Hartenberg notation, bodies, a task.

Link frame j follows from frame j-1 by Rot_x(alpha) Trans_x(d) Rot_z(theta) Trans_z(r), the
convention of Khalil and Kleinfinger (1986). The joint variable adds to theta (revolute) or
to r (prismatic). Everything here is a number a file can hold; symbols come later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError

AXIS_NAMES = ("X", "Y", "Z")
"""Names of the base frame's axes, by component index."""

PHYSICAL_TOLERANCE = 1e-9
"""Relative slack of the physical checks: room for figures rounded to six digits and for flat
or rod-like bodies, whose inequalities hold with equality."""


class JointType(Enum):
    """The two kinds of one-degree-of-freedom joint."""

    PRISMATIC = "prismatic"
    REVOLUTE = "revolute"


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """One joint with its drive. Efforts are N for a prismatic joint, N·m for a revolute one."""

    name: str
    """What people call the joint."""
    type: JointType
    """Prismatic (slides along its z axis) or revolute (turns about its z axis)."""
    alpha: float
    """α, angle from z of the previous frame to z of this one, about the previous x (rad)."""
    d: float
    """d, distance from the previous z to this z, along the previous x (m)."""
    theta: float
    """θ, angle about z (rad); a revolute joint's variable is added to it."""
    r: float
    """r, displacement along z (m); a prismatic joint's variable is added to it."""
    home: float
    """Joint variable at the home posture (rad or m)."""
    drive_inertia: float
    """Ia, inertia of the drive seen at the joint (kg·m², or kg when prismatic)."""
    coulomb_friction: float
    """Coulomb friction effort (N·m or N)."""
    viscous_friction: float
    """Viscous friction coefficient (N·m·s/rad or N·s/m)."""
    effort_limit: float
    """Largest effort the drive gives at the joint (N·m or N)."""
    transmission: float
    """Motor torque per unit of joint effort: 1 for a direct drive, a pinion's radius (m) for
    a prismatic joint."""

    def __post_init__(self) -> None:
        _require_finite(
            self, ("alpha", "d", "theta", "r", "home", "drive_inertia", "coulomb_friction")
        )
        _require_finite(self, ("viscous_friction", "effort_limit", "transmission"))
        for name in ("drive_inertia", "coulomb_friction", "viscous_friction"):
            if getattr(self, name) < 0:
                raise ParameterError(name, getattr(self, name), "must be zero or positive")
        for name in ("effort_limit", "transmission"):
            if getattr(self, name) <= 0:
                raise ParameterError(name, getattr(self, name), "must be positive")

    @property
    def motor_torque_limit(self) -> float:
        """Largest torque of the motor itself (N·m)."""
        return self.effort_limit * self.transmission


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A rigid link, in its link frame. Construction refuses a body that cannot exist."""

    name: str
    """What people call the link."""
    mass: float
    """m, mass (kg)."""
    centre_of_mass: FloatArray
    """c, centre of mass in the link frame (m), shape (3,)."""
    inertia: FloatArray
    """I, inertia tensor at the centre of mass, axes of the link frame (kg·m²), shape (3, 3).
    Off-diagonal entries are tensor entries, Ixy = −∫xy dm."""

    def __post_init__(self) -> None:
        if not np.isfinite(self.mass) or self.mass <= 0:
            raise ParameterError("mass", self.mass, "must be positive and finite (kg)")
        store_array(self, "centre_of_mass", (3,))
        store_array(self, "inertia", (3, 3))
        _check_inertia(self.inertia)


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskDefinition:
    """Which base-frame components make up the task, as many as the robot has joints."""

    position: tuple[int, ...]
    """Components (0, 1, 2 for X, Y, Z) of the tool tip's position; these axes carry force."""
    tool_axis: tuple[int, ...]
    """Components of the unit vector along the tool axis, held by position control."""

    def __post_init__(self) -> None:
        for name, components, most in (
            ("position", self.position, 3),
            ("tool_axis", self.tool_axis, 2),
        ):
            valid = set(components) <= {0, 1, 2} and len(set(components)) == len(components)
            if not valid or len(components) > most:
                shown = ", ".join(str(component) for component in components)
                raise ParameterError(
                    name, f"({shown})", f"needs at most {most} different components out of 0, 1, 2"
                )
        if not self.position:
            raise ParameterError("position", "()", "needs at least one component to control")

    @property
    def size(self) -> int:
        """m, the number of task components."""
        return len(self.position) + len(self.tool_axis)


def store_array(owner: object, name: str, shape: tuple[int, ...]) -> None:
    """Replace a field by its read-only float64 copy, checking shape and finiteness."""
    value = getattr(owner, name)
    try:
        array = readonly(value, shape)
    except (TypeError, ValueError) as error:
        wanted = " × ".join(str(size) for size in shape)
        raise ParameterError(name, value, f"needs {wanted} numbers") from error
    if not np.isfinite(array).all():
        raise ParameterError(name, array.tolist(), "every entry must be finite")
    object.__setattr__(owner, name, array)


def _require_finite(owner: object, names: Sequence[str]) -> None:
    for name in names:
        if not np.isfinite(getattr(owner, name)):
            raise ParameterError(name, getattr(owner, name), "must be finite")


def _check_inertia(inertia: FloatArray) -> None:
    """Refuse a tensor no mass distribution has.

    The second moments of mass Σ = ½ tr(I) 1 − I must be positive semidefinite, which is
    the triangle inequality of the principal moments; with a positive mass this makes the
    4 × 4 pseudo-inertia matrix positive semidefinite (Wensing, Kim, Slotine 2018).
    """
    scale = float(np.abs(inertia).max())
    if np.abs(inertia - inertia.T).max() > PHYSICAL_TOLERANCE * scale:
        raise ParameterError("inertia", inertia.tolist(), "must be symmetric")
    least, middle, greatest = np.linalg.eigvalsh(inertia)
    moments = f"principal moments {least:.4g}, {middle:.4g}, {greatest:.4g}"
    if least < -PHYSICAL_TOLERANCE * scale:
        raise ParameterError(
            "inertia", moments, "an inertia tensor has no negative principal moment"
        )
    if least + middle < greatest * (1 - PHYSICAL_TOLERANCE):
        raise ParameterError(
            "inertia",
            moments,
            "break the triangle inequality: the two smaller ones must together reach the largest "
            "(check that the tensor is taken at the centre of mass, and its signs and units)",
        )
