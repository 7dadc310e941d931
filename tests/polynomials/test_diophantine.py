from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mrac_design.errors import IllConditionedError, NotCoprimeError, ParameterError
from mrac_design.polynomials import (
    DiophantineEquation,
    SylvesterSystem,
    coefficients,
    exact_polynomial,
    solve_diophantine,
    solve_diophantine_exact,
)
from mrac_design.polynomials.diophantine import require_coprime
from tests.oracles import diophantine_rational as oracle

small = st.integers(min_value=-9, max_value=9)


def monic(least, most):
    return st.lists(small, min_size=least, max_size=most).map(lambda tail: [1, *tail])


def to_fractions(polynomial: fmpq_poly) -> list[Fraction]:
    return [Fraction(int(value.p), int(value.q)) for value in polynomial.coeffs()[::-1]]


@settings(max_examples=60, deadline=None)
@given(A=monic(1, 4), B=monic(0, 3), C=monic(0, 8), gain=st.sampled_from([1, -3, 7]))
def test_exact_solution_agrees_with_gaussian_elimination_in_fractions(A, B, C, gain):
    B = [gain * value for value in B]
    expected = oracle.solve(*(oracle.fractions(part) for part in (A, B, C)))
    exact = [exact_polynomial(part) for part in (A, B, C)]
    if expected is None:
        with pytest.raises(NotCoprimeError):
            DiophantineEquation(A=exact[0], B=exact[1], C=exact[2])
        return
    equation = DiophantineEquation(A=exact[0], B=exact[1], C=exact[2])
    solution = solve_diophantine_exact(equation)
    assert to_fractions(solution.X) == oracle.trimmed(expected[0])
    assert to_fractions(solution.Y) == oracle.trimmed(expected[1])
    assert solution.remainder.is_zero()


@settings(max_examples=40, deadline=None)
@given(A=monic(1, 4), B=monic(0, 3), C=monic(1, 7))
def test_floating_solution_is_the_exact_one(A, B, C):
    A, B, C = (exact_polynomial(part) for part in (A, B, C))
    assume(A.gcd(B).degree() == 0)
    equation = DiophantineEquation(A=A, B=B, C=C)
    exact = solve_diophantine_exact(equation)
    system = SylvesterSystem.of(equation)
    floating = solve_diophantine(system, residual_limit=np.inf)
    found = np.concatenate([floating.X, floating.Y])
    wanted = np.concatenate(
        [coefficients(exact.X, len(floating.X)), coefficients(exact.Y, len(floating.Y))]
    )
    # Without refinement the error would be near the rounding unit times the condition number.
    allowed = np.finfo(float).eps * np.linalg.cond(np.array(system.matrix, dtype=float))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=allowed * np.abs(wanted).max())


def test_the_equations_are_those_of_comparing_coefficients():
    equation = DiophantineEquation(
        A=exact_polynomial([1, 50, 0]), B=exact_polynomial(800), C=exact_polynomial([1, 2, 3, 4])
    )
    system = SylvesterSystem.of(equation)
    np.testing.assert_array_equal(
        system.matrix, [[1, 0, 0, 0], [50, 1, 0, 0], [0, 50, 800, 0], [0, 0, 0, 800]]
    )
    np.testing.assert_array_equal(system.right_side, [1, 2, 3, 4])
    assert r"\begin{pmatrix}" in system._repr_latex_()
    assert "800" in equation._repr_latex_()


def test_common_roots_are_named():
    A = exact_polynomial([1, 3]) * exact_polynomial([1, 2, 5])
    B = exact_polynomial([1, 2, 5]) * exact_polynomial([4, 4])
    with pytest.raises(NotCoprimeError, match=r"-1-2j, -1\+2j") as caught:
        DiophantineEquation(A=A, B=B, C=exact_polynomial([1, 1]))
    np.testing.assert_allclose(caught.value.common_roots, [-1 - 2j, -1 + 2j], rtol=1e-15)


@pytest.mark.parametrize("distance", [1e-16, 1e-14, 1e-13])
def test_roots_closer_than_floats_can_tell_are_common(distance):
    A = exact_polynomial([1, 1]) * exact_polynomial([1, 30])
    B = exact_polynomial([1, fmpq(1) + fmpq(*distance.as_integer_ratio())])
    DiophantineEquation(A=A, B=B, C=A)  # exactly coprime
    with pytest.raises(NotCoprimeError) as caught:
        require_coprime(A, B)
    assert caught.value.common_roots[0] == pytest.approx(-1.0)
    with pytest.raises(NotCoprimeError):
        solve_diophantine(SylvesterSystem.of(DiophantineEquation(A=A, B=B, C=A)))


def test_roots_a_millionth_apart_are_solved_or_judged():
    A = exact_polynomial([1, 1]) * exact_polynomial([1, 30])
    B = exact_polynomial([1, "1.000001"])
    equation = DiophantineEquation(A=A, B=B, C=exact_polynomial([1, 6]) ** 3)
    solution = solve_diophantine(SylvesterSystem.of(equation), residual_limit=1e-8)
    assert 1e-8 < solution.coprimeness < 1e-5
    assert solution.condition > 1e5
    with pytest.raises(IllConditionedError, match="cancel") as caught:
        solve_diophantine(SylvesterSystem.of(equation), residual_limit=1e-13)
    assert caught.value.residual == solution.residual
    # The reason given has to account for the size of the residual.
    assert caught.value.cancellation * 1.2e-16 > 0.1 * caught.value.residual


def test_coprimeness_bounds_the_distance_to_a_common_factor():
    """Moving B's root onto A's is a change of the coefficients, so it cannot be below the bound."""
    A, B = exact_polynomial([1, 1]), exact_polynomial([1, 2])
    solution = solve_diophantine(
        SylvesterSystem.of(DiophantineEquation(A=A, B=B, C=exact_polynomial([1, 3, 3])))
    )
    moved = np.array([1.0, 1.0])
    change = np.linalg.norm(moved - [1.0, 2.0]) / np.linalg.norm([1.0, 2.0])
    assert 0.05 < solution.coprimeness / np.sqrt(2.0) <= change


@pytest.mark.parametrize(("A", "B", "C"), [([5], [1], [1]), ([1, 2], [0], [1]), ([1, 2], [1], [0])])
def test_degenerate_equations_are_refused(A, B, C):
    with pytest.raises(ParameterError):
        DiophantineEquation(A=exact_polynomial(A), B=exact_polynomial(B), C=exact_polynomial(C))
