"""The adaptive force axis as a processor runs it: sampled, held, and late by whole samples.

The command is computed from the force at the sample, û_k = −θᵀ(P1φ)_k; the filters then advance
by their exact zero-order-hold step, and the plant receives û_{k−delay} for one period. With
a = exp(−K2 h), b = exp(−ao h), p = (1 − a)/K̂2, q = (ĥ − p)/K̂2 and f = (1 − b)/âo:

    ŷ⁺ = ŷ + p Ẑ + q û_{k−delay}        Ẑ⁺ = a Ẑ + p û_{k−delay}
    x̂u⁺ = b x̂u + f û_k                  x̂y⁺ = b x̂y + f κ ŷ

Every entry is affine in a and in b taken one at a time. The two exponentials are irrational, so
each is enclosed between rational bounds that become two further ends of the polytope: what is
proved at its corners holds for the true numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from flint import arb, ctx, fmpq

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.adaptive_loop import (
    AdaptiveLoop,
    ExactArray,
    ParameterBox,
    Vertex,
    corner_label,
    exact,
    exact_array,
    feedback_row,
)

ENCLOSURE_BITS = 96
"""Exponentials are enclosed to 2⁻⁹⁶, far below what any certificate depends on."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Exponentials:
    """Rational bounds of the two exponentials of one period."""

    velocity: tuple[fmpq, fmpq]
    """Bounds of a = exp(−K2 h)."""
    observer: tuple[fmpq, fmpq]
    """Bounds of b = exp(−ao h)."""


def exponentials(loop: AdaptiveLoop, timing: Sampling) -> Exponentials:
    """Enclose exp(−K2 h) and exp(−ao h)."""
    return Exponentials(
        velocity=enclosed_exponential(loop.velocity_gain * timing.period),
        observer=enclosed_exponential(loop.observer_pole * timing.period),
    )


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


def sampled_vertices(loop: AdaptiveLoop, box: ParameterBox, timing: Sampling) -> tuple[Vertex, ...]:
    """Matrices of the sampled loop at every corner of box × exponential bounds.

    The state is (ŷ, Ẑ, x̂u, x̂y, û_{k−1}, …, û_{k−delay}).
    """
    bounds = exponentials(loop, timing)
    ends = product(dict.fromkeys(bounds.velocity), dict.fromkeys(bounds.observer))
    input_matrix = energy_input(loop, timing, bounds)
    return tuple(
        _sampled_vertex(loop, timing, corner, a, b, input_matrix)
        for a, b in ends
        for corner in box.corners()
    )


def energy_input(loop: AdaptiveLoop, timing: Sampling, bounds: Exponentials) -> ExactArray:
    """Lower-triangular L (2, 2) with L Lᵀ >= ∫ g gᵀ, g the plant's response to d̂ in one period.

    A disturbance with ∫ d̂² <= 1 over the period moves (ŷ, Ẑ) by L v with |v| <= 1.
    """
    a = bounds.velocity[0]
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
    corner: tuple[fmpq, fmpq, fmpq, fmpq],
    a: fmpq,
    b: fmpq,
    input_matrix: ExactArray,
) -> Vertex:
    ratio, ao = corner[3], loop.scaled_observer_pole
    p, q = hold_terms(a, loop.scaled_velocity_gain, timing.period * loop.bandwidth)
    f = (1 - b) / ao
    size = 4 + timing.delay
    unit = exact_array([[int(i == j) for j in range(size)] for i in range(size)])
    command = exact_array([[*feedback_row(ao, corner), *([0] * timing.delay)]])[0]
    applied = unit[3 + timing.delay] if timing.delay else command
    rows = [
        unit[0] + p * unit[1] + q * applied,
        a * unit[1] + p * applied,
        b * unit[2] + f * command,
        b * unit[3] + f * ratio * unit[0],
        *([command] if timing.delay else []),
        *(unit[4 + k] for k in range(timing.delay - 1)),
    ]
    zero = [fmpq(0)] * (size - 2)
    energy = np.vstack([input_matrix, exact_array([[0, 0]] * (size - 2))])
    return Vertex(
        A=np.array(rows, dtype=object),
        disturbances=tuple(
            exact_array([[sign * q], [p], *([v] for v in zero)]) for sign in (1, -1)
        ),
        energy_input=energy,
        # Between samples the force is κ(ŷ + p(τ)Ẑ + q(τ)û), with q(τ) convex in p(τ).
        force=tuple(
            (ratio * row).reshape(1, size)
            for row in (unit[0], unit[0] + p * unit[1], unit[0] + p * unit[1] + q * applied)
        ),
        linearised_command=(applied - loop.scaled_velocity_gain * unit[1]).reshape(1, size),
        label=corner_label(corner),
    )
