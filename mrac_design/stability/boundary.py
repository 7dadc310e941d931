"""The real part of a rational function on the boundary of the stability region, exactly.

With s = jω and w = ω², Re G(jω) = M(w)/Q(w), where M = Re N(jω) D(−jω) and Q = |D(jω)|² are
polynomials in w. A discrete G(z) is mapped by z = (1 + s)/(1 − s) first: the unit circle becomes
the imaginary axis, z = −1 infinity, and ω = (2/T) atan of the image's frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi, sqrt

from flint import fmpq, fmpq_poly

from mrac_design.polynomials.sign import (
    RealRoot,
    Sign,
    SignOnInterval,
    isolate_real_roots,
    sign_at_root,
    sign_on_interval,
)
from mrac_design.polynomials.stable import (
    RootDistribution,
    even_and_odd_part,
    half_plane_distribution,
)
from mrac_design.stability.rational_function import RationalFunction, to_float
from mrac_design.time_domain import Continuous

ROOT_WIDTH = fmpq(1, 2**80)
"""Relative width to which a frequency is refined before it is shown as a float."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremum:
    """Greatest lower bound of Re G on the boundary and where it is reached."""

    value: float
    """inf over ω of Re G(jω); −inf beside a pole of the wrong kind."""
    frequency: float
    """ω (rad/s) where it is reached, inf when only in the limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Boundary:
    """What the exact analysis of G on the boundary has found."""

    function: RationalFunction
    """The function analysed."""
    numerator: fmpq_poly
    """N(s) of G or of its image in the half-plane."""
    denominator: fmpq_poly
    """D(s) of G or of its image in the half-plane."""
    poles: RootDistribution
    """Poles inside, on and outside the boundary (of the image)."""
    real_part: fmpq_poly
    """M(w)."""
    modulus: fmpq_poly
    """Q(w)."""
    sign: SignOnInterval
    """Sign of M on w >= 0."""

    @property
    def relative_degree(self) -> int:
        """Poles minus zeros of the image; negative for a pole at infinity."""
        return int(self.denominator.degree() - self.numerator.degree())

    @property
    def high_frequency_limit(self) -> fmpq:
        """lim ω² Re G(jω), for relative degree 1."""
        n = self.denominator.degree()
        return self.real_part[n - 1] / self.modulus.leading_coefficient()

    @property
    def direct_gain(self) -> fmpq:
        """lim Re G(jω) at high frequency, for relative degree 0 or −1."""
        n = self.denominator.degree()
        return self.real_part[n] / self.modulus.leading_coefficient()

    def value_at(self, w: fmpq) -> fmpq:
        """Re G at ω² = w."""
        return self.real_part(w) / self.modulus(w)

    def frequency(self, w: fmpq) -> float:
        """The frequency (rad/s) that belongs to w of the image."""
        omega = sqrt(to_float(w))
        domain = self.function.domain
        return omega if isinstance(domain, Continuous) else 2 * atan(omega) / domain.period


def boundary_of(function: RationalFunction) -> Boundary:
    """Analyse G on the boundary: poles, M(w), Q(w) and the sign of Re G."""
    numerator, denominator = function.half_plane_image()
    real_part = real_part_polynomial(numerator, denominator)
    modulus = real_part_polynomial(denominator, denominator)
    return Boundary(
        function=function,
        numerator=numerator,
        denominator=denominator,
        poles=half_plane_distribution(denominator),
        real_part=real_part,
        modulus=modulus,
        sign=sign_on_interval(real_part, fmpq(0)),
    )


def real_part_polynomial(a: fmpq_poly, b: fmpq_poly) -> fmpq_poly:
    """Re a(jω) b(−jω) as a polynomial in w = ω²."""
    a_even, a_odd = even_and_odd_part(a)
    b_even, b_odd = even_and_odd_part(b)
    in_v = a_even * b_even - fmpq_poly([0, 1]) * a_odd * b_odd
    return fmpq_poly([c if k % 2 == 0 else -c for k, c in enumerate(in_v.coeffs())])


def axis_poles(boundary: Boundary) -> tuple[tuple[float, int], ...]:
    """(ω, sign of the residue) of every simple pole jω of the image with ω >= 0.

    The residue of a pole counts as −1 when it is not real.
    """
    numerator, denominator = boundary.numerator, boundary.denominator
    slope = denominator.derivative()
    found: list[tuple[float, int]] = []
    if denominator(0) == 0:
        found.append((boundary.frequency(fmpq(0)), _sign(numerator(0) * slope(0))))
    even, odd = even_and_odd_part(denominator)
    symmetric = even.gcd(odd)
    real = real_part_polynomial(numerator, slope)
    imaginary = _imaginary_part_polynomial(numerator, slope)
    in_w = fmpq_poly([c if k % 2 == 0 else -c for k, c in enumerate(symmetric.coeffs())])
    for root in isolate_real_roots(in_w, fmpq(0)):
        if sign_at_root(fmpq_poly([0, 1]), root) == 0:
            continue
        sign = sign_at_root(real, root) if sign_at_root(imaginary, root) == 0 else -1
        found.append((boundary.frequency(_refined(root)), sign))
    return tuple(found)


def lowest_real_part(boundary: Boundary) -> Extremum:
    """inf Re G over the boundary and its place, as floats for show; signs are decided exactly."""
    if boundary.real_part == 0:
        return Extremum(value=0.0, frequency=0.0)
    common = boundary.real_part.gcd(boundary.modulus)
    above, below = boundary.real_part // common, boundary.modulus // common
    for pole in isolate_real_roots(below, fmpq(0)):
        if _falls_beside(above, below, pole):
            return Extremum(value=float("-inf"), frequency=boundary.frequency(_refined(pole)))
    if boundary.sign.sign is Sign.NON_NEGATIVE:
        touching = isolate_real_roots(above, fmpq(0))
        if touching:
            return Extremum(value=0.0, frequency=boundary.frequency(_refined(touching[0])))
    return _least(boundary, above, below)


def _falls_beside(above: fmpq_poly, below: fmpq_poly, pole: RealRoot) -> bool:
    """Whether above/below, for w >= 0, falls to −∞ beside a root of its denominator."""
    if pole.exact and pole.lower == 0:
        rest = below // fmpq_poly([0, 1]) ** pole.multiplicity
        return bool(above(0) * rest(0) < 0)
    if pole.multiplicity % 2:
        return True
    return sign_at_root(above * (below // pole.factor**pole.multiplicity), pole) < 0


def _least(boundary: Boundary, above: fmpq_poly, below: fmpq_poly) -> Extremum:
    """Least value of above/below over w >= 0 among its stationary points, 0 and infinity."""
    stationary = above.derivative() * below - above * below.derivative()
    points = [fmpq(0)] if below(0) != 0 else []
    if stationary != 0:
        points += [_refined(root) for root in isolate_real_roots(stationary, fmpq(0))]
    values = [(above(w) / below(w), w) for w in points if below(w) != 0]
    at_infinity = _limit(above, below)
    if not values or at_infinity < min(to_float(value) for value, _ in values):
        end = boundary.function.domain
        top = float("inf") if isinstance(end, Continuous) else pi / end.period
        return Extremum(value=at_infinity, frequency=top)
    value, w = min(values)
    return Extremum(value=to_float(value), frequency=boundary.frequency(w))


def _limit(above: fmpq_poly, below: fmpq_poly) -> float:
    """Limit of above/below at +∞."""
    excess = above.degree() - below.degree()
    ratio = above.leading_coefficient() / below.leading_coefficient()
    if excess == 0:
        return to_float(ratio)
    return 0.0 if excess < 0 else float("inf") * _sign(ratio)


def _refined(root: RealRoot) -> fmpq:
    """A rational number close to the root, relative to its size."""
    if root.exact:
        return root.lower
    while root.lower == 0:
        root = root.refined((root.upper - root.lower) / 2)
    return root.refined(root.upper * ROOT_WIDTH).midpoint


def _imaginary_part_polynomial(a: fmpq_poly, b: fmpq_poly) -> fmpq_poly:
    """Im a(jω) b(−jω), divided by ω, as a polynomial in w = ω²."""
    a_even, a_odd = even_and_odd_part(a)
    b_even, b_odd = even_and_odd_part(b)
    in_v = a_odd * b_even - a_even * b_odd
    return fmpq_poly([c if k % 2 == 0 else -c for k, c in enumerate(in_v.coeffs())])


def _sign(value: fmpq) -> int:
    return int(value > 0) - int(value < 0)
