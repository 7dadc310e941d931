"""The matrix inequalities of a certificate, written once for floats and for rationals.

V = xᵀPx changes along (x, w) by the quadratic form of `increment`: its time derivative in
continuous time, its change over a sample otherwise. Each claim is that some blocks, linear in P,
are positive definite at every corner of a polytope. The blocks are concave in the loop's matrices,
and these are affine in each parameter taken alone, so the corners decide for the whole polytope
(Boyd, El Ghaoui, Feron, Balakrishnan 1994, chapters 5 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrac_design.stability.exact_matrix import to_floats
from mrac_design.stability.vertices import Vertex

Matrix = NDArray[Any]
"""A matrix of float64 or of `fmpq`; the formulas are the same."""
Increment = Callable[[Matrix, Matrix, Matrix], Matrix]
"""(P, A, B) -> matrix of the change of V as a quadratic form in (x, w)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corner:
    """What the inequalities need of a vertex, in floats or rationals."""

    A: Matrix
    """State matrix (n, n)."""
    disturbances: tuple[Matrix, ...]
    """Columns (n, 1) of a bounded disturbance."""
    energy_input: Matrix
    """Input (n, m) of a disturbance of bounded energy."""
    force: tuple[Matrix, ...]
    """Rows (1, n) of the force."""
    linearised_command: Matrix
    """Row (1, n) of f*."""


def exact_corner(vertex: Vertex) -> Corner:
    """The vertex over the rationals."""
    return Corner(
        A=vertex.A,
        disturbances=vertex.disturbances,
        energy_input=vertex.energy_input,
        force=vertex.force,
        linearised_command=vertex.linearised_command,
    )


def floating_corner(vertex: Vertex) -> Corner:
    """The vertex rounded to float64, for the solver."""
    return Corner(
        A=to_floats(vertex.A),
        disturbances=tuple(to_floats(column) for column in vertex.disturbances),
        energy_input=to_floats(vertex.energy_input),
        force=tuple(to_floats(row) for row in vertex.force),
        linearised_command=to_floats(vertex.linearised_command),
    )


def derivative(P: Matrix, A: Matrix, B: Matrix) -> Matrix:
    """dV/dt along x' = A x + B w."""
    coupling = P @ B
    corner = np.zeros((B.shape[1], B.shape[1]), dtype=int)
    return np.block([[A.T @ P + P @ A, coupling], [coupling.T, corner]])


def difference(P: Matrix, A: Matrix, B: Matrix) -> Matrix:
    """V(x⁺) − V(x) along x⁺ = A x + B w."""
    joined = np.hstack([A, B])
    change = joined.T @ P @ joined
    n = P.shape[0]
    change[:n, :n] = change[:n, :n] - P
    return change


def decay_blocks(increment: Increment, corner: Corner, P: Matrix, rate: Any) -> list[Matrix]:
    """V falls at least by rate·V: per unit of scaled time, or per sample."""
    none = corner.A[:, :0]
    return [-increment(P, corner.A, none) - rate * P]


def energy_blocks(
    increment: Increment, corner: Corner, P: Matrix, output: Matrix, squared_gain: Any
) -> list[Matrix]:
    """Energy of the output at most squared_gain times the energy of the disturbance."""
    n, m = corner.energy_input.shape
    block = -increment(P, corner.A, corner.energy_input)
    block[:n, :n] = block[:n, :n] - output.T @ output
    for k in range(n, n + m):
        block[k, k] = block[k, k] + squared_gain
    return [block]


def peak_blocks(
    increment: Increment, corner: Corner, P: Matrix, rate: Any, squared_gain: Any
) -> list[Matrix]:
    """{V <= squared_gain} is invariant under |d̂| <= 1, and |force|² <= V everywhere."""
    n = P.shape[0]
    blocks = []
    for column in corner.disturbances:
        block = -increment(P, corner.A, column)
        block[:n, :n] = block[:n, :n] - rate * P
        block[n, n] = block[n, n] + rate * squared_gain
        blocks.append(block)
    return [*blocks, *(P - row.T @ row for row in corner.force)]
