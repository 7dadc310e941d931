"""Symmetric matrices over the rationals: definiteness by an exact LDLᵀ factorisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray


def ldl_pivots(matrix: fmpq_mat | NDArray[np.object_]) -> tuple[fmpq, ...]:
    """Diagonal of D in M = L D Lᵀ, ending with the first pivot that is not positive.

    Raises ValueError when the matrix is not symmetric.
    """
    rows = matrix.tolist()
    if any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)):
        raise ValueError("an LDLᵀ factorisation needs a symmetric matrix")
    pivots: list[fmpq] = []
    while rows:
        pivot = rows[0][0]
        pivots.append(pivot)
        if pivot <= 0:
            break
        top = rows[0]
        rows = [
            [entry - row[0] * top[j] / pivot for j, entry in enumerate(row) if j]
            for row in rows[1:]
        ]
    return tuple(pivots)


def is_positive_definite(matrix: fmpq_mat | NDArray[np.object_]) -> bool:
    """Whether a symmetric rational matrix is positive definite, exactly."""
    return all(pivot > 0 for pivot in ldl_pivots(matrix))


def block_matrix(blocks: Sequence[Sequence[fmpq_mat]]) -> fmpq_mat:
    """One matrix from blocks, row by row; the blocks' shapes must fit."""
    rows: list[list[fmpq]] = []
    for line in blocks:
        parts = [block.tolist() for block in line]
        rows += [[entry for part in parts for entry in part[i]] for i in range(len(parts[0]))]
    return fmpq_mat(rows)


def identity(size: int) -> fmpq_mat:
    """Identity matrix."""
    return fmpq_mat([[fmpq(int(i == j)) for j in range(size)] for i in range(size)])


def rounded_symmetric(matrix: FloatArray, bits: int) -> NDArray[np.object_]:
    """Symmetric part of a floating matrix, rounded `bits` binary places below its largest entry."""
    symmetric = (matrix + matrix.T) / 2
    exponent = bits - int(np.frexp(np.abs(symmetric).max())[1])
    unit = fmpq(2) ** -exponent
    scaled = np.rint(np.ldexp(symmetric, exponent))
    result = np.empty(matrix.shape, dtype=object)
    for i, row in enumerate(scaled.tolist()):
        result[i] = [int(value) * unit for value in row]
    return result


def to_floats(matrix: fmpq_mat | NDArray[np.object_]) -> FloatArray:
    """Floating copy of a rational matrix."""
    return np.array([[int(v.p) / int(v.q) for v in row] for row in matrix.tolist()])
