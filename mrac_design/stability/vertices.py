"""The loop's matrices at the corners of a box, and the feedback law as a row of them.

In scaled time, with the filters in companion form (c the companion matrix of Ao, e its input):

    ŷ' = Ẑ          Ẑ' = û − K̂2 Ẑ − d̂          x̂u' = c x̂u + e û          x̂y' = c x̂y + e κ ŷ
    force = κ ŷ

ξ = X − Xh is the penetration, so the heart enters as one acceleration d = Ẍh + K2 Ẋh, with
d̂ = b0 d/ω² in newtons. Source: the error model of [AW 5.8] for the plant of [Z].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import fmpq

from mrac_design.stability.adaptive_loop import AdaptiveLoop, ExactArray, exact_array
from mrac_design.stability.parameter_box import ParameterBox, corner_label


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vertex:
    """The loop's matrices at one corner of the polytope, over the rationals."""

    A: ExactArray
    """State matrix, (N, N)."""
    disturbances: tuple[ExactArray, ...]
    """Columns (N, 1); their convex hull with both signs holds every effect of |d̂| <= 1."""
    energy_input: ExactArray
    """Input matrix (N, m) through which a disturbance of energy one acts."""
    force: tuple[ExactArray, ...]
    """Rows (1, N); the force at any instant is in their convex hull."""
    linearised_command: ExactArray
    """Row (1, N) of f* = û − K̂2 Ẑ."""
    label: str
    """The corner, for messages."""


def continuous_vertices(loop: AdaptiveLoop, box: ParameterBox) -> tuple[Vertex, ...]:
    """Matrices of the continuous loop at every corner of the box; the state is
    (ŷ, Ẑ, x̂u, x̂y), 2 + 2n entries."""
    n = loop.degree
    size = 2 + 2 * n
    unit = unit_rows(size)
    column = (-unit[1]).reshape(size, 1)
    companion = exact_array(
        [[-value for value in loop.scaled_observer], *unit_rows(n)[: n - 1].tolist()]
    )
    vertices = []
    for corner in box.corners():
        command, ratio = feedback_row(loop, corner), corner[-1]
        A = exact_array([[0] * size] * size)
        A[0], A[1] = unit[1], command - loop.scaled_velocity_gain * unit[1]
        A[2 : 2 + n, 2 : 2 + n] = A[2 + n :, 2 + n :] = companion
        A[2] = A[2] + command
        A[2 + n] = A[2 + n] + ratio * unit[0]
        vertices.append(
            Vertex(
                A=A,
                disturbances=(column,),
                energy_input=column,
                force=((ratio * unit[0]).reshape(1, size),),
                linearised_command=A[1].reshape(1, size),
                label=corner_label(loop, corner),
            )
        )
    return tuple(vertices)


def feedback_row(loop: AdaptiveLoop, corner: Sequence[fmpq]) -> ExactArray:
    """û as a row on (ŷ, Ẑ, x̂u, x̂y), (2 + 2n,), for gains and stiffness ratio of a corner."""
    ratio = corner[-1]
    r, *s = (value * unit for value, unit in zip(corner[:-1], loop.gain_units, strict=True))
    on_command = [
        -known - r * model
        for known, model in zip(loop.scaled_known_part, loop.scaled_internal_model, strict=True)
    ]
    on_force = [s[0] * a - gain for a, gain in zip(loop.scaled_observer, s[1:], strict=True)]
    return exact_array([[-s[0] * ratio, 0, *on_command, *on_force]])[0]


def unit_rows(size: int) -> ExactArray:
    """Identity matrix as an array of rationals."""
    return exact_array([[int(i == j) for j in range(size)] for i in range(size)])
