"""What a certificate claims: each a Lyapunov matrix, a number, and the inequalities behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from flint import fmpq

from mrac_design.stability.adaptive_loop import ExactArray
from mrac_design.stability.exact_matrix import is_positive_definite
from mrac_design.stability.inequalities import (
    Corner,
    Increment,
    Matrix,
    decay_blocks,
    energy_blocks,
    exact_corner,
    peak_blocks,
)
from mrac_design.stability.vertices import Vertex


class Output(Enum):
    """The signal whose energy a claim bounds."""

    FORCE = "force"
    """The contact force (N)."""
    LINEARISED_COMMAND = "linearised command"
    """f* = u − K2 Ẋ, what an inertia error multiplies; scaled to newtons."""

    def row(self, corner: Corner) -> Matrix:
        """The signal as a row on the state."""
        return corner.force[0] if self is Output.FORCE else corner.linearised_command


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DecayClaim:
    """V = xᵀPx falls at least by rate·V for every path of gains and stiffness in the box."""

    P: ExactArray
    """Lyapunov matrix (n, n), over the rationals."""
    rate: fmpq
    """Relative fall of V per unit of scaled time, or per sample; > 0."""

    def blocks(self, increment: Increment, corner: Corner) -> list[Matrix]:
        """What must be positive definite at a corner."""
        return decay_blocks(increment, corner, self.P, self.rate)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnergyClaim:
    """The output's energy is at most gain² times that of d̂, from rest, for every such path."""

    P: ExactArray
    """Storage matrix (n, n)."""
    output: Output
    """The bounded signal."""
    gain: fmpq
    """Bound of the L2 gain from d̂ (N) to the output (N), in scaled time."""

    def blocks(self, increment: Increment, corner: Corner) -> list[Matrix]:
        """What must be positive definite at a corner."""
        row = self.output.row(corner)
        return energy_blocks(increment, corner, self.P, row, self.gain**2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeakClaim:
    """|force| <= gain · sup |d̂|, from rest, for every such path."""

    P: ExactArray
    """Matrix (n, n) with |force|² <= V; the ellipsoid V <= gain² is invariant under |d̂| <= 1."""
    rate: fmpq
    """Fall of V outside the ellipsoid, > 0."""
    gain: fmpq
    """Bound of the peak gain from d̂ (N) to the force (N)."""

    def blocks(self, increment: Increment, corner: Corner) -> list[Matrix]:
        """What must be positive definite at a corner."""
        return peak_blocks(increment, corner, self.P, self.rate, self.gain**2)


Claim = DecayClaim | EnergyClaim | PeakClaim


def first_failure(claim: Claim, increment: Increment, vertices: Sequence[Vertex]) -> str | None:
    """Why the claim is not proved by its numbers, in exact arithmetic; None when it is."""
    if not is_positive_definite(claim.P):
        return "P is not positive definite"
    if not isinstance(claim, EnergyClaim) and claim.rate <= 0:
        return "the rate is not positive"
    for vertex in vertices:
        for number, block in enumerate(claim.blocks(increment, exact_corner(vertex)), start=1):
            if not is_positive_definite(block):
                return f"inequality {number} fails at the corner {vertex.label}"
    return None
