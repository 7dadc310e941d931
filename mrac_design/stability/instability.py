"""Proof that a loop with frozen gains is unstable: what refutes a certificate for good."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq_mat

from mrac_design.polynomials.stable import is_hurwitz
from mrac_design.stability.adaptive_loop import AdaptiveLoop
from mrac_design.stability.certificate import Timing, vertices_of
from mrac_design.stability.coordinates import balanced
from mrac_design.stability.exact_matrix import is_positive_definite, ldl_pivots, to_floats
from mrac_design.stability.inequalities import floating_corner
from mrac_design.stability.parameter_box import ParameterBox
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.vertices import Vertex
from mrac_design.time_domain import Continuous


def unstable_corner(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> str | None:
    """A corner at which the loop with frozen gains is unstable, proved, with its worst pole.

    None when there is none, or none that is far enough from the border for a proof.
    """
    vertices = vertices_of(loop, box, timing)
    if isinstance(timing, Continuous):
        return _growing(vertices, to_float(loop.bandwidth))
    count = sum(1 for _ in box.corners())
    for k in range(count):
        worst = float(np.abs(np.linalg.eigvals(to_floats(vertices[k].A))).max())
        # The same corner at both bounds of the exponential.
        if worst > 1 and _proved_unstable(vertices[k::count]):
            return f"{vertices[k].label} (a pole of modulus {worst:.6g})"
    return None


def _growing(vertices: Sequence[Vertex], bandwidth: float) -> str | None:
    for vertex in vertices:
        if not is_hurwitz(fmpq_mat(vertex.A.tolist()).charpoly()):
            worst = float(np.linalg.eigvals(to_floats(vertex.A)).real.max() * bandwidth)
            return f"{vertex.label} (a pole with real part {worst:.6g} 1/s)"
    return None


def _proved_unstable(ends: Sequence[Vertex]) -> bool:
    """Whether x⁺ = A x grows from some start, for every A on the segment between the ends.

    A form V = xᵀPx that falls everywhere and is negative somewhere stays negative from there and
    falls on, so x cannot die out (Lyapunov's instability theorem). Along a segment
    P − A(s)ᵀ P A(s) is a quadratic polynomial in s, and positive definite where its Bernstein
    coefficients are.
    """
    floating = floating_corner(ends[0])
    coordinates = balanced([floating.A])
    A = coordinates.corners([floating])[0].A
    size = len(A)
    try:
        form = np.linalg.solve(np.eye(size**2) - np.kron(A.T, A.T), np.eye(size).ravel())
    except np.linalg.LinAlgError:  # two poles whose product is one
        return False
    P = coordinates.form(np.asarray(form.reshape(size, size), dtype=float))
    first, last = ends[0].A, ends[-1].A
    mixed = first.T @ P @ last
    falls = [P - first.T @ P @ first]
    if len(ends) > 1:
        falls += [P - (mixed + mixed.T) / 2, P - last.T @ P @ last]
    return all(map(is_positive_definite, falls)) and bool(ldl_pivots(P)[-1] < 0)
