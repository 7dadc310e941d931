r"""What the tissue does to the tool: contact laws, axis by axis, composed by wrapping.

    depth δ = X − Xh (m)      LinearSpring       Fe = Ks δ                         [Z]
                              WithDamper         Fe = … + c δ̇ (Kelvin–Voigt)
                              ScheduledTissue    Fe = s(t) × …
                              OneSided           Fe = max(0, …) where δ > 0, else 0

Whatever a law needs beyond the heart's position it asks for as inputs of the loop, so a run stays
a function of its inputs and a plain spring costs nothing more than a product.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.motion import StepSequence
from mrac_design.motion.signal import PiecewisePolynomial, stack


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Touch:
    """Where the tool is to the tissue, k force axes; what a contact law may look at."""

    depth: ca.SX
    """δ = X − Xh (m), (k,); positive where the tool presses into the tissue."""
    velocity: ca.SX
    """Ẋ of the tool tip (m/s), (k,)."""
    inputs: Mapping[str, ca.SX]
    """Inputs of the loop by name, those the law asked for among them."""
    parameters: Mapping[str, ca.SX]
    """Parameters of the loop by name, the law's among them."""
    made: ca.SX | None = None
    """Where contact is taken for made (1) or lost (0), (k,), whatever the depth says; None leaves
    it to the depth."""


class Contact(Protocol):
    """A contact law on k force axes."""

    def values(self, axes: int) -> Mapping[str, ArrayLike]:
        """Numbers that become parameters of the loop, by name."""

    def inputs(self, axes: int) -> Layout:
        """What it needs from outside beside the heart's position."""

    def exogenous(self, heart: PiecewisePolynomial) -> tuple[PiecewisePolynomial, ...]:
        """Signals of `inputs`, in order, for a heart position (m), k channels."""

    def force(self, touch: Touch) -> ca.SX:
        """Contact force Fe on the tissue (N), (k,)."""

    @property
    def can_be_lost(self) -> bool:
        """Whether the force vanishes where the tool leaves the tissue."""

    def holds(self, touch: Touch) -> ca.SX:
        """Event functions (N), (k,): positive where contact is made; (0,) if it is never lost."""

    def rest_depth(self, force: ArrayLike) -> FloatArray:
        """Depth (m), shape (k,), at which it holds `force` (N) at rest at the beginning."""


@dataclass(frozen=True, slots=True)
class LinearSpring:
    """Two-sided spring Fe = Ks δ: the tissue also pulls, as in the paper [Z]."""

    stiffness: float | tuple[float, ...]
    """Ks (N/m), > 0: one, or one an axis."""

    def __post_init__(self) -> None:
        stiffness = np.asarray(self.stiffness, dtype=float)
        if not np.all((stiffness > 0) & np.isfinite(stiffness)):
            raise ParameterError("stiffness", self.stiffness, "must be finite and > 0 N/m")

    def values(self, axes: int) -> Mapping[str, ArrayLike]:
        if np.ndim(self.stiffness) and np.size(self.stiffness) != axes:
            raise ParameterError("stiffness", self.stiffness, f"needs one, or one of {axes} axes")
        return {"stiffness": np.broadcast_to(np.asarray(self.stiffness, dtype=float), (axes,))}

    def inputs(self, axes: int) -> Layout:
        return Layout(())

    def exogenous(self, heart: PiecewisePolynomial) -> tuple[PiecewisePolynomial, ...]:
        return ()

    def force(self, touch: Touch) -> ca.SX:
        return touch.parameters["stiffness"] * touch.depth

    @property
    def can_be_lost(self) -> bool:
        return False

    def holds(self, touch: Touch) -> ca.SX:
        return ca.SX(0, 1)

    def rest_depth(self, force: ArrayLike) -> FloatArray:
        return readonly(np.asarray(force, dtype=float) / self.stiffness)


