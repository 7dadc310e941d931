"""Piecewise polynomials: evaluation, refinement, stacking."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PPoly

from mrac_design.errors import ParameterError
from mrac_design.motion import PiecewisePolynomial, from_ppoly, quintic_hermite, stack
from mrac_design.motion.signal import merged_breakpoints


def random_signal(random: np.random.Generator, channels: int, end: float) -> PiecewisePolynomial:
    count, degree = int(random.integers(1, 7)), int(random.integers(0, 6))
    inner = np.sort(random.uniform(0.05, 0.95, count - 1)) * end
    return PiecewisePolynomial(
        breakpoints=np.concatenate(([0.0], inner, [end])),
        coefficients=random.normal(size=(channels, count, degree + 1)),
    )


def scipy_value(signal: PiecewisePolynomial, t: np.ndarray, order: int = 0) -> np.ndarray:
    """SciPy's evaluation of the same pieces (also right-continuous)."""
    descending = np.transpose(signal.coefficients[:, :, ::-1], (2, 1, 0))
    return PPoly(descending, signal.breakpoints)(t, order).T


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_values_and_derivatives_agree_with_scipy(seed: int) -> None:
    random = np.random.default_rng(seed)
    signal = random_signal(random, 2, 1.5)
    t = np.concatenate((random.uniform(0.0, 1.5, 50), signal.breakpoints))
    # Same arithmetic in another order on numbers of size 1…100: rounding only.
    np.testing.assert_allclose(signal(t), scipy_value(signal, t), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        signal.derivative()(t), scipy_value(signal, t, 1), rtol=1e-12, atol=1e-11
    )


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_refinement_and_stacking_change_nothing(seed: int) -> None:
    random = np.random.default_rng(seed)
    first, second = random_signal(random, 2, 2.0), random_signal(random, 1, 2.0)
    both = stack(first, second)
    t = random.uniform(0.0, 2.0, 200)
    # A Taylor shift by less than 2 s multiplies rounding by at most 3^5.
    np.testing.assert_allclose(both(t)[:2], first(t), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(both(t)[2:], second(t), rtol=1e-11, atol=1e-11)
    assert set(both.breakpoints) == set(first.breakpoints) | set(second.breakpoints)


def test_a_step_belongs_to_the_right() -> None:
    step = PiecewisePolynomial(breakpoints=[0.0, 1.0, 2.0], coefficients=[[[3.0], [5.0]]])
    np.testing.assert_array_equal(step([0.0, np.nextafter(1.0, 0.0), 1.0, 2.0]), [[3, 3, 5, 5]])
    np.testing.assert_array_equal(step.derivative()([0.5, 1.0]), [[0.0, 0.0]])


def test_instants_equal_up_to_rounding_are_one_breakpoint() -> None:
    # 0.1 + 0.2 lies one bit above 0.3.
    first = PiecewisePolynomial(breakpoints=[0.0, 0.1 + 0.2, 1.0], coefficients=[[[1.0], [2.0]]])
    second = PiecewisePolynomial(breakpoints=[0.0, 0.3, 1.0], coefficients=[[[7.0], [8.0]]])
    both = stack(first, second)
    assert both.segments == 2
    np.testing.assert_array_equal(both([0.2, 0.4]), [[1.0, 2.0], [7.0, 8.0]])
    assert merged_breakpoints(first, second).size == 3


def test_a_scipy_spline_passes_unchanged() -> None:
    t = np.linspace(0.0, 3.0, 20)
    scalar, vector = CubicSpline(t, np.sin(t)), CubicSpline(t, np.c_[np.sin(t), np.cos(t)])
    x = np.linspace(0.0, 3.0, 301)
    # Values of size 1: rounding only.
    np.testing.assert_allclose(from_ppoly(scalar)(x), [scalar(x)], atol=1e-14)
    np.testing.assert_allclose(from_ppoly(vector)(x), vector(x).T, atol=1e-14)
    exact = [1.0 - np.cos(3.0), np.sin(3.0)]
    # The spline itself differs from sine and cosine by about h⁴/384 ~ 1e-6.
    np.testing.assert_allclose(from_ppoly(vector).mean(), np.divide(exact, 3.0), atol=1e-5)


def test_restriction_keeps_the_function() -> None:
    signal = random_signal(np.random.default_rng(3), 3, 4.0)
    part = signal.restricted(0.7, 3.1)
    assert (part.start, part.end) == (0.7, 3.1)
    t = np.linspace(0.7, 3.1, 100)
    np.testing.assert_allclose(part(t), signal(t), rtol=1e-10, atol=1e-10)  # Taylor shift


def test_quintic_hermite_reproduces_a_quintic_and_converges_with_the_sixth_power() -> None:
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.25])
    nodes = np.array([0.0, 0.4, 1.1, 2.0])
    rates = [[polynomial.deriv(order)(nodes)] for order in (1, 2)]
    signal = quintic_hermite(nodes, [polynomial(nodes)], *rates)
    t = np.linspace(0.0, 2.0, 101)
    np.testing.assert_allclose(signal(t)[0], polynomial(t), rtol=1e-12, atol=1e-12)  # rounding

    def error(h: float) -> float:
        nodes = np.arange(0.0, 2.0 + h / 2, h)
        sine = quintic_hermite(
            nodes, np.sin(9 * nodes), 9 * np.cos(9 * nodes), -81 * np.sin(9 * nodes)
        )
        x = np.linspace(0.0, 2.0, 4001)
        return float(np.abs(sine(x)[0] - np.sin(9 * x)).max())

    # h⁶ · 9⁶ / 46080 is the leading term; halving h must gain nearly 64.
    assert error(0.1) == pytest.approx(0.1**6 * 9**6 / 46080, rel=0.1)
    assert 50.0 < error(0.1) / error(0.05) < 70.0


