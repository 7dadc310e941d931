"""Explicit Runge–Kutta methods as values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContinuousExtension:
    """The solution between the ends of a step, from some more evaluations.

    x(θ) = x + h Σ_i k_i Σ_d weights[i, d] θ^(d+1), 0 ≤ θ ≤ 1; the first evaluation beyond the
    method's own is at the end of the step.
    """

    a: FloatArray
    """Stage weights of the evaluations after that, shape (more, stages + 1 + more)."""
    c: FloatArray
    """Their instants as fractions of the step, shape (more,)."""
    weights: FloatArray
    """Shape (stages + 1 + more, degree)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", readonly(self.c, (-1,)))
        object.__setattr__(self, "a", readonly(self.a, (self.c.size, -1)))
        object.__setattr__(self, "weights", readonly(self.weights, (self.a.shape[1], -1)))
        # A constant slope gives a straight line.
        line = self.weights.sum(axis=0)
        assert np.abs(line - np.eye(line.size)[0]).max() < 1e-11, line


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ButcherTableau:
    """Coefficients of an explicit Runge–Kutta method; consistency is checked on construction."""

    name: str
    """Name shown to people."""
    order: int
    """Order of the global error in the step."""
    a: FloatArray
    """Stage weights, strictly lower triangular, shape (stages, stages)."""
    b: FloatArray
    """Weights of the step, shape (stages,)."""

    extension: ContinuousExtension | None = None
    """What gives the solution inside a step, for methods with steps longer than a record."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "b", readonly(self.b, (-1,)))
        object.__setattr__(self, "a", readonly(self.a, (self.stages, self.stages)))
        assert not np.triu(self.a).any(), "an explicit method is strictly lower triangular"
        # The quadrature conditions: b integrates polynomials of degree < order exactly.
        for power in range(self.order):
            assert abs(self.b @ self.c**power - 1 / (power + 1)) < 1e-13, (self.name, power)

    @property
    def stages(self) -> int:
        """Number of evaluations of the right-hand side in a step."""
        return int(self.b.size)

    @property
    def c(self) -> FloatArray:
        """Instants of the stages as fractions of the step (row sums of a), shape (stages,)."""
        return readonly(self.a.sum(axis=1))


RK4 = ButcherTableau(
    name="classical Runge–Kutta",
    order=4,
    a=np.array([[0, 0, 0, 0], [1 / 2, 0, 0, 0], [0, 1 / 2, 0, 0], [0, 0, 1, 0]]),
    b=np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]),
)

DORMAND_PRINCE_5 = ButcherTableau(
    name="Dormand–Prince",
    order=5,
    a=np.array(
        [
            [0, 0, 0, 0, 0, 0],
            [1 / 5, 0, 0, 0, 0, 0],
            [3 / 40, 9 / 40, 0, 0, 0, 0],
            [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        ]
    ),
    b=np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
)
