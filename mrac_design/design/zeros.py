"""Which zeros of the process the controller cancels: B = B⁺ B⁻ [AW §3.2].

A cancelled zero becomes a closed-loop pole that neither reference nor output shows but the
control signal does, so only well-damped zeros may go into B⁺. What "well-damped" means is
the engineer's choice and has no default.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from flint import fmpq_poly
from numpy.typing import NDArray

from mrac_design.errors import CancellationError, ParameterError
from mrac_design.polynomials.rationals import dyadic_factor, roots
from mrac_design.time_domain import TimeDomain


@dataclass(frozen=True, slots=True, kw_only=True)
class WellDampedRegion:
    """Modes s with −Re s ≥ decay rate and −Re s/|s| ≥ damping; q stands for exp(s h).

    In discrete time this excludes the zeros near the negative real axis, whose cancellation
    makes the control signal ring. Raises ParameterError unless 0 < damping ≤ 1 and decay ≥ 0.
    """

    damping: float
    """Least relative damping, dimensionless, in (0, 1]."""

    decay_rate: float
    """Least decay rate, 1/s, not negative."""

    def __post_init__(self) -> None:
        if not 0.0 < self.damping <= 1.0:
            raise ParameterError("least damping", self.damping, "must be in (0, 1]")
        if not (math.isfinite(self.decay_rate) and self.decay_rate >= 0.0):
            raise ParameterError("least decay rate", self.decay_rate, "must be ≥ 0, in 1/s")

    def contains(self, root: complex, domain: TimeDomain) -> bool:
        """Whether a zero at `root` may be cancelled."""
        mode = domain.equivalent_pole(root)
        if math.isinf(mode.real):
            return mode.real < 0.0
        decay = -mode.real
        return decay > 0.0 and decay >= self.decay_rate and decay >= self.damping * abs(mode)


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroSplit:
    """B = B⁺ B⁻."""

    cancelled: fmpq_poly
    """B⁺, monic."""

    kept: fmpq_poly
    """B⁻, gain included."""

    exact: bool
    """Whether the product is B over the rationals; otherwise B⁺ is rounded to 128 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepZeros:
    """Cancel nothing: B⁺ = 1."""

    def split(self, B: fmpq_poly, domain: TimeDomain) -> ZeroSplit:
        """The split of B; `domain` does not matter."""
        return ZeroSplit(cancelled=fmpq_poly([1]), kept=B, exact=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelFactor:
    """Cancel a stated factor of B, every root of which must be well damped."""

    factor: fmpq_poly
    """B⁺ up to a gain."""

    region: WellDampedRegion
    """Where a cancelled zero has to lie."""

    def split(self, B: fmpq_poly, domain: TimeDomain) -> ZeroSplit:
        """The split of B.

        Raises CancellationError for a root that is unstable, badly damped or no zero of B.
        """
        if self.factor.is_zero():
            raise ParameterError("cancelled factor", 0, "must not be zero")
        zeros = roots(self.factor)
        unstable = [complex(zero) for zero in zeros if not domain.is_stable(zero)]
        if unstable:
            raise CancellationError(
                unstable, "they lie outside the stability region, so would an uncontrolled mode"
            )
        outside = [complex(zero) for zero in zeros if not self.region.contains(zero, domain)]
        if outside:
            raise CancellationError(outside, f"they are not well damped by {self.region}")
        kept, remainder = divmod(B, self.factor)
        if not remainder.is_zero():
            foreign = self.factor // self.factor.gcd(B)
            raise CancellationError(
                [complex(zero) for zero in roots(foreign)], "B does not have them"
            )
        leading = self.factor.leading_coefficient()
        return ZeroSplit(cancelled=self.factor / leading, kept=kept * leading, exact=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelWellDamped:
    """Cancel every zero of the process inside a region."""

    region: WellDampedRegion
    """Where a cancelled zero has to lie."""

    def split(self, B: fmpq_poly, domain: TimeDomain) -> ZeroSplit:
        """The split of B; never fails."""
        cancelled, exact = fmpq_poly([1]), True
        for factor, multiplicity in B.factor()[1]:
            inside = self._inside(factor, domain)
            if inside.all():
                cancelled *= factor**multiplicity
            elif inside.any():
                # Irrational zeros on both sides of the region's boundary: no factor over the
                # rationals separates them.
                exact = False
                cancelled *= dyadic_factor(factor, inside) ** multiplicity
        cancelled /= cancelled.leading_coefficient()
        return ZeroSplit(cancelled=cancelled, kept=B // cancelled, exact=exact)

    def _inside(self, factor: fmpq_poly, domain: TimeDomain) -> NDArray[np.bool_]:
        return np.array([self.region.contains(zero, domain) for zero in roots(factor)], bool)


ZeroTreatment = KeepZeros | CancelFactor | CancelWellDamped
