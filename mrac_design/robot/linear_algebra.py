"""Small symbolic linear systems as straight-line expressions: no pivoting, no branches.

Generated code has to have the same instructions for any data. A symmetric positive definite
matrix needs no pivoting; for a general one orthogonalisation takes its place.
"""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca


class StructurallySingularError(ValueError):
    """The zero pattern of a matrix makes it singular whatever its other entries are."""


def solve_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution X of matrix · X = right for a symmetric positive definite matrix by L D Lᵀ.

    Shapes (n, n) and (n, k); only the lower triangle is read. Structural zeros are kept.
    Without pivoting this is backward stable for positive definite matrices (Higham 2002,
    ch. 10).
    """
    n = matrix.size1()
    lower = ca.SX.eye(n)
    scaled = ca.SX.zeros(n, n)  # L D, kept because it is there before the division
    for j in range(n):
        for i in range(j, n):
            done = _sum(lower[j, k] * scaled[i, k] for k in range(j))
            scaled[i, j] = matrix[i, j] - done
        for i in range(j + 1, n):
            lower[i, j] = scaled[i, j] / scaled[j, j]
    solution = ca.SX(right)
    for i in range(n):
        for k in range(i):
            solution[i, :] -= lower[i, k] * solution[k, :]
    for i in range(n):
        solution[i, :] /= scaled[i, i]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            solution[i, :] -= lower[k, i] * solution[k, :]
    return ca.densify(solution)


def solve_square(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution X of matrix · X = right for a general square matrix; shapes (n, n), (n, k).

    The zero pattern is brought to block triangular form and the blocks are solved one after
    the other: sizes 1 and 2 in closed form (Cramer's rule, forward stable there), larger ones
    by modified Gram-Schmidt on the matrix augmented by its right side, which is backward
    stable (Björck 1967) and needs no pivoting. A singular matrix gives infinities or NaN;
    a structurally singular one raises StructurallySingularError.
    """
    pattern = ca.sparsify(matrix).sparsity()
    if ca.sprank(pattern) < matrix.size1():
        raise StructurallySingularError("the matrix is structurally singular")
    blocks, rows, columns, row_block, column_block, *_ = pattern.btf()
    solution = ca.SX.zeros(matrix.size1(), right.size2())
    # CasADi's form is lower block triangular: the first block depends on nothing but itself.
    for block in range(blocks):
        own_rows = rows[row_block[block] : row_block[block + 1]]
        own_columns = columns[column_block[block] : column_block[block + 1]]
        known = columns[: column_block[block]]
        rest = right[own_rows, :]
        if known:
            rest = rest - ca.mtimes(ca.densify(matrix[own_rows, known]), solution[known, :])
        solution[own_columns, :] = _solve_block(ca.densify(matrix[own_rows, own_columns]), rest)
    return solution


def _solve_block(block: ca.SX, right: ca.SX) -> ca.SX:
    n = block.size1()
    if n == 1:
        return right / block
    if n == 2:
        a, c, b, d = ca.vertsplit(ca.vec(block))
        determinant = a * d - b * c
        top, bottom = right[0, :], right[1, :]
        return ca.vertcat(d * top - b * bottom, a * bottom - c * top) / determinant
    return _solve_orthogonal(block, right)


def _solve_orthogonal(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Gram-Schmidt without square roots: columns are kept orthogonal but not normalised."""
    n = matrix.size1()
    remaining = [matrix[:, j] for j in range(n)]
    rest = [right[:, j] for j in range(right.size2())]
    triangle: dict[tuple[int, int], ca.SX] = {}
    projected: list[list[ca.SX]] = []
    for k in range(n):
        direction = remaining[k]
        square = ca.dot(direction, direction)
        for j in range(k + 1, n):
            triangle[k, j] = ca.dot(direction, remaining[j]) / square
            remaining[j] = remaining[j] - triangle[k, j] * direction
        components = [ca.dot(direction, column) / square for column in rest]
        projected.append(components)
        rest = [column - part * direction for column, part in zip(rest, components, strict=True)]
    solution = ca.SX.zeros(n, right.size2())
    for k in reversed(range(n)):
        for j in range(right.size2()):
            above = _sum(triangle[k, i] * solution[i, j] for i in range(k + 1, n))
            solution[k, j] = projected[k][j] - above
    return solution


def _sum(terms: Iterable[ca.SX]) -> ca.SX:
    return sum(terms, start=ca.SX(0))
