"""Straight-line solutions of small systems against NumPy."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.robot.linear_algebra import (
    StructurallySingularError,
    solve_square,
    solve_symmetric,
)
from tests.robot.conftest import array

EPS = np.finfo(float).eps


def evaluate(solver: object, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve with symbols where the matrix is not zero, so that the zeros are structural."""
    A = ca.SX.sym("A", ca.DM(matrix).sparsity() if matrix.all() else ca.sparsify(matrix).sparsity())
    B = ca.SX.sym("B", *right.shape)
    function = ca.Function("solve", [A, B], [solver(ca.densify(A), B)])
    return function(matrix, right).full()


@settings(max_examples=40, deadline=None)
@given(n=st.integers(1, 6), decades=st.floats(0, 6), seed=st.integers(0, 10**6))
def test_symmetric_positive_definite(n: int, decades: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    matrix = (Q * np.logspace(0, -decades, n)) @ Q.T
    matrix = (matrix + matrix.T) / 2
    right = rng.normal(size=(n, 2))
    x = evaluate(solve_symmetric, matrix, right)
    # Backward stable: the residual is rounding of |A||x|, whatever the condition number.
    residual = np.abs(matrix @ x - right)
    assert residual.max() <= 20 * n * EPS * (np.abs(matrix).max() * np.abs(x).max() + 1)


@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 6), decades=st.floats(0, 6), seed=st.integers(0, 10**6))
def test_general_dense(n: int, decades: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    U, _ = np.linalg.qr(rng.normal(size=(n, n)))
    V, _ = np.linalg.qr(rng.normal(size=(n, n)))
    matrix = (U * np.logspace(0, -decades, n)) @ V
    expected = rng.normal(size=(n, 2))
    x = evaluate(solve_square, matrix, matrix @ expected)
    # Forward error: rounding times the condition number.
    assert np.abs(x - expected).max() <= 100 * EPS * 10**decades * np.abs(expected).max()


@settings(max_examples=60, deadline=None)
@given(n=st.integers(2, 6), density=st.floats(0.1, 0.6), seed=st.integers(0, 10**6))
def test_general_with_structural_zeros(n: int, density: float, seed: int) -> None:
    """Zero patterns fall apart into blocks; a permuted diagonal keeps the matrix regular."""
    rng = np.random.default_rng(seed)
    matrix = np.where(rng.random((n, n)) < density, rng.normal(size=(n, n)), 0.0)
    matrix[rng.permutation(n), np.arange(n)] += 3.0
    condition = np.linalg.cond(matrix)
    expected = rng.normal(size=(n, 1))
    x = evaluate(solve_square, matrix, matrix @ expected)
    assert np.abs(x - expected).max() <= 1e-13 * condition * np.abs(expected).max()


def test_leading_zero_needs_no_pivoting() -> None:
    matrix = np.array([[0.0, 2.0, 1.0], [1.0, 0.0, 3.0], [2.0, 1.0, 0.0]])
    A = ca.SX.sym("A", 3, 3)
    B = ca.SX.sym("B", 3)
    function = ca.Function("solve", [A, B], [solve_square(A, B)])
    np.testing.assert_allclose(array(function(matrix, matrix @ [1, 2, 3])), [1, 2, 3], rtol=1e-14)


def test_structurally_singular_is_refused() -> None:
    A = ca.SX.sym("A", 3, 3)
    A[:, 1] = 0
    with pytest.raises(StructurallySingularError, match="structurally singular"):
        solve_square(A, ca.SX.sym("B", 3))
