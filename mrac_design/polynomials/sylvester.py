"""The Sylvester matrix of two polynomials, scaled so that floating arithmetic can use it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpq_poly

from mrac_design.arrays import FloatArray, readonly
from mrac_design.polynomials.rationals import coefficients, nearest_float, roots

EQUILIBRATIONS = 6
"""Sweeps of row and column scaling; the entries settle within a factor of two sooner."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SylvesterMatrix:
    """Matrix of (X, Y) ↦ A X + B Y, with time scaled and rows and columns equilibrated.

    All scale factors are powers of two, so that scaling rounds nothing.
    """

    frequency: float
    """Unit of the operator: p = frequency · p̂."""

    equilibrated: FloatArray
    """Matrix in p̂ with entries of size one, (N, N)."""

    row_scale: FloatArray
    """Factors by which the rows of the unscaled matrix were multiplied, (N,)."""

    column_scale: FloatArray
    """Factors by which the columns of the unscaled matrix were multiplied, (N,)."""

    degree_X: int
    """Degree of X; its deg X + 1 coefficients come first."""

    @staticmethod
    def of(A: fmpq_poly, B: fmpq_poly, degree_X: int, degree_Y: int) -> SylvesterMatrix:
        """Matrix for unknowns of the given degrees; it must come out square."""
        frequency = natural_frequency(A, B)
        scaled = _toeplitz(A, B, degree_X, degree_Y, frequency)
        powers = np.concatenate([np.arange(degree_X, -1, -1), np.arange(degree_Y, -1, -1)])
        rows = np.ones(len(scaled))
        columns = np.ones(scaled.shape[1])
        for _ in range(EQUILIBRATIONS):
            size = np.abs(scaled * rows[:, None] * columns)
            rows /= _power_of_two(np.sqrt(size.max(axis=1)))
            columns /= _power_of_two(np.sqrt(size.max(axis=0)))
        ascending = np.arange(len(scaled))[::-1]
        return SylvesterMatrix(
            frequency=frequency,
            equilibrated=readonly(scaled * rows[:, None] * columns),
            row_scale=readonly(rows * frequency**ascending),
            column_scale=readonly(columns / frequency**powers),
            degree_X=degree_X,
        )

    @property
    def size(self) -> int:
        """Number of equations N."""
        return len(self.equilibrated)

    def unscaled(self) -> FloatArray:
        """The matrix in the given unit of time."""
        return readonly(self.equilibrated / self.row_scale[:, None] / self.column_scale)

    def solve(self, right_side: FloatArray) -> FloatArray:
        """Coefficients (X, Y) for the coefficients of a right-hand side, (N,)."""
        solution = np.linalg.solve(self.equilibrated, right_side * self.row_scale)
        return readonly(solution * self.column_scale)

    def split(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """X and Y of their joined coefficients."""
        return readonly(vector[: self.degree_X + 1]), readonly(vector[self.degree_X + 1 :])

    @property
    def condition(self) -> float:
        """Bauer–Skeel condition number, the spectral radius of |M⁻¹||M|; inf when singular.

        It does not depend on the scaling of rows and columns. A matrix that a componentwise
        relative change ε makes singular has at least condition 1/ε.
        """
        try:
            inverse = np.linalg.inv(self.equilibrated)
        except np.linalg.LinAlgError:
            return math.inf
        product = np.abs(inverse) @ np.abs(self.equilibrated)
        return float(np.abs(np.linalg.eigvals(product)).max())


def natural_frequency(A: fmpq_poly, B: fmpq_poly) -> float:
    """Power of two nearest the geometric mean of the non-zero roots of A and B together."""
    exponent = 0.0
    count = 0
    for polynomial in (A, B):
        values = [nearest_float(value) for value in polynomial.coeffs()]
        lowest = next(power for power, value in enumerate(values) if value != 0.0)
        exponent += math.log2(abs(values[lowest])) - math.log2(abs(values[-1]))
        count += len(values) - 1 - lowest
    return 2.0 ** round(exponent / count) if count else 1.0


def coprimeness(A: fmpq_poly, B: fmpq_poly, frequency: float) -> float:
    """Smallest singular value of the Sylvester matrix of A and B, both scaled to unit norm."""
    if B.degree() == 0:
        return 1.0
    unit_A, unit_B = (_scaled(polynomial, frequency) for polynomial in (A, B))
    unit_A, unit_B = unit_A / np.linalg.norm(unit_A), unit_B / np.linalg.norm(unit_B)
    matrix = _banded(unit_A, B.degree(), A.degree() + B.degree())
    matrix = np.hstack([matrix, _banded(unit_B, A.degree(), A.degree() + B.degree())])
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


def closest_roots(A: fmpq_poly, B: fmpq_poly) -> list[complex]:
    """Roots of A that lie within a thousandth of a root of B, at least the closest one."""
    of_A, of_B = roots(A)[:, None], roots(B)[None, :]
    if not of_B.size:
        return []
    size = np.maximum(np.maximum(np.abs(of_A), np.abs(of_B)), np.finfo(float).tiny)
    distance = (np.abs(of_A - of_B) / size).min(axis=1)
    return [complex(root) for root in of_A[distance <= max(1e-3, distance.min()), 0]]


def _toeplitz(
    A: fmpq_poly, B: fmpq_poly, degree_X: int, degree_Y: int, frequency: float
) -> FloatArray:
    size = degree_X + degree_Y + 2
    of_X = _banded(_scaled(A, frequency), degree_X + 1, size)
    return np.hstack([of_X, _banded(_scaled(B, frequency), degree_Y + 1, size)])


def _banded(polynomial: FloatArray, columns: int, rows: int) -> FloatArray:
    """Convolution with a polynomial: column j holds it shifted to end in row rows − columns + j."""
    matrix = np.zeros((rows, columns))
    first = rows - columns - len(polynomial) + 1
    for column in range(columns):
        matrix[first + column : first + column + len(polynomial), column] = polynomial
    return matrix


def _scaled(polynomial: fmpq_poly, frequency: float) -> FloatArray:
    """Coefficients in p̂, rounded once."""
    unit = fmpq(*frequency.as_integer_ratio())
    return coefficients(polynomial(fmpq_poly([fmpq(0), unit])))


def _power_of_two(values: FloatArray) -> FloatArray:
    return np.exp2(np.round(np.log2(np.where(values > 0.0, values, 1.0))))
