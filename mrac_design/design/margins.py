"""Stability margins of a rational loop gain, from real roots of exact polynomials.

On the boundary of the stability region p = jv, or q = (1 + jv)/(1 − jv), every condition
(|L| = 1, L real, extremal |1 + L|) is a polynomial equation in v over the rationals. Its real
roots are enclosed with proof, so no crossover is missed between points of a grid.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.design.region import is_stable
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import binary_rational, nearest_float, roots
from mrac_design.polynomials.stable import disc_to_half_plane
from mrac_design.time_domain import Discrete, TimeDomain


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityMargins:
    """How far a stable loop L is from instability; inf where no such change destabilises."""

    gain_margin: float
    """Smallest factor above 1 on the gain that reaches the stability limit."""

    gain_reduction_margin: float
    """Largest factor below 1 on the gain that reaches the stability limit; 0 when none does."""

    phase_margin: float
    """Smallest phase lag at a gain crossover that reaches the stability limit, rad."""

    delay_margin: float
    """Smallest extra dead time that reaches the stability limit, s. In discrete time this is
    the phase lag over the frequency, exact for whole samples only."""

    modulus_margin: float
    """Smallest |1 + L| on the boundary: 1 over the largest sensitivity."""

    crossover_frequency: float
    """Highest frequency with |L| = 1, rad/s; nan when there is none."""

    def _repr_markdown_(self) -> str:
        return (
            "| margin | value |\n|---|---|\n"
            f"| gain | × {self.gain_margin:.4g}, × {self.gain_reduction_margin:.4g} |\n"
            f"| phase | {math.degrees(self.phase_margin):.1f}° |\n"
            f"| delay | {1e3 * self.delay_margin:.3g} ms |\n"
            f"| modulus | {self.modulus_margin:.3g} |\n"
            f"| crossover | {self.crossover_frequency:.4g} rad/s |\n"
        )


def stability_margins(
    numerator: fmpq_poly, denominator: fmpq_poly, domain: TimeDomain
) -> StabilityMargins:
    """Margins of the loop gain L = numerator/denominator, whose closed loop is stable.

    Raises ParameterError when the closed loop is unstable: a margin then means nothing.
    """
    if not is_stable(numerator + denominator, domain):
        raise ParameterError("closed loop", "unstable", "margins exist for a stable loop only")
    boundary = _Boundary.of(numerator, denominator, domain)
    crossings = [
        (boundary.frequency(v), (math.pi + cmath.phase(boundary.value(v))) % (2.0 * math.pi))
        for v in _real_roots(boundary.gain_crossing)
        if v >= 0.0
    ]
    # At v and −v the loop gain is conjugate; the phase lag is measured at positive frequency.
    crossings = [(frequency, lag) for frequency, lag in crossings if frequency > 0.0]
    gains = [-1.0 / value for value in boundary.real_axis_crossings() if value < 0.0]
    return StabilityMargins(
        gain_margin=min((gain for gain in gains if gain > 1.0), default=math.inf),
        gain_reduction_margin=max((gain for gain in gains if gain < 1.0), default=0.0),
        phase_margin=min((min(lag, 2.0 * math.pi - lag) for _, lag in crossings), default=math.inf),
        delay_margin=min((lag / frequency for frequency, lag in crossings), default=math.inf),
        modulus_margin=boundary.least_distance_to_minus_one(),
        crossover_frequency=max((frequency for frequency, _ in crossings), default=math.nan),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Boundary:
    """L on the stability boundary as (n_re + j n_im)/(d_re + j d_im), polynomials in real v."""

    n_re: fmpq_poly
    n_im: fmpq_poly
    d_re: fmpq_poly
    d_im: fmpq_poly
    domain: TimeDomain

    @staticmethod
    def of(numerator: fmpq_poly, denominator: fmpq_poly, domain: TimeDomain) -> _Boundary:
        degree = max(numerator.degree(), denominator.degree())
        if isinstance(domain, Discrete):
            numerator = disc_to_half_plane(numerator, degree)
            denominator = disc_to_half_plane(denominator, degree)
        n_re, n_im = _on_imaginary_axis(numerator)
        d_re, d_im = _on_imaginary_axis(denominator)
        return _Boundary(n_re=n_re, n_im=n_im, d_re=d_re, d_im=d_im, domain=domain)

    @property
    def gain_crossing(self) -> fmpq_poly:
        return self.n_re**2 + self.n_im**2 - self.d_re**2 - self.d_im**2

    def value(self, v: float) -> complex:
        return complex(_at(self.n_re, v), _at(self.n_im, v)) / complex(
            _at(self.d_re, v), _at(self.d_im, v)
        )

    def frequency(self, v: float) -> float:
        if isinstance(self.domain, Discrete):
            return 2.0 * math.atan(v) / self.domain.period
        return v

    def real_axis_crossings(self) -> list[float]:
        """Values of L where it is real, at v ≥ 0 and at v = ∞."""
        imaginary = self.n_im * self.d_re - self.n_re * self.d_im
        poles = self.d_re.gcd(self.d_im)
        while not imaginary.is_zero() and imaginary.gcd(poles).degree() > 0:
            imaginary //= imaginary.gcd(poles)
        found = [self.value(v).real for v in _real_roots(imaginary) if v >= 0.0]
        return found if self._at_infinity is None else [*found, self._at_infinity]

    @property
    def _at_infinity(self) -> float | None:
        """L at v = ∞ when it is finite and not zero there (real by symmetry)."""
        order = max(self.d_re.degree(), self.d_im.degree())
        if max(self.n_re.degree(), self.n_im.degree()) != order:
            return None
        n = complex(_coefficient(self.n_re, order), _coefficient(self.n_im, order))
        return (n / complex(_coefficient(self.d_re, order), _coefficient(self.d_im, order))).real

    def least_distance_to_minus_one(self) -> float:
        top = (self.n_re + self.d_re) ** 2 + (self.n_im + self.d_im) ** 2
        bottom = self.d_re**2 + self.d_im**2
        common = top.gcd(bottom)
        top, bottom = top // common, bottom // common
        slope = top.derivative() * bottom - top * bottom.derivative()
        stationary = [] if slope.is_zero() else _real_roots(slope)
        values = [_at(top, v) / _at(bottom, v) for v in [0.0, *stationary] if _at(bottom, v) != 0.0]
        if top.degree() == bottom.degree():
            values.append(nearest_float(top.leading_coefficient() / bottom.leading_coefficient()))
        return math.sqrt(min(values))


def _on_imaginary_axis(polynomial: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """Real and imaginary part of the polynomial at jv, as polynomials in v."""
    values = polynomial.coeffs()
    signs = (1, 1, -1, -1)
    real = [value * signs[k % 4] if k % 2 == 0 else 0 for k, value in enumerate(values)]
    imaginary = [value * signs[k % 4] if k % 2 == 1 else 0 for k, value in enumerate(values)]
    return fmpq_poly(real), fmpq_poly(imaginary)


def _real_roots(polynomial: fmpq_poly) -> list[float]:
    """Real roots; the enclosure of a real root has imaginary part exactly zero."""
    return (
        []
        if polynomial.degree() < 1
        else [float(z.real) for z in roots(polynomial) if z.imag == 0.0]
    )


def _at(polynomial: fmpq_poly, v: float) -> float:
    """Value at the float v, rounded once: evaluation near a root must not cancel."""
    return nearest_float(polynomial(binary_rational(v)))


def _coefficient(polynomial: fmpq_poly, power: int) -> float:
    return nearest_float(polynomial[power])
