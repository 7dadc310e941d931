"""Candidates for Lyapunov matrices from a semidefinite program; never a proof.

What comes back is rounded and judged in exact arithmetic elsewhere, so a wrong or inaccurate
answer of the solver can cost a certificate but cannot forge one.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import CertificateError

Blocks = Callable[[FloatArray, float], Sequence[FloatArray]]
"""(P, scalar) -> blocks, jointly affine in both, that should be positive semidefinite."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """A candidate Lyapunov matrix."""

    P: FloatArray
    """Symmetric (n, n)."""
    scalar: float
    """The margin reached, or the squared gain minimised."""


def widest_margin(blocks: Blocks, size: int, *, scalar: float = 0.0) -> Candidate | None:
    """P that keeps every block >= t I with the largest t, up to trace P = n where nothing else
    fixes its size; None when the solver finds no t > 0.

    `scalar` is handed to `blocks` unchanged.
    """
    cp = _modelling()

    table = _coefficients(lambda P, _: blocks(P, scalar), size)
    x, t = cp.Variable(_unknowns(size)), cp.Variable()
    diagonal = [k for k, (i, j) in enumerate(_places(size)) if i == j]
    constraints = [
        cp.reshape(slope[:, :-1] @ x + constant, (m, m), order="C") >> t * np.eye(m)
        for m, slope, constant in table
    ]
    homogeneous = all(not constant.any() for _, _, constant in table)
    constraints += [cp.sum(x[diagonal]) == size] if homogeneous else [t <= 1]
    if not _solved(cp.Problem(cp.Maximize(t), constraints)) or t.value is None or t.value <= 0:
        return None
    return Candidate(P=_matrix(x.value, size), scalar=float(t.value))


def least_scalar(blocks: Blocks, size: int) -> Candidate | None:
    """P and the least scalar that keep every block >= 0; None when the solver fails."""
    cp = _modelling()

    table = _coefficients(blocks, size)
    x = cp.Variable(_unknowns(size) + 1)
    constraints = [
        cp.reshape(slope @ x + constant, (m, m), order="C") >> 0 for m, slope, constant in table
    ]
    if not _solved(cp.Problem(cp.Minimize(x[-1]), constraints)):
        return None
    return Candidate(P=_matrix(x.value[:-1], size), scalar=float(x.value[-1]))


def _modelling() -> Any:
    """cvxpy, loaded on first use: it is slow to load and only searching needs it."""
    try:
        return importlib.import_module("cvxpy")
    except ModuleNotFoundError as error:
        raise CertificateError("the search needs cvxpy and Clarabel (extra 'certify')") from error


def _solved(problem: Any) -> bool:
    """Run Clarabel; its failures and its infeasibility are the same to us."""
    cp = _modelling()

    try:
        with warnings.catch_warnings():
            # An inaccurate answer is welcome: what it is worth is decided exactly later.
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return False
    return problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)


def _coefficients(blocks: Blocks, size: int) -> list[tuple[int, FloatArray, FloatArray]]:
    """(m, slopes (m², unknowns + 1), constant (m²,)) of every distinct block, by evaluation on a
    basis."""
    zero = np.zeros((size, size))
    constant = [np.asarray(block, float) for block in blocks(zero, 0.0)]
    columns = []
    for i, j in _places(size):
        basis = zero.copy()
        basis[i, j] = basis[j, i] = 1.0
        columns.append(blocks(basis, 0.0))
    columns.append(blocks(zero, 1.0))
    table = {}
    for k, base in enumerate(constant):
        slopes = np.stack([(column[k] - base).ravel() for column in columns], axis=1)
        # Corners that differ in nothing a block depends on give the same block.
        table[slopes.tobytes(), base.tobytes()] = (base.shape[0], slopes, base.ravel())
    return list(table.values())


def _places(size: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(size) for j in range(i, size)]


def _unknowns(size: int) -> int:
    return size * (size + 1) // 2


def _matrix(values: FloatArray, size: int) -> FloatArray:
    P = np.zeros((size, size))
    for value, (i, j) in zip(values, _places(size), strict=True):
        P[i, j] = P[j, i] = value
    return P