@dataclass(frozen=True, slots=True, kw_only=True)
class WithDamper:
    """The tissue inside with a damper in parallel (Kelvin–Voigt): Fe = … + c δ̇."""

    tissue: Contact
    """The law inside."""
    damping: float
    """c (N·s/m), ≥ 0."""

    def __post_init__(self) -> None:
        if not 0 <= self.damping < math.inf:
            raise ParameterError("damping", self.damping, "must be finite and >= 0 N·s/m")

    def values(self, axes: int) -> Mapping[str, ArrayLike]:
        return {**self.tissue.values(axes), "tissue_damping": self.damping}

    def inputs(self, axes: int) -> Layout:
        return Layout((*self.tissue.inputs(axes).blocks, ("heart_velocity", axes)))

    def exogenous(self, heart: PiecewisePolynomial) -> tuple[PiecewisePolynomial, ...]:
        return (*self.tissue.exogenous(heart), heart.derivative())

    def force(self, touch: Touch) -> ca.SX:
        rate = touch.velocity - touch.inputs["heart_velocity"]
        return self.tissue.force(touch) + touch.parameters["tissue_damping"] * rate

    @property
    def can_be_lost(self) -> bool:
        return self.tissue.can_be_lost

    def holds(self, touch: Touch) -> ca.SX:
        return self.tissue.holds(touch)

    def rest_depth(self, force: ArrayLike) -> FloatArray:
        return self.tissue.rest_depth(force)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledTissue:
    """The tissue inside, all its forces times a factor that jumps at given instants.

    What lies under the tool changes; positions do not, so the force jumps with the factor.
    """

    tissue: Contact
    """The law inside."""
    factor: StepSequence
    """Factor on the force over time (–), every level > 0."""

    def __post_init__(self) -> None:
        if min(self.factor.levels) <= 0:
            raise ParameterError("factors", self.factor.levels, "every factor must be > 0")

    def values(self, axes: int) -> Mapping[str, ArrayLike]:
        return self.tissue.values(axes)

    def inputs(self, axes: int) -> Layout:
        return Layout((*self.tissue.inputs(axes).blocks, ("tissue_factor", 1)))

    def exogenous(self, heart: PiecewisePolynomial) -> tuple[PiecewisePolynomial, ...]:
        return (*self.tissue.exogenous(heart), self.factor.piecewise(heart.end))

    def force(self, touch: Touch) -> ca.SX:
        return touch.inputs["tissue_factor"] * self.tissue.force(touch)

    @property
    def can_be_lost(self) -> bool:
        return self.tissue.can_be_lost

    def holds(self, touch: Touch) -> ca.SX:
        return self.tissue.holds(touch)

    def rest_depth(self, force: ArrayLike) -> FloatArray:
        return readonly(self.tissue.rest_depth(force) / self.factor.levels[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class OneSided:
    """The tissue inside, unable to pull: no force outside it, and none that would hold the tool.

    Contact is lost on an axis as soon as the tool leaves the surface there, and comes back with it.
    """

    tissue: Contact
    """The law inside."""

    def values(self, axes: int) -> Mapping[str, ArrayLike]:
        return self.tissue.values(axes)

    def inputs(self, axes: int) -> Layout:
        return self.tissue.inputs(axes)

    def exogenous(self, heart: PiecewisePolynomial) -> tuple[PiecewisePolynomial, ...]:
        return self.tissue.exogenous(heart)

    def force(self, touch: Touch) -> ca.SX:
        if touch.made is not None:
            return touch.made * self.tissue.force(touch)
        return ca.if_else(touch.depth > 0, ca.fmax(self.tissue.force(touch), 0), 0)

    @property
    def can_be_lost(self) -> bool:
        return True

    def holds(self, touch: Touch) -> ca.SX:
        # Made by the depth alone, lost also by a damper that would have to pull.
        return ca.fmin(touch.parameters["stiffness"] * touch.depth, self.tissue.force(touch))

    def rest_depth(self, force: ArrayLike) -> FloatArray:
        if np.any(np.asarray(force) < 0):
            raise ParameterError("force", force, "one-sided tissue cannot pull; needs >= 0 N")
        return self.tissue.rest_depth(force)


def retreating(heart: PiecewisePolynomial, retreat: StepSequence) -> PiecewisePolynomial:
    """Heart position (m) moved away from the tool on every axis by the steps of `retreat` (m).

    A surface that slips away under the tool, or comes back, faster than any controller.
    """
    steps = retreat.piecewise(heart.end)
    both = stack(heart, steps)  # on common breakpoints
    coefficients = both.coefficients[: heart.channels].copy()
    coefficients[:, :, 0] += both.coefficients[heart.channels, :, 0]
    return PiecewisePolynomial(breakpoints=both.breakpoints, coefficients=coefficients)
