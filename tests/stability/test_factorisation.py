"""The splittings of the force plant and what the theorems cover."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.stability import (
    Status,
    augmented_error_argument,
    factorisations,
    feedforward_theorem,
    positive_real,
    strictly_positive_real,
)
from mrac_design.verdict import Verdict

gains = st.fractions(min_value="1/100", max_value=5000, max_denominator=100)


@given(Ks=gains, K2=gains, c=gains, omega=gains, xi=gains)
@settings(max_examples=60, deadline=None)
def test_splittings_follow_their_closed_conditions(Ks, K2, c, omega, xi) -> None:
    table = factorisations(Ks, K2, filter_zero=c, bandwidth=omega, damping=xi)
    strict = [row.strict.verdict is Verdict.PROVED for row in table.rows]
    assert strict == [True, True, False, True, False, c < 2 * xi * omega]
    positive = [row.positive.verdict is Verdict.PROVED for row in table.rows]
    assert positive == [True, True, c <= K2, True, False, c <= 2 * xi * omega]
    stable = [row.second_stable for row in table.rows]
    assert stable == [False, False, True, False, True, True]
    assert not any(row.usable for row in table.rows[:5])


def test_without_velocity_loop_the_first_order_factor_is_only_positive_real() -> None:
    row = factorisations(800, 0, filter_zero=1, bandwidth=500, damping=1).rows[0]
    assert (row.positive.verdict, row.strict.verdict) == (Verdict.PROVED, Verdict.REFUTED)
    assert "positive real all the same" in row.summary


def test_error_model_at_the_border_is_not_strict() -> None:
    row = factorisations(800, 50, filter_zero=1000, bandwidth=500, damping=1).rows[5]
    assert row.strict.verdict is Verdict.REFUTED
    assert "ω² Re G → 0" in row.strict.reason


@pytest.mark.parametrize(
    ("changed", "name"),
    [({"stiffness": -1}, "Ks"), ({"velocity_gain": -1}, "K2"), ({"filter_zero": 0}, "filter zero")],
)
def test_values_outside_their_range_are_refused(changed, name) -> None:
    values = {"stiffness": 800, "velocity_gain": 50, "filter_zero": 25}
    with pytest.raises(ParameterError, match=name):
        factorisations(**(values | changed), bandwidth=500, damping=1)


def test_feedforward_theorem_does_not_cover_the_loop() -> None:
    table = factorisations(800, 50, filter_zero=25, bandwidth=500, damping=1)
    coverage = feedforward_theorem(table.rows[0], positive_real([800], [1, 50, 0]))
    assert coverage.verdict is Verdict.REFUTED
    status = {item.name: item.status for item in coverage.hypotheses}
    assert status["G stable"] is Status.VIOLATED
    assert status["G1 strictly positive real"] is Status.PROVED
    assert "does not cover" in coverage.summary


def test_augmented_error_argument_fails_only_on_the_disturbance() -> None:
    coverage = augmented_error_argument(
        positive_real([800], [1, 50, 0]), strictly_positive_real([800], [1])
    )
    assert [item.name for item in coverage.hypotheses if not item.holds] == ["no disturbance"]
