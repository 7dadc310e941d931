"""Real roots and the sign of a rational polynomial, decided exactly with Sturm sequences.

No rounding happens anywhere: an answer of this module is a proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

from flint import fmpq, fmpq_poly

from mrac_design.errors import ParameterError


class Sign(Enum):
    """The sign a polynomial has on an interval."""

    POSITIVE = "positive"
    """> 0 everywhere on the interval."""
    NON_NEGATIVE = "non-negative"
    """>= 0 everywhere and 0 somewhere, or identically zero."""
    NEGATIVE_SOMEWHERE = "negative somewhere"
    """< 0 at one point at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealRoot:
    """One real root, alone between two rational bounds."""

    lower: fmpq
    """Bound below the root, or the root itself when `lower == upper`."""
    upper: fmpq
    """Bound above the root."""
    multiplicity: int
    """How often the root occurs."""
    factor: fmpq_poly
    """Square-free polynomial with this root and no other one in [lower, upper]."""

    @property
    def exact(self) -> bool:
        """Whether the root is known as a rational number."""
        return bool(self.lower == self.upper)

    @property
    def midpoint(self) -> fmpq:
        """Rational number in the middle of the bounds."""
        return (self.lower + self.upper) / 2

    def refined(self, width: fmpq) -> RealRoot:
        """The same root between bounds at most `width` apart (bisection)."""
        lower, upper = self.lower, self.upper
        below = _sign(self.factor(lower))
        while upper - lower > width:
            middle = (lower + upper) / 2
            here = _sign(self.factor(middle))
            if here == 0:
                lower = upper = middle
            elif here == below:
                lower = middle
            else:
                upper = middle
        return RealRoot(
            lower=lower, upper=upper, multiplicity=self.multiplicity, factor=self.factor
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SignOnInterval:
    """The sign of a polynomial on an interval and the point that shows it."""

    sign: Sign
    """The decision."""
    witness: fmpq | None
    """Where the polynomial is < 0; None when it is nowhere."""
    zeros: tuple[RealRoot, ...]
    """Zeros inside the interval, ends included, in ascending order."""


def square_free_factors(p: fmpq_poly) -> tuple[tuple[fmpq_poly, int], ...]:
    """Pairwise coprime square-free factors of p with their multiplicities, constants left out."""
    if p.degree() < 1:
        return ()
    _, factors = p.factor_squarefree()
    return tuple((factor, int(power)) for factor, power in factors)


def sturm_sequence(p: fmpq_poly) -> tuple[fmpq_poly, ...]:
    """Sturm's sequence p, p', −rem, …, each scaled by a positive number to keep it short."""
    return signed_remainders(p, p.derivative())


def signed_remainders(p: fmpq_poly, q: fmpq_poly) -> tuple[fmpq_poly, ...]:
    """p, q, −(p mod q), … down to the last that is not zero (generalised Sturm sequence)."""
    sequence = [_positive_primitive(p)]
    while q != 0:
        sequence.append(_positive_primitive(q))
        p, q = sequence[-2], -(sequence[-2] % sequence[-1])
    return tuple(sequence)


def sign_variations(sequence: Sequence[fmpq_poly], point: fmpq | None, *, end: int = 1) -> int:
    """Sign changes along a sequence at `point`; at +∞ or −∞ (`end` = ±1) when `point` is None."""
    if point is None:
        signs = [_sign(q.leading_coefficient()) * (end if q.degree() % 2 else 1) for q in sequence]
    else:
        signs = [_sign(q(point)) for q in sequence]
    signs = [s for s in signs if s]
    return sum(a != b for a, b in pairwise(signs))


def count_real_roots(p: fmpq_poly, lower: fmpq | None = None, upper: fmpq | None = None) -> int:
    """Number of distinct real roots in (lower, upper]; None stands for −∞ or +∞.

    Raises ParameterError for the zero polynomial.
    """
    _require_non_zero(p)
    if p.degree() < 1:
        return 0
    sequence = sturm_sequence(_radical(p))
    return sign_variations(sequence, lower, end=-1) - sign_variations(sequence, upper)


def isolate_real_roots(
    p: fmpq_poly, lower: fmpq | None = None, upper: fmpq | None = None
) -> tuple[RealRoot, ...]:
    """Distinct real roots in the closed interval, each alone between rational bounds, ascending.

    Raises ParameterError for the zero polynomial.
    """
    _require_non_zero(p)
    bound = root_bound(p)
    low = -bound if lower is None else lower
    high = bound if upper is None else upper
    found: list[RealRoot] = []
    for factor, multiplicity in square_free_factors(p):
        spans = _isolate_square_free(factor, low, high)
        found += [
            RealRoot(lower=a, upper=b, multiplicity=multiplicity, factor=factor) for a, b in spans
        ]
    return _separated(found)


def sign_on_interval(
    p: fmpq_poly, lower: fmpq | None = None, upper: fmpq | None = None
) -> SignOnInterval:
    """Sign of p on the closed interval [lower, upper]; None stands for −∞ or +∞."""
    if p == 0:
        return SignOnInterval(sign=Sign.NON_NEGATIVE, witness=None, zeros=())
    zeros = isolate_real_roots(p, lower, upper)
    for point in _sample_points(p, zeros, lower, upper):
        if p(point) < 0:
            return SignOnInterval(sign=Sign.NEGATIVE_SOMEWHERE, witness=point, zeros=zeros)
    sign = Sign.NON_NEGATIVE if zeros else Sign.POSITIVE
    return SignOnInterval(sign=sign, witness=None, zeros=zeros)


def sign_at_root(q: fmpq_poly, root: RealRoot) -> int:
    """Sign (−1, 0, 1) of q at an algebraic number given by its isolating bounds."""
    if root.exact:
        return _sign(q(root.lower))
    if q == 0:
        return 0
    common = root.factor.gcd(q)
    if common.degree() > 0 and count_real_roots(common, root.lower, root.upper) > 0:
        return 0
    while q.degree() > 0 and (
        q(root.lower) == 0 or count_real_roots(q, root.lower, root.upper) > 0
    ):
        root = root.refined((root.upper - root.lower) / 4)
        if root.exact:
            return _sign(q(root.lower))
    return _sign(q(root.midpoint))


def root_bound(p: fmpq_poly) -> fmpq:
    """Power of two larger than the modulus of every root of p (Fujiwara's bound)."""
    leading = abs(p.leading_coefficient())
    exponent = 0
    for k, coefficient in enumerate(reversed(p.coeffs()[:-1]), start=1):
        if coefficient != 0:
            ratio = abs(coefficient) / leading
            bits = ratio.p.bit_length() - ratio.q.bit_length() + 1
            exponent = max(exponent, -(-bits // k))
    return fmpq(2) ** (exponent + 1)


def _isolate_square_free(p: fmpq_poly, low: fmpq, high: fmpq) -> list[tuple[fmpq, fmpq]]:
    """Bounds of the roots of a square-free p in [low, high]; no open bound is itself a root."""
    sequence = sturm_sequence(p)
    spans: list[tuple[fmpq, fmpq]] = []
    if p(low) == 0:
        spans.append((low, low))
    pending = [(low, sign_variations(sequence, low), high, sign_variations(sequence, high))]
    while pending:
        a, at_a, b, at_b = pending.pop()
        if at_a == at_b:
            continue
        if p(b) == 0 and at_a - at_b == 1:
            spans.append((b, b))
        elif at_a - at_b == 1 and p(a) != 0:
            spans.append((a, b))
        else:
            middle = (a + b) / 2
            at_middle = sign_variations(sequence, middle)
            pending += [(a, at_a, middle, at_middle), (middle, at_middle, b, at_b)]
    return spans


def _separated(roots: list[RealRoot]) -> tuple[RealRoot, ...]:
    """Roots of coprime factors, refined until their bounds do not overlap, ascending."""
    roots = sorted(roots, key=lambda root: (root.lower, root.upper))
    index = 0
    while index + 1 < len(roots):
        a, b = roots[index], roots[index + 1]
        if a.upper < b.lower:
            index += 1
            continue
        roots[index : index + 2] = [
            r if r.exact else r.refined((r.upper - r.lower) / 4) for r in (a, b)
        ]
        roots.sort(key=lambda root: (root.lower, root.upper))
        index = 0
    return tuple(roots)


def _sample_points(
    p: fmpq_poly, zeros: tuple[RealRoot, ...], lower: fmpq | None, upper: fmpq | None
) -> list[fmpq]:
    """One rational point in every piece of the interval between consecutive zeros."""
    bound = root_bound(p)
    low = min(-bound, upper - 1 if upper is not None else -bound) if lower is None else lower
    high = max(bound, lower + 1 if lower is not None else bound) if upper is None else upper
    if not zeros:
        return [(low + high) / 2]
    points = [(a.upper + b.lower) / 2 for a, b in pairwise(zeros)]
    if low < zeros[0].lower:
        points.insert(0, (low + zeros[0].lower) / 2)
    elif low == zeros[0].lower and not zeros[0].exact:
        points.insert(0, low)
    if zeros[-1].upper < high:
        points.append((zeros[-1].upper + high) / 2)
    elif zeros[-1].upper == high and not zeros[-1].exact:
        points.append(high)
    return points


def _radical(p: fmpq_poly) -> fmpq_poly:
    """Square-free polynomial with the same roots."""
    return p // p.gcd(p.derivative())


def _positive_primitive(p: fmpq_poly) -> fmpq_poly:
    """p times a positive number so that its coefficients are coprime integers."""
    numerator = p.numer()
    content = numerator.content()
    return fmpq_poly(numerator // content) if content not in (0, 1) else fmpq_poly(numerator)


def _sign(value: fmpq) -> int:
    return int(value > 0) - int(value < 0)


def _require_non_zero(p: fmpq_poly) -> None:
    if p == 0:
        raise ParameterError("polynomial", 0, "every number is a root of the zero polynomial")
