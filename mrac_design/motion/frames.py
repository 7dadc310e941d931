"""From camera frames to a smooth motion: zero-phase low-pass and cubic spline, in NumPy alone.

SciPy has both, but its filters take longer to load than a study of a recording to run.
"""

from __future__ import annotations

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.motion.signal import PiecewisePolynomial


def zero_phase_butterworth(
    position: FloatArray, *, order: int, share: float, padding: int
) -> FloatArray:
    """Frames (N, k) through a Butterworth low-pass, forwards and then backwards.

    `share` of the Nyquist frequency is the cut-off, 0 … 1; N > `padding` ≥ 1 frames are mirrored
    through the first and the last to start and end without a jump.
    """
    b, a = _butterworth(order, share)
    left = 2.0 * position[0] - position[padding:0:-1]
    right = 2.0 * position[-1] - position[-2 : -padding - 2 : -1]
    extended = np.concatenate([left, position, right])
    backwards = _filtered(b, a, extended)[::-1]
    return _filtered(b, a, backwards)[::-1][padding:-padding]


def _butterworth(order: int, share: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator in powers of 1/z, by the bilinear transformation."""
    # In units of half the sampling rate, warped so that the cut-off stays where it is.
    cutoff = np.tan(0.5 * np.pi * share)
    angles = 0.5 * np.pi * (np.arange(1 - order, order, 2) / order)
    poles = -cutoff * np.exp(1j * angles)
    gain = (cutoff**order / np.prod(1.0 - poles)).real
    numerator: FloatArray = gain * np.poly(np.full(order, -1.0))
    denominator: FloatArray = np.real(np.poly((1.0 + poles) / (1.0 - poles)))
    return numerator, denominator


def _filtered(b: FloatArray, a: FloatArray, values: FloatArray) -> FloatArray:
    """Direct form II transposed over the rows, in the steady state of the first row before it."""
    order = b.size - 1
    advance = np.eye(order, k=1)
    advance[:, 0] = -a[1:]
    drive = (b[1:] - a[1:] * b[0])[:, None]
    state = np.linalg.solve(np.eye(order) - advance, drive) * values[0]
    result = np.empty_like(values)
    for row, value in enumerate(values):
        result[row] = b[0] * value + state[0]
        state = advance @ state + drive * value
    return result


def cubic_spline(values: FloatArray, *, frame_rate: float) -> PiecewisePolynomial:
    """Twice continuously differentiable cubics through values (N, k) at `frame_rate` Hz, N ≥ 2.

    The third derivative does not jump at the second and the last but one instant either; three
    values give a parabola, two a line.
    """
    difference = np.diff(values, axis=0) * frame_rate
    rate = _rates(difference)
    bend = rate[:-1] + rate[1:] - 2.0 * difference
    powers = (
        values[:-1],
        rate[:-1],
        (difference - rate[:-1] - bend) * frame_rate,
        bend * frame_rate**2,
    )
    return PiecewisePolynomial(
        breakpoints=np.arange(values.shape[0]) / frame_rate,
        coefficients=np.stack(powers, axis=2).transpose(1, 0, 2),
    )


def _rates(difference: FloatArray) -> FloatArray:
    """The spline's derivative at all N instants, from the N − 1 slopes of its chords."""
    if len(difference) == 1:
        return np.concatenate([difference, difference])
    if len(difference) == 2:
        middle = 0.5 * (difference[0] + difference[1])
        return np.stack([2.0 * difference[0] - middle, middle, 2.0 * difference[1] - middle])
    first = 2.5 * difference[0] + 0.5 * difference[1]
    last = 2.5 * difference[-1] + 0.5 * difference[-2]
    right = [first, *(3.0 * (difference[:-1] + difference[1:])), last]
    # Row by row r_{i−1} + 4 r_i + r_{i+1}; at the ends r_0 + 2 r_1 and 2 r_{N−2} + r_{N−1}.
    above = [2.0]
    for i in range(1, len(right) - 1):
        scale = 1.0 / (4.0 - above[-1])
        above.append(scale)
        right[i] = scale * (right[i] - right[i - 1])
    right[-1] = (right[-1] - 2.0 * right[-2]) / (1.0 - 2.0 * above[-1])
    for i in range(len(right) - 2, -1, -1):
        right[i] = right[i] - above[i] * right[i + 1]
    return np.stack(right)
