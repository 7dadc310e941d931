"""Verdicts on positive realness against enclosed roots, textbook cases and python-control."""

from __future__ import annotations

import dataclasses
from collections import Counter

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.stability import (
    positive_real,
    rational_function,
    second_opinion,
    strictly_positive_real,
    strongly_strictly_positive_real,
)
from mrac_design.time_domain import Discrete
from mrac_design.verdict import Verdict
from tests.oracles.positive_real_roots import (
    PR,
    SPR,
    STRONG,
    continuous_verdicts,
    discrete_verdicts,
)
from tests.stability.random_systems import continuous_pairs, discrete_pairs

QUESTIONS = {
    PR: positive_real,
    SPR: strictly_positive_real,
    STRONG: strongly_strictly_positive_real,
}


def verdicts(*arguments: object) -> dict[str, bool]:
    return {
        kind: ask(*arguments).verdict is Verdict.PROVED  # type: ignore[operator]
        for kind, ask in QUESTIONS.items()
    }


def test_a_thousand_continuous_functions_agree_with_enclosed_roots() -> None:
    seen: Counter[tuple[str, bool]] = Counter()
    for numerator, denominator in continuous_pairs(seed=11, count=1000):
        ours = verdicts(numerator, denominator)
        assert ours == continuous_verdicts(numerator, denominator), (numerator, denominator)
        seen.update(ours.items())
    # The sample must put every verdict to the test often enough to mean something.
    assert min(seen[kind, answer] for kind in QUESTIONS for answer in (True, False)) >= 50, seen


def test_discrete_functions_agree_with_enclosed_roots() -> None:
    seen: Counter[tuple[str, bool]] = Counter()
    for numerator, denominator in discrete_pairs(seed=7, count=400):
        ours = verdicts(numerator, denominator, Discrete(1e-3))
        assert ours == discrete_verdicts(numerator, denominator), (numerator, denominator)
        seen.update(ours.items())
    assert min(seen[kind, answer] for kind in QUESTIONS for answer in (True, False)) >= 20, seen


@pytest.mark.parametrize("kind", list(QUESTIONS))
def test_every_proved_verdict_carries_a_witness_that_multiplies_out(kind) -> None:
    systems = [(*pair, None) for pair in continuous_pairs(seed=5, count=250)]
    systems += [(*pair, Discrete(1e-3)) for pair in discrete_pairs(seed=6, count=100)]
    judged = [QUESTIONS[kind](*system) for system in systems]
    for result in judged:
        assert (result.witness is not None) == (result.verdict is Verdict.PROVED)
        assert result.witness is None or result.witness.verify(), result.function
    assert sum(result.witness is not None for result in judged) >= 50


def test_a_spoilt_witness_is_noticed() -> None:
    storage = strictly_positive_real([1, 3], [1, 4, 5]).witness
    P = storage.P * fmpq(11, 10)
    assert not dataclasses.replace(storage, P=P).verify()
    sampled = strictly_positive_real([1, "0.2"], [1, "-0.3"], Discrete(1.0)).witness
    assert not dataclasses.replace(sampled, P=sampled.P * 9).verify()
    factors = positive_real([1, 0, 1], [1, 2, 1]).witness
    assert factors.verify()
    assert not dataclasses.replace(factors, power=factors.power + 1).verify()
    negative = dataclasses.replace(
        factors, positive=-factors.positive, real_part=-factors.real_part
    )
    assert not negative.verify()


positive = st.fractions(min_value="1/1000", max_value=1000, max_denominator=1000)


@given(b=positive, c=positive, a=positive)
@settings(max_examples=100, deadline=None)
def test_classic_second_order_condition(a, b, c) -> None:
    """(s + a)/((s + b)(s + c)) is strictly positive real if and only if a < b + c."""
    denominator = [1, b + c, b * c]
    assert verdicts([1, a], denominator)[SPR] == (a < b + c)
    assert verdicts([1, b + c], denominator) == {PR: True, SPR: False, STRONG: False}
    assert not verdicts([1, b + c + a / 10**9], denominator)[PR]
    assert verdicts([1, (b + c) * (1 - a / 10**12)], denominator)[SPR]


@given(seed=st.integers(0, 10**6), scale=positive)
@settings(max_examples=40, deadline=None)
def test_scaling_time_and_gain_changes_nothing(seed, scale) -> None:
    (pair,) = continuous_pairs(seed, 1)
    scaled = [
        fmpq_poly(
            [
                c / int(scale.numerator) ** k * int(scale.denominator) ** k
                for k, c in enumerate(p.coeffs())
            ]
        )
        for p in pair
    ]
    assert verdicts(*pair) == verdicts(3 * scaled[0], scaled[1])


@given(seed=st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_the_inverse_is_positive_real_too(seed) -> None:
    (pair,) = continuous_pairs(seed, 1)
    if pair[0] != 0:
        assert verdicts(*pair)[PR] == verdicts(*pair[::-1])[PR]


def test_margin_and_worst_frequency_match_a_fine_grid() -> None:
    judged = strictly_positive_real([2.0, 3.0, 20.0], [1.0, 0.7, 9.0])
    omega = np.linspace(0, 20, 400_001)
    real = control.tf([2, 3, 20], [1, 0.7, 9])(1j * omega).real
    # The grid is 5e-5 rad/s wide and the minimum quadratic, so values agree far below 1e-6.
    assert judged.margin == pytest.approx(real.min(), abs=1e-6)
    assert judged.worst_frequency == pytest.approx(omega[real.argmin()], abs=1e-3)


def test_reason_names_the_number_that_decides() -> None:
    assert "Re G = -0.0004 at ω = 0 rad/s" in positive_real([1, 51], [1, 50, 0]).reason
    assert "relative degree 2" in strictly_positive_real([800], [1, 50, 0]).reason
    assert "ω² Re G → 0" in strictly_positive_real([1, 1000], [1, 1000, 250000]).reason
    assert "imaginary axis at ω = 2 rad/s" in strictly_positive_real([1, 0], [1, 0, 4]).reason
    assert "residue" in positive_real([-1, 0], [1, 0, 4]).reason
    assert "z = −1" in strictly_positive_real([1, 0], [1, 1], Discrete(1.0)).reason


def test_a_common_factor_does_not_hide_the_function() -> None:
    judged = strictly_positive_real([1, 3, 2], [1, 6, 5])
    assert judged.verdict is Verdict.PROVED
    assert judged.function.cancelled == fmpq_poly([1, 1])


def test_python_control_objects_bring_their_time_domain() -> None:
    assert rational_function(control.tf([1], [1, 1], 0.01)).domain == Discrete(0.01)
    assert strictly_positive_real(control.tf([1, 1], [1, 2])).verdict is Verdict.PROVED
    with pytest.raises(ParameterError, match="one input and one output"):
        positive_real(control.tf([[[1], [1]]], [[[1, 1], [1, 2]]]))


@pytest.mark.parametrize("bad", [([1], [0, 0]), ([float("nan")], [1]), (["x"], [1]), ([None], [1])])
def test_numbers_that_are_none_are_refused(bad) -> None:
    with pytest.raises(ParameterError):
        positive_real(*bad)


def test_second_opinion_agrees_where_the_solver_is_sure() -> None:
    pytest.importorskip("cvxopt")
    assert second_opinion(positive_real([1, 25], [1, 50])).passive is True
    assert second_opinion(positive_real([800], [1, 50, 0])).passive is False
    assert second_opinion(positive_real([800], [1])).passive is None
