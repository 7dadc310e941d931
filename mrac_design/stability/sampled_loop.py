"""The adaptive force axis as a processor runs it: sampled, held, and late by whole samples.

The command û_k is computed from the force at the sample; the filters then advance by the step
x⁺ = F x + G v whose numbers the processor holds, and the plant receives û_{k−delay} for one
period. With a = exp(−K2 h), p = (1 − a)/K̂2, q = (ĥ − p)/K̂2:

    ŷ⁺ = ŷ + p Ẑ + q û_{k−delay}        Ẑ⁺ = a Ẑ + p û_{k−delay}
    x̂u⁺ = F̂ x̂u + Ĝ û_k                  x̂y⁺ = F̂ x̂y + Ĝ κ ŷ

with F̂ = W F W⁻¹, Ĝ = W G and W = diag(ω, …, ωⁿ). Every entry is affine in a. The exponential is
irrational, so it is enclosed between rational bounds that become a further pair of ends of the
polytope: what is proved at its corners holds for the true number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import arb, ctx, fmpq

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.adaptive_loop import AdaptiveLoop, ExactArray, exact, exact_array
from mrac_design.stability.parameter_box import ParameterBox, corner_label
from mrac_design.stability.vertices import Vertex, feedback_row, unit_rows

ENCLOSURE_BITS = 96
"""The exponential is enclosed to 2⁻⁹⁶, far below what any certificate depends on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Sampling period and computational delay."""

    period: fmpq
    """h (s), > 0."""
    delay: int
    """Whole periods between reading the force and applying the command it gives, 0 to 4."""

    def __post_init__(self) -> None:
        if self.period <= 0:
            raise ParameterError("sampling period", self.period, "must be > 0 s")
        if not 0 <= self.delay <= 4:
            raise ParameterError("delay", self.delay, "must be 0 to 4 whole periods")


def sampling(period: Number, delay: int) -> Sampling:
    """A Sampling from any number; write "1/1000" for an exact millisecond."""
    return Sampling(period=exact(period, "sampling period"), delay=delay)


def velocity_exponential(loop: AdaptiveLoop, timing: Sampling) -> tuple[fmpq, fmpq]:
    """Rational bounds of a = exp(−K2 h)."""
    return enclosed_exponential(loop.velocity_gain * timing.period)


def enclosed_exponential(x: fmpq) -> tuple[fmpq, fmpq]:
    """Rational bounds of exp(−x) for x >= 0, 2⁻⁹⁵ apart; (1, 1) for x = 0."""
    if x == 0:
        return fmpq(1), fmpq(1)
    with ctx.workprec(4 * ENCLOSURE_BITS):
        ball = (-arb(x)).exp()
        grid = fmpq(2) ** ENCLOSURE_BITS
        low = (ball.lower().fmpq() * grid).floor() - 1
        high = (ball.upper().fmpq() * grid).ceil() + 1
    return fmpq(low) / grid, fmpq(high) / grid


def hold_terms(a: fmpq, velocity_gain: fmpq, period: fmpq) -> tuple[fmpq, fmpq]:
    """(p, q) of the held plant in scaled time; the limits for a velocity gain of zero."""
    if velocity_gain == 0:
        return period, period**2 / 2
    p = (1 - a) / velocity_gain
    return p, (period - p) / velocity_gain


def scaled_filter_step(loop: AdaptiveLoop, timing: Sampling) -> tuple[ExactArray, ExactArray]:
    """F̂ (n, n) and Ĝ (n,). Raises ParameterError when the loop has no step for the period."""
    step = loop.filter_step(timing.period)
    weights = [loop.bandwidth ** (k + 1) for k in range(loop.degree)]
    F = [
        [value * above / below for value, below in zip(row, weights, strict=True)]
        for row, above in zip(step.transition, weights, strict=True)
    ]
    G = [value * weight for value, weight in zip(step.input, weights, strict=True)]
    return exact_array(F), exact_array([G])[0]


def sampled_vertices(loop: AdaptiveLoop, box: ParameterBox, timing: Sampling) -> tuple[Vertex, ...]:
    """Matrices of the sampled loop at every corner of box × bounds of the exponential.

    The state is (ŷ, Ẑ, x̂u, x̂y, û_{k−1}, …, û_{k−delay}), 2 + 2n + delay entries. The corners of
    the box run fastest. Raises ParameterError when the loop has no filter step for the period.
    """
    bounds = velocity_exponential(loop, timing)
    filters = scaled_filter_step(loop, timing)
    energy = energy_input(loop, timing, bounds)
    return tuple(
        _sampled_vertex(loop, timing, corner, a, filters, energy)
        for a in dict.fromkeys(bounds)
        for corner in box.corners()
    )


def energy_input(loop: AdaptiveLoop, timing: Sampling, bounds: tuple[fmpq, fmpq]) -> ExactArray:
    """Lower-triangular L (2, 2) with L Lᵀ >= ∫ g gᵀ, g the plant's response to d̂ in one period.

    A disturbance with ∫ d̂² <= 1 over the period moves (ŷ, Ẑ) by L v with |v| <= 1.
    """
    a = bounds[0]
    gram = gram_matrix(loop, timing, a, a * a)
    floats = np.array([[int(v.p) / int(v.q) for v in row] for row in gram.tolist()])
    factor = np.linalg.cholesky(floats * (1 + 1e-9))
    return exact_array([[fmpq(*float(v).as_integer_ratio()) for v in row] for row in factor])


def gram_matrix(loop: AdaptiveLoop, timing: Sampling, a: fmpq, a_squared: fmpq) -> ExactArray:
    """∫ g gᵀ over one scaled period, for a = exp(−K2 h) and its square."""
    K2, h = loop.scaled_velocity_gain, timing.period * loop.bandwidth
    if K2 == 0:
        return exact_array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    p = (1 - a) / K2
    square = (1 - a_squared) / (2 * K2)
    mixed = (1 - 2 * a + a_squared) / (2 * K2**2)
    return exact_array([[(h - 2 * p + square) / K2**2, mixed], [mixed, square]])


def _sampled_vertex(
    loop: AdaptiveLoop,
    timing: Sampling,
    corner: tuple[fmpq, ...],
    a: fmpq,
    filters: tuple[ExactArray, ExactArray],
    energy: ExactArray,
) -> Vertex:
    ratio, n, (F, G) = corner[-1], loop.degree, filters
    p, q = hold_terms(a, loop.scaled_velocity_gain, timing.period * loop.bandwidth)
    own = 2 + 2 * n
    size = own + timing.delay
    unit = unit_rows(size)
    command = exact_array([[*feedback_row(loop, corner).tolist(), *([0] * timing.delay)]])[0]
    applied = unit[size - 1] if timing.delay else command
    A = exact_array([[0] * size] * size)
    A[0] = unit[0] + p * unit[1] + q * applied
    A[1] = a * unit[1] + p * applied
    A[2 : 2 + n, 2 : 2 + n] = A[2 + n : own, 2 + n : own] = F
    A[2 : 2 + n] += np.outer(G, command)
    A[2 + n : own, 0] += G * ratio
    if timing.delay:
        A[own] = command
        A[own + 1 :] = unit[own : size - 1]
    zero = [0] * (size - 2)
    return Vertex(
        A=A,
        disturbances=tuple(
            exact_array([[sign * q], [p], *([v] for v in zero)]) for sign in (1, -1)
        ),
        energy_input=np.vstack([energy, exact_array([[0, 0]] * (size - 2))]),
        # Between samples the force is κ(ŷ + p(τ)Ẑ + q(τ)û), with q(τ) convex in p(τ).
        force=tuple(
            (ratio * row).reshape(1, size)
            for row in (unit[0], unit[0] + p * unit[1], unit[0] + p * unit[1] + q * applied)
        ),
        linearised_command=(applied - loop.scaled_velocity_gain * unit[1]).reshape(1, size),
        label=corner_label(loop, corner),
    )