def test_extremes_include_the_inside_of_segments_and_jumps() -> None:
    parabola = PiecewisePolynomial(
        breakpoints=[0.0, 2.0, 3.0], coefficients=[[[0.0, 2.0, -1.0], [-4.0, 0.0, 0.0]]]
    )
    assert parabola.largest_magnitude()[0] == 4.0
    assert parabola.peak_to_peak()[0] == 5.0  # 1 at t = 1, −4 after the jump


@pytest.mark.parametrize(
    ("breakpoints", "coefficients"),
    [
        ([0.0, 1.0], [[[1.0], [2.0]]]),
        ([0.0, 1.0, 1.0], [[[1.0], [2.0]]]),
        ([0.0, np.nan], [[[1.0]]]),
        ([0.0, 1.0], [[[np.inf]]]),
        ([0.0], np.zeros((1, 0, 1))),
        ([0.0, 1.0], np.zeros((0, 1, 1))),
    ],
)
def test_bad_pieces_are_refused(breakpoints: list[float], coefficients: list[float]) -> None:
    with pytest.raises(ParameterError):
        PiecewisePolynomial(breakpoints=breakpoints, coefficients=coefficients)


def test_use_outside_the_domain_is_refused() -> None:
    signal = PiecewisePolynomial(breakpoints=[0.0, 0.5, 1.0], coefficients=[[[1.0], [2.0]]])
    other = PiecewisePolynomial(breakpoints=[0.0, 2.0], coefficients=[[[1.0]]])
    for wrong in (-0.01, 1.01, np.nan):
        with pytest.raises(ParameterError, match="time"):
            signal([wrong])
    with pytest.raises(ParameterError, match="same time"):
        stack(signal, other)
    with pytest.raises(ParameterError, match="every old breakpoint"):
        signal.on_breakpoints([0.0, 0.4, 1.0])
    with pytest.raises(ParameterError):
        signal.restricted(0.5, 1.5)
    with pytest.raises(ValueError, match="read-only"):
        signal.coefficients[0, 0, 0] = 9.0
