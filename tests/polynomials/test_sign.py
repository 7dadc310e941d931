"""Signs, real roots and root distributions of polynomials whose roots are known beforehand."""

from __future__ import annotations

import itertools

import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.polynomials.sign import (
    Sign,
    count_real_roots,
    isolate_real_roots,
    root_bound,
    sign_at_root,
    sign_on_interval,
)
from mrac_design.polynomials.stable import (
    disc_distribution,
    half_plane_distribution,
    is_hurwitz,
    is_schur,
    routh_first_column,
)

X = fmpq_poly([0, 1])
numbers = st.fractions(min_value=-20, max_value=20, max_denominator=12).map(
    lambda f: fmpq(f.numerator, f.denominator)
)
positives = numbers.filter(lambda q: q > 0)


def product(factors) -> fmpq_poly:
    result = fmpq_poly([1])
    for factor in factors:
        result *= factor
    return result


@given(roots=st.lists(numbers, min_size=1, max_size=6), complex_part=positives)
@settings(max_examples=80, deadline=None)
def test_real_roots_are_isolated_with_multiplicity(roots, complex_part) -> None:
    p = -3 * product(X - r for r in roots) * (X * X + complex_part)
    found = isolate_real_roots(p)
    distinct = sorted(set(roots))
    assert [f.multiplicity for f in found] == [roots.count(r) for r in distinct]
    assert all(f.lower <= r <= f.upper for f, r in zip(found, distinct, strict=True))
    assert all(
        f.refined(fmpq(1, 10**12)).upper - r < fmpq(1, 10**11)
        for f, r in zip(found, distinct, strict=True)
    )
    assert count_real_roots(p) == len(distinct)
    assert count_real_roots(p, distinct[0]) == len(distinct) - 1
    assert all(abs(r) <= root_bound(p) for r in distinct)


@given(roots=st.lists(numbers, max_size=5), low=numbers, width=positives, flip=st.booleans())
@settings(max_examples=120, deadline=None)
def test_sign_on_an_interval(roots, low, width, flip) -> None:
    p = product(X - r for r in roots) * (-1 if flip else 1)
    high = low + width
    result = sign_on_interval(p, low, high)
    inside = sorted({r for r in roots if low <= r <= high})
    marks = sorted({low, high, *inside})
    samples = [(a + b) / 2 for a, b in itertools.pairwise(marks)]
    if any(p(x) < 0 for x in samples):
        assert result.sign is Sign.NEGATIVE_SOMEWHERE
        assert low <= result.witness <= high
        assert p(result.witness) < 0
    else:
        assert result.sign is (Sign.NON_NEGATIVE if inside else Sign.POSITIVE)
    assert len(result.zeros) == len(inside)


def test_sign_at_an_irrational_root() -> None:
    (root,) = isolate_real_roots(X * X - 2, fmpq(0))
    assert sign_at_root(X - fmpq(14142135, 10**7), root) == 1
    assert sign_at_root(X - fmpq(14142136, 10**7), root) == -1
    assert sign_at_root((X * X - 2) * (X + 5), root) == 0


PLACES = st.sampled_from(["left", "axis", "right", "origin", "left pair", "right pair", "mirror"])


@given(places=st.lists(st.tuples(PLACES, positives), min_size=1, max_size=5))
@settings(max_examples=150, deadline=None)
def test_roots_are_counted_on_either_side_of_axis_and_circle(places) -> None:
    factor = {
        "left": (lambda a: X + a, (1, 0, 0)),
        "right": (lambda a: X - a, (0, 0, 1)),
        "origin": (lambda a: X, (0, 1, 0)),
        "axis": (lambda a: X * X + a, (0, 2, 0)),
        "left pair": (lambda a: X * X + X * a / 100 + a, (2, 0, 0)),
        "right pair": (lambda a: X * X - X * a / 100 + a, (0, 0, 2)),
        "mirror": (lambda a: X * X - a * a, (1, 0, 1)),
    }
    p = -2 * product(factor[kind][0](a) for kind, a in places)
    expected = tuple(sum(factor[kind][1][k] for kind, _ in places) for k in range(3))
    counts = half_plane_distribution(p)
    assert (counts.inside, counts.boundary, counts.outside) == expected
    assert is_hurwitz(p) == (expected[1] == expected[2] == 0)
    on_axis = [0 if kind == "origin" else a for kind, a in places if kind in ("axis", "origin")]
    assert counts.boundary_simple == (len(set(on_axis)) == len(on_axis))
    in_z = sum(
        (c * (X - 1) ** k * (X + 1) ** (p.degree() - k) for k, c in enumerate(p.coeffs())),
        fmpq_poly([]),
    )
    if in_z.degree() == p.degree():
        disc = disc_distribution(in_z)
        assert (disc.inside, disc.boundary, disc.outside) == expected
        assert is_schur(in_z) == (expected[1] == expected[2] == 0)


def test_routh_column_of_a_textbook_polynomial() -> None:
    """s⁴ + 2s³ + 3s² + 4s + 5 has the column 1, 2, 1, −6, 5: two roots on the right."""
    p = fmpq_poly([5, 4, 3, 2, 1])
    assert [int(c.p) for c in routh_first_column(p)] == [1, 2, 1, -6, 5]
    assert half_plane_distribution(p).outside == 2


def test_a_root_at_minus_one_is_on_the_circle() -> None:
    assert disc_distribution((X + 1) * (X + 1)).boundary_simple is False
    assert disc_distribution((X + 1) * (2 * X - 1)).boundary == 1


def test_the_zero_polynomial_is_refused() -> None:
    with pytest.raises(ParameterError):
        half_plane_distribution(fmpq_poly([]))
    with pytest.raises(ParameterError):
        isolate_real_roots(fmpq_poly([]))
