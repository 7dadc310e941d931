"""Least largest of several errors under constraints, with few evaluations.

The largest of several errors has kinks where another one takes over, and the best point usually
lies on one or on a constraint. Written with a bound t, "t least with every error <= t", all
functions are smooth again, and linear models of them meet at that corner: Powell's COBYLA, which
needs no derivatives, then takes some thirty evaluations where a simplex of the largest error stalls
on the constraint. Errors enter by their logarithms, so that the models hold over decades.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from mrac_design.arrays import FloatArray

Evaluation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Position in the unit cube → (logarithms of the errors, slacks: >= 0 where a constraint holds)."""

FIRST_STEP = 0.15
"""First step of the search in the unit cube: wide enough to leave a start next to a border."""
LAST_STEP = 1e-4
"""Step at which a search ends: about the spacing of values with three significant digits."""


class SearchEnd(Exception):  # noqa: N818  it ends a search, nothing went wrong
    """Raised by an evaluation to end the search."""


def least_largest(evaluate: Evaluation, starts: Iterable[FloatArray]) -> None:
    """Search from every start in turn until `evaluate` raises SearchEnd or none is left.

    `evaluate` remembers what it needs; nothing is returned.
    """
    try:
        for start in starts:
            _descend(evaluate, start)
    except SearchEnd:
        return


def scattered(dimensions: int, *, count: int, seed: int) -> FloatArray:
    """`count` points spread evenly in the unit cube, after its corners, (2^d + count, d)."""
    from scipy.stats import qmc

    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * dimensions)).reshape(dimensions, -1).T
    exponent = int(np.ceil(np.log2(count)))
    spread = qmc.Sobol(dimensions, seed=seed).random_base2(exponent)[:count]
    points: FloatArray = np.vstack([corners, spread])
    return points


def _descend(evaluate: Evaluation, start: FloatArray) -> None:
    from scipy.optimize import minimize

    def slacks(x: FloatArray) -> FloatArray:
        position = np.clip(x[:-1], 0.0, 1.0)
        errors, room = evaluate(position)
        return np.concatenate([x[-1] - errors, room, x[:-1], 1.0 - x[:-1]])

    errors, _ = evaluate(start)
    minimize(
        lambda x: float(x[-1]),
        np.append(start, errors.max()),
        method="COBYLA",
        constraints={"type": "ineq", "fun": slacks},
        options={"rhobeg": FIRST_STEP, "tol": LAST_STEP, "maxiter": 1000},
    )
