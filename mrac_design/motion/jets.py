"""Functions of time carried with their first two derivatives, and smooth steps and phases.

Heart-motion models are compositions of phases, harmonics and slowly changing levels. With
the exact derivatives at hand they become quintic Hermite polynomials without differencing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Jet:
    """A function sampled at N instants with its first and second time derivative."""

    value: FloatArray
    """Values, (…, N)."""
    rate: FloatArray
    """First derivative by time, per s, (…, N)."""
    second_rate: FloatArray
    """Second derivative by time, per s², (…, N)."""

    def __add__(self, other: Jet) -> Jet:
        return Jet(
            value=self.value + other.value,
            rate=self.rate + other.rate,
            second_rate=self.second_rate + other.second_rate,
        )

    def __mul__(self, other: Jet) -> Jet:
        return Jet(
            value=self.value * other.value,
            rate=self.rate * other.value + self.value * other.rate,
            second_rate=self.second_rate * other.value
            + 2.0 * self.rate * other.rate
            + self.value * other.second_rate,
        )

    def combined(self, weights: FloatArray) -> Jet:
        """The linear combinations `weights` (…, n) of n functions (n, N), as (…, N)."""
        return Jet(
            value=weights @ self.value,
            rate=weights @ self.rate,
            second_rate=weights @ self.second_rate,
        )

    def summed(self, axis: int) -> Jet:
        """Sum over one leading axis."""
        return Jet(
            value=self.value.sum(axis=axis),
            rate=self.rate.sum(axis=axis),
            second_rate=self.second_rate.sum(axis=axis),
        )


def harmonics(phase: Jet, count: int) -> Jet:
    """1, cos 2πφ, sin 2πφ, …, cos 2π·count·φ, sin 2π·count·φ of a phase in cycles.

    Shape (2·count + 1, N).
    """
    turns = 2.0 * np.pi * np.arange(1, count + 1)[:, None]
    cosine, sine = np.cos(turns * phase.value), np.sin(turns * phase.value)
    first = turns * phase.rate
    second = turns * phase.second_rate
    shape = (2 * count + 1, phase.value.size)
    value, rate, second_rate = np.ones(shape), np.zeros(shape), np.zeros(shape)
    value[1::2], value[2::2] = cosine, sine
    rate[1::2], rate[2::2] = -first * sine, first * cosine
    second_rate[1::2] = -second * sine - first**2 * cosine
    second_rate[2::2] = second * cosine - first**2 * sine
    return Jet(value=value, rate=rate, second_rate=second_rate)


def smooth_steps(t: FloatArray, switches: FloatArray, levels: FloatArray, width: float) -> Jet:
    """Levels (m, n + 1) that change at `switches` (n,), s, each change spread over `width` s.

    A change follows the smooth step 35x⁴ − 84x⁵ + 70x⁶ − 20x⁷, centred on its switch: three
    times continuously differentiable, monotone. `t` (N,) increasing; returns (m, N).
    """
    value = np.repeat(levels[:, :1], t.size, axis=1)
    rate, second_rate = np.zeros_like(value), np.zeros_like(value)
    for switch, change in zip(switches, np.diff(levels, axis=1).T, strict=True):
        first, last = np.searchsorted(t, [switch - 0.5 * width, switch + 0.5 * width])
        x = (t[first:last] - switch) / width + 0.5
        jump = change[:, None]
        value[:, first:last] += jump * (x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x))))
        value[:, last:] += jump
        rate[:, first:last] += jump / width * (140.0 * (x * (1.0 - x)) ** 3)
        second_rate[:, first:last] += (
            jump / width**2 * (420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x))
        )
    return Jet(value=value, rate=rate, second_rate=second_rate)


def smooth_phase(t: FloatArray, switches: FloatArray, rates: FloatArray, width: float) -> Jet:
    """Phase, cycles, that starts at 0 for t = 0 and runs at `rates` (n + 1,), Hz.

    The rate changes at `switches` (n,), s, by smooth steps of `width` s, so the phase is four
    times continuously differentiable; away from the switches it equals the phase with abrupt
    changes, because a smooth step is symmetric. `t` (N,) increasing; returns shape (N,).
    """
    rate = smooth_steps(t, switches, rates[None, :], width)
    knots = np.concatenate(([0.0], switches))
    reached = np.concatenate(([0.0], np.cumsum(rates[:-1] * np.diff(knots))))
    index = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, None)
    value = reached[index] + rates[index] * (t - knots[index])
    for switch, change in zip(switches, np.diff(rates), strict=True):
        first, last = np.searchsorted(t, [switch - 0.5 * width, switch + 0.5 * width])
        x = (t[first:last] - switch) / width + 0.5
        integral = x**5 * (7.0 + x * (-14.0 + x * (10.0 - 2.5 * x)))
        value[first:last] += change * width * (integral - np.maximum(x - 0.5, 0.0))
    return Jet(value=value, rate=rate.value[0], second_rate=rate.rate[0])
