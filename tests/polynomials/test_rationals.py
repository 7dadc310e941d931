from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import (
    binary_rational,
    coefficients,
    decimal_rational,
    dyadic_factor,
    exact_polynomial,
    nearest_float,
    polynomial_latex,
    roots,
)

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite)
def test_both_readings_of_a_float_round_back_to_it(value):
    assert nearest_float(decimal_rational(value)) == value
    assert nearest_float(binary_rational(value)) == value


def test_decimal_reading_is_what_was_typed():
    assert decimal_rational(0.7) == fmpq(7, 10)
    assert decimal_rational("2/3") == fmpq(2, 3)
    assert decimal_rational(np.float64(1e-3)) == fmpq(1, 1000)
    assert decimal_rational(np.int64(5)) == fmpq(5)
    assert decimal_rational(Fraction(5, 7)) == fmpq(5, 7)
    assert binary_rational(0.7) != fmpq(7, 10)


@pytest.mark.parametrize("value", [math.nan, math.inf, "abc", "1/0", None, 1j, [1.0]])
def test_what_is_not_a_real_number_is_refused(value):
    with pytest.raises(ParameterError, match="finite real number"):
        decimal_rational(value)


def test_coefficients_come_highest_power_first():
    polynomial = exact_polynomial([1, "0.5", 0])
    assert polynomial == fmpq_poly([0, fmpq(1, 2), 1])
    np.testing.assert_array_equal(coefficients(polynomial), [1.0, 0.5, 0.0])
    np.testing.assert_array_equal(coefficients(polynomial, 5), [0.0, 0.0, 1.0, 0.5, 0.0])
    np.testing.assert_array_equal(coefficients(fmpq_poly([0])), [0.0])
    assert exact_polynomial(3) == fmpq_poly([3])


def test_multiple_roots_come_out_equal_and_exact():
    found = roots(exact_polynomial([1, 500]) ** 3 * exact_polynomial([1, 2, 5]))
    # Floating companion-matrix roots would be off by about 1e-5 relative here.
    np.testing.assert_array_equal(found[2:], [-500.0] * 3)
    np.testing.assert_allclose(found[:2], [-1 - 2j, -1 + 2j], rtol=1e-15)


def test_zero_polynomial_has_no_roots():
    with pytest.raises(ParameterError):
        roots(fmpq_poly([0]))


def test_dyadic_factor_divides_to_its_precision():
    polynomial = exact_polynomial([1, 3, 1])  # roots −0.38 and −2.6, irrational
    factor = dyadic_factor(polynomial, np.abs(roots(polynomial)) < 1.0)
    remainder = polynomial % factor
    assert factor.degree() == 1
    assert factor[1] == 1
    # 128 bits are 38 digits.
    assert abs(nearest_float(remainder[0])) < 1e-36


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([1, -2, 0], "p^{2} - 2\\,p"),
        ([-1, 0], "-p"),
        (["-1/3"], "-\\tfrac{1}{3}"),
        ([0], "0"),
        (["3/2", 1], "\\tfrac{3}{2}\\,p + 1"),
    ],
)
def test_latex_of_exact_polynomials(values, text):
    assert polynomial_latex(exact_polynomial(values), "p") == text


def test_latex_of_floating_polynomials():
    assert polynomial_latex([0.0, 1.0, -1.25e8], "p") == "p - 1.25\\cdot 10^{8}"
