"""Where the roots of a rational polynomial lie: half-plane and disc, decided exactly.

Routh's array and the Schur–Cohn recursion answer "all inside"; the Cauchy index by a generalised
Sturm sequence counts the roots on either side when they are not.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq, fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.polynomials.sign import (
    count_real_roots,
    sign_variations,
    signed_remainders,
    square_free_factors,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RootDistribution:
    """How many roots lie inside, on and outside the boundary of a stability region."""

    inside: int
    """Roots in the open stability region, with multiplicity."""
    boundary: int
    """Roots on its boundary, with multiplicity."""
    outside: int
    """Roots outside, with multiplicity."""
    boundary_simple: bool
    """Whether every root on the boundary is simple."""

    @property
    def stable(self) -> bool:
        """Whether all roots lie in the open region."""
        return self.boundary == 0 and self.outside == 0


def even_and_odd_part(p: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """(e, o) with p(s) = e(s²) + s o(s²), both as polynomials in v = s²."""
    coefficients = p.coeffs()
    return fmpq_poly(coefficients[0::2]), fmpq_poly(coefficients[1::2])


def routh_first_column(p: fmpq_poly) -> tuple[fmpq, ...]:
    """First column of Routh's array; it stops early at a zero, when p cannot be Hurwitz."""
    coefficients = p.coeffs()[::-1]
    upper, lower = coefficients[0::2], coefficients[1::2]
    column = [upper[0]]
    while lower:
        column.append(lower[0])
        if lower[0] == 0:
            break
        ratio = upper[0] / lower[0]
        padded = lower[1:] + [fmpq(0)] * (len(upper) - len(lower))
        upper, lower = lower, [a - ratio * b for a, b in zip(upper[1:], padded, strict=True)]
    return tuple(column)


def is_hurwitz(p: fmpq_poly) -> bool:
    """Whether every root of p has a negative real part (Routh's criterion)."""
    _require_non_zero(p)
    column = routh_first_column(p)
    return len(column) == p.degree() + 1 and all(entry * column[0] > 0 for entry in column)


def half_plane_distribution(p: fmpq_poly) -> RootDistribution:
    """Roots of p with Re s < 0 (inside), = 0 (boundary) and > 0 (outside)."""
    _require_non_zero(p)
    at_origin = 0
    while p.coeffs()[0] == 0:
        p = fmpq_poly(p.coeffs()[1:])
        at_origin += 1
    even, odd = even_and_odd_part(p)
    symmetric = even.gcd(odd)
    on_axis = sum(
        2 * power * count_real_roots(factor, None, fmpq(0))
        for factor, power in square_free_factors(symmetric)
    )
    simple = at_origin <= 1 and all(
        power == 1 or count_real_roots(factor, None, fmpq(0)) == 0
        for factor, power in square_free_factors(symmetric)
    )
    excess = _left_minus_right(even // symmetric, odd // symmetric)
    rest = p.degree() - on_axis
    return RootDistribution(
        inside=(rest + excess) // 2,
        boundary=on_axis + at_origin,
        outside=(rest - excess) // 2,
        boundary_simple=simple,
    )


def is_schur(p: fmpq_poly) -> bool:
    """Whether every root of p has modulus below one (Schur–Cohn recursion)."""
    _require_non_zero(p)
    coefficients = p.coeffs()
    while len(coefficients) > 1:
        first, last = coefficients[0], coefficients[-1]
        if abs(first) >= abs(last):
            return False
        reflection = first / last
        coefficients = [
            a - reflection * b for a, b in zip(coefficients, coefficients[::-1], strict=True)
        ][1:]
    return True


def disc_distribution(p: fmpq_poly) -> RootDistribution:
    """Roots of p with |z| < 1 (inside), = 1 (boundary) and > 1 (outside)."""
    image = disc_to_half_plane(p, p.degree())
    at_minus_one = p.degree() - image.degree()
    counts = half_plane_distribution(image)
    return RootDistribution(
        inside=counts.inside,
        boundary=counts.boundary + at_minus_one,
        outside=counts.outside,
        boundary_simple=counts.boundary_simple and at_minus_one <= 1,
    )


def disc_to_half_plane(p: fmpq_poly, degree: int) -> fmpq_poly:
    """(1 − s)^degree p((1 + s)/(1 − s)): |z| < 1 becomes Re s < 0, z = −1 becomes s = ∞."""
    _require_non_zero(p)
    plus, minus = fmpq_poly([1, 1]), fmpq_poly([1, -1])
    return sum(
        (c * plus**k * minus ** (degree - k) for k, c in enumerate(p.coeffs())), fmpq_poly([])
    )


def _left_minus_right(even: fmpq_poly, odd: fmpq_poly) -> int:
    """Left minus right roots of e(s²) + s o(s²), where e and o are coprime, by the Cauchy index."""
    if odd == 0:
        return 0
    # p(jω) = e(−ω²) + jω o(−ω²): its phase turns by π/2 for every root left, −π/2 for one right.
    real = _at_minus_square(even)
    imaginary = fmpq_poly([0, 1]) * _at_minus_square(odd)
    # The index of the fraction with the larger denominator has no share from infinity.
    if imaginary.degree() > real.degree():
        return _cauchy_index(real, imaginary)
    return -_cauchy_index(imaginary, real)


def _cauchy_index(numerator: fmpq_poly, denominator: fmpq_poly) -> int:
    """Jumps from −∞ to +∞ minus jumps from +∞ to −∞ of the fraction along the real line."""
    sequence = signed_remainders(denominator, numerator)
    return sign_variations(sequence, None, end=-1) - sign_variations(sequence, None)


def _at_minus_square(p: fmpq_poly) -> fmpq_poly:
    """p(−x²) as a polynomial in x."""
    coefficients = [fmpq(0)] * (2 * p.degree() + 1)
    for k, c in enumerate(p.coeffs()):
        coefficients[2 * k] = c if k % 2 == 0 else -c
    return fmpq_poly(coefficients)


def _require_non_zero(p: fmpq_poly) -> None:
    if p == 0:
        raise ParameterError("polynomial", 0, "the zero polynomial has no root distribution")
