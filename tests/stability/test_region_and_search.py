"""Conditions in letters against exact verdicts, and the search over splittings."""

from __future__ import annotations

import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.polynomials.expressions import Letter, symbols
from mrac_design.stability.positive_real import strictly_positive_real
from mrac_design.stability.rational_function import rational_function
from mrac_design.stability.region import candidate_conditions, region_on_grid, spr_condition
from mrac_design.stability.search import search_factorisations
from mrac_design.time_domain import Discrete
from mrac_design.verdict import Verdict

positive = st.fractions(min_value="1/20", max_value=20, max_denominator=50)


def functions(K2, omega, xi, ao, c):
    """The candidates' polynomials for numbers, written out by hand."""
    p, one = fmpq_poly([0, 1]), fmpq_poly([1])
    Am = p * p + 2 * xi * omega * p + omega * omega
    return (
        (one, p + K2),
        (p + c, p + K2),
        (p + c, p * (p + K2)),
        (p + c, Am),
        (one, p + ao),
        ((p + c) * (p + c), (p + ao) * Am),
    )


@given(K2=positive, omega=positive, xi=positive, ao=positive, c=positive)
@settings(max_examples=150, deadline=None)
def test_conditions_in_letters_agree_with_exact_verdicts(K2, omega, xi, ao, c) -> None:
    values = {"K2": K2, "omega": omega, "xi": xi, "ao": ao, "c": c}
    exact = {k: fmpq(v.numerator, v.denominator) for k, v in values.items()}
    for condition, pair in zip(candidate_conditions(), functions(**exact), strict=True):
        proved = strictly_positive_real(*pair).verdict is Verdict.PROVED
        assert condition.holds(values) == proved, condition.name


def test_conditions_read_as_in_the_textbook() -> None:
    latex = [condition.latex() for condition in candidate_conditions()]
    assert latex[3] == r"2 \omega \xi-c > 0"
    assert "never: pole at 0" in latex[2]
    a, b, c = symbols(tuple(Letter(name=n, latex=n) for n in "abc"))
    one = a.constant(1)
    classic = spr_condition("(s + a)/((s + b)(s + c))", [one, a], [one, b + c, b * c])
    assert classic.holds({"a": 4, "b": 2, "c": 3})
    assert not classic.holds({"a": 5, "b": 2, "c": 3})
    assert classic.latex() == "b+c-a > 0"
    assert spr_condition("G", [one], [one, a, b]).impossible == "relative degree 2"


def test_a_grid_shows_the_border() -> None:
    grid = region_on_grid(
        lambda c, xi: rational_function([1.0, float(c)], [1.0, 20.0 * float(xi), 100.0]),
        np.array([5.0, 15.0, 25.0]),
        np.array([0.5, 1.0]),
    )
    expected = [[True, True], [False, True], [False, False]]
    np.testing.assert_array_equal(grid.strictly_positive_real, expected)


def test_every_splitting_multiplies_back_to_the_plant() -> None:
    table = search_factorisations([800, 8000], [1, 50, 600, 0], filter_zeros=[-25, "-1/2"])
    names = [row.name for row in table.rows]
    assert len(set(names)) == len(names)
    for row in table.rows:
        N = row.first.numerator * row.second.numerator
        D = row.first.denominator * row.second.denominator
        assert N * fmpq_poly([0, 600, 50, 1]) == D * fmpq_poly([8000, 800]), row.name
        assert row.second.relative_degree >= 0
    usable = [row.usable for row in table.rows]
    assert usable == sorted(usable, reverse=True)


def test_a_stable_plant_has_a_usable_splitting() -> None:
    table = search_factorisations([3], [1, 3, 2], filter_zeros=[])
    assert table.rows[0].usable
    assert "3/(p + 1) · 1/(p + 2)" in {row.name for row in table.rows if row.usable}
    assert "| yes |" in table._repr_markdown_()


def test_a_sampled_plant_is_split_in_z() -> None:
    table = search_factorisations([1, 0], [1, "-0.9", "0.2"], Discrete(0.01), filter_zeros=[])
    assert all("z" in row.name for row in table.rows)
    best = table.rows[0]
    assert best.usable


def test_too_many_splittings_are_refused() -> None:
    with pytest.raises(ParameterError, match="fewer"):
        search_factorisations([1], [1, 3, 2], filter_zeros=list(range(-9, -1)))
