"""Coordinates in which a loop's numbers are of like size, so that a solver keeps its digits.

A slow observer beside a fast reference model spreads the entries of the state over decades, and
a Lyapunov matrix over twice as many. With x = 2^e L⁻ᵀ z the solver sees a matrix P_z near the
identity; P = 2^−e L P_z Lᵀ 2^−e is what is rounded and judged.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq
from scipy.linalg import matrix_balance

from mrac_design.arrays import FloatArray, readonly
from mrac_design.stability.adaptive_loop import ExactArray
from mrac_design.stability.exact_matrix import rounded_symmetric, to_floats
from mrac_design.stability.inequalities import Corner

ROUNDING_BITS = 48
"""Binary places a Lyapunov matrix keeps below its largest entry, entries scaled by 2^e."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coordinates:
    """z with x = 2^e L⁻ᵀ z."""

    exponents: tuple[int, ...]
    """e, one a state."""
    factor: FloatArray
    """L, lower triangular, (N, N)."""

    @property
    def _sizes(self) -> FloatArray:
        return np.ldexp(1.0, np.array(self.exponents))

    def corners(self, corners: Iterable[Corner]) -> tuple[Corner, ...]:
        """Floating corners in z."""
        forth = self.factor.T / self._sizes
        back = np.linalg.inv(forth)
        return tuple(
            Corner(
                A=forth @ corner.A @ back,
                disturbances=tuple(forth @ column for column in corner.disturbances),
                energy_input=forth @ corner.energy_input,
                force=tuple(row @ back for row in corner.force),
                linearised_command=corner.linearised_command @ back,
            )
            for corner in corners
        )

    def form(self, P: FloatArray) -> ExactArray:
        """The quadratic form zᵀPz as an exact one in x, rounded."""
        size = np.array([fmpq(2) ** -e for e in self.exponents], dtype=object)
        rounded = rounded_symmetric(self.factor @ P @ self.factor.T, ROUNDING_BITS)
        result: ExactArray = rounded * size * size[:, None]
        return result

    def fitted(self, P: ExactArray) -> Coordinates:
        """Coordinates in which a positive definite form xᵀPx is |z|², to rounding."""
        sizes = self._sizes
        factor = np.linalg.cholesky(to_floats(P) * sizes * sizes[:, None])
        return Coordinates(exponents=self.exponents, factor=readonly(factor))


def balanced(matrices: Sequence[FloatArray]) -> Coordinates:
    """Coordinates with L = 1 that suit the mean of some state matrices (Parlett & Reinsch 1969)."""
    mean = np.mean(matrices, axis=0)
    _, (scale, _) = matrix_balance(mean, permute=False, separate=True)
    return Coordinates(
        exponents=tuple(int(e) for e in np.frexp(scale)[1] - 1),
        factor=readonly(np.eye(len(mean))),
    )
