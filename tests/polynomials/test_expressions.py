from __future__ import annotations

import pytest
from flint import fmpq

from mrac_design.errors import ParameterError
from mrac_design.polynomials import (
    DiophantineEquation,
    exact_polynomial,
    solve_diophantine_exact,
)
from mrac_design.polynomials.expressions import Letter, solve_symbolic, symbols

LETTERS = tuple(Letter(name=name, latex=f"{name}_0") for name in "abcdef")
VALUES = {"a": 2, "b": 3, "c": "1/2", "d": 5, "e": -7, "f": "0.3"}


def test_arithmetic_reduces_and_evaluates():
    a, b, *_ = symbols(LETTERS)
    ratio = (a * a - b * b) / (a + b)
    assert ratio == a - b
    assert ratio.denominator.is_one()
    assert ratio.at(VALUES) == -1
    assert (ratio - a + b).is_zero
    assert ((a + 1) / (2 * b)).at(VALUES) == fmpq(1, 2)


def test_derivative_is_the_limit_of_exact_quotients():
    a, b, c, *_ = symbols(LETTERS)
    expression = (a * a * c + b) / (c - a)
    step = fmpq(1, 10**12)
    shifted = expression.at({**VALUES, "c": fmpq(1, 2) + step})
    quotient = (shifted - expression.at(VALUES)) / step
    # The quotient's error is step/2 times the second derivative, below 10 here.
    assert abs(quotient - expression.derivative("c").at(VALUES)) < fmpq(1, 10**11)


def test_latex_of_an_expression():
    a, b, *_ = symbols(LETTERS)
    assert ((a * a - b / 3) / b)._repr_latex_() == r"$\frac{a_0^{2}-\tfrac{1}{3} b_0}{b_0}$"
    assert (a - a).latex() == "0"


def test_misuse_is_refused():
    a, b, *_ = symbols(LETTERS)
    with pytest.raises(ParameterError, match="b, c"):
        a.at({"a": 1})
    with pytest.raises(ParameterError, match="vanishes"):
        (a / b).at({**VALUES, "b": 0})
    with pytest.raises(ParameterError, match="letter = z"):
        a.derivative("z")
    with pytest.raises(ZeroDivisionError):
        a / (b - b)


def test_symbolic_solution_of_a_general_second_order_process():
    """(p² + a p + b) X + (c p + d) Y = (p + e)(p² + f p + 1) against the numeric solver."""
    a, b, c, d, e, f = symbols(LETTERS)
    one = a.constant(1)
    target = [one, e + f, one + e * f, e]
    X, Y = solve_symbolic([one, a, b], [c, d], target)
    values = [symbol.at(VALUES) for symbol in (a, b, c, d, e, f)]
    A = exact_polynomial([1, values[0], values[1]])
    B = exact_polynomial(values[2:4])
    C = exact_polynomial([1, values[4]]) * exact_polynomial([1, values[5], 1])
    numeric = solve_diophantine_exact(DiophantineEquation(A=A, B=B, C=C))
    assert exact_polynomial([x.at(VALUES) for x in X]) == numeric.X
    assert exact_polynomial([y.at(VALUES) for y in Y]) == numeric.Y


def test_factor_common_for_all_values_is_refused():
    a, b, *_ = symbols(LETTERS)
    one = a.constant(1)
    with pytest.raises(ParameterError, match="for all values"):
        solve_symbolic([one, a + b, a * b], [one, a], [one, one])
