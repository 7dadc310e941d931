"""Piecewise polynomials: the one form in which every exogenous input reaches a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_COINCIDENCE = 1e-12
"""Breakpoints closer than this fraction of the largest |breakpoint| are one instant."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PiecewisePolynomial:
    """Vector function of time, one polynomial per segment, right-continuous at breakpoints."""

    breakpoints: FloatArray
    """Segment borders t_0 < … < t_k, s, shape (k + 1,)."""
    coefficients: FloatArray
    """Ascending powers of t − t_i on [t_i, t_{i+1}), SI units, (channels, k, degree + 1)."""

    def __post_init__(self) -> None:
        try:
            breakpoints = readonly(self.breakpoints, (-1,))
            segments = breakpoints.size - 1
            coefficients = readonly(self.coefficients, (-1, segments, -1))
        except ValueError as problem:
            raise ParameterError(
                "shapes of breakpoints and coefficients",
                f"{np.shape(self.breakpoints)}, {np.shape(self.coefficients)}",
                "must be (k + 1,) and (channels, k, degree + 1)",
            ) from problem
        if segments < 1 or 0 in coefficients.shape:
            raise ParameterError(
                "coefficients", coefficients.shape, "needs a segment, a channel, a coefficient"
            )
        if not (np.isfinite(breakpoints).all() and np.isfinite(coefficients).all()):
            raise ParameterError("breakpoints and coefficients", "NaN or inf", "must be finite")
        if not (np.diff(breakpoints) > 0.0).all():
            index = int(np.argmin(np.diff(breakpoints)))
            raise ParameterError(
                f"breakpoints[{index}:{index + 2}]",
                breakpoints[index : index + 2],
                "breakpoints must increase strictly",
            )
        object.__setattr__(self, "breakpoints", breakpoints)
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def start(self) -> float:
        """First instant of the domain, s."""
        return float(self.breakpoints[0])

    @property
    def end(self) -> float:
        """Last instant of the domain, s; the last segment includes it."""
        return float(self.breakpoints[-1])

    @property
    def channels(self) -> int:
        """Number of components."""
        return int(self.coefficients.shape[0])

    @property
    def segments(self) -> int:
        """Number of polynomial pieces k."""
        return int(self.coefficients.shape[1])

    @property
    def degree(self) -> int:
        """Highest power stored (its coefficient may be zero)."""
        return int(self.coefficients.shape[2]) - 1

    def __call__(self, t: ArrayLike) -> FloatArray:
        """Values at the instants `t` (N,), s; returns (channels, N).

        Raises ParameterError for an instant outside [start, end] by more than rounding.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if times.ndim != 1:
            raise ParameterError("t", f"array of shape {times.shape}", "must be (N,)")
        if times.size:
            self._require_inside(float(times.min()), float(times.max()))
        index = np.searchsorted(self.breakpoints, times, side="right") - 1
        np.clip(index, 0, self.segments - 1, out=index)
        offset = times - self.breakpoints[index]
        value = self.coefficients[:, index, -1]
        for power in range(self.degree - 1, -1, -1):
            value = value * offset + self.coefficients[:, index, power]
        return value

    def derivative(self) -> PiecewisePolynomial:
        """Time derivative on the same breakpoints; jumps contribute nothing (no impulses)."""
        powers = np.arange(1.0, self.degree + 1)
        lowered = self.coefficients[:, :, 1:] * powers
        if self.degree == 0:
            lowered = np.zeros_like(self.coefficients)
        return PiecewisePolynomial(breakpoints=self.breakpoints, coefficients=lowered)

    def on_breakpoints(self, new_breakpoints: ArrayLike) -> PiecewisePolynomial:
        """The same function written on `new_breakpoints` (j + 1,), which may span less.

        Exact up to rounding (Taylor shift of each piece). Raises ParameterError when a
        breakpoint of this function inside the new span is missing, since the pieces on both
        sides differ, or when the new span leaves [start, end].
        """
        borders = np.asarray(new_breakpoints, dtype=np.float64)
        if borders.ndim != 1 or borders.size < 2 or not (np.diff(borders) > 0.0).all():
            raise ParameterError("new_breakpoints", borders, "needs two or more, increasing")
        self._require_inside(float(borders[0]), float(borders[-1]))
        tolerance = _tolerance(borders, self.breakpoints)
        inner = self.breakpoints[
            (self.breakpoints > borders[0] + tolerance)
            & (self.breakpoints < borders[-1] - tolerance)
        ]
        missing = inner[_distance(inner, borders) > tolerance]
        if missing.size:
            raise ParameterError(
                "new_breakpoints", f"without {missing[:3]}", "must keep every old breakpoint"
            )
        # The middle of a new segment tells its old one whatever the borders' rounding.
        middles = 0.5 * (borders[:-1] + borders[1:])
        index = np.searchsorted(self.breakpoints, middles, side="right") - 1
        np.clip(index, 0, self.segments - 1, out=index)
        offset = borders[:-1] - self.breakpoints[index]
        shifted = _taylor_shift(self.coefficients[:, index, :], offset)
        return PiecewisePolynomial(breakpoints=borders, coefficients=shifted)

    def restricted(self, start: float, end: float) -> PiecewisePolynomial:
        """The same function on [start, end] ⊆ [self.start, self.end], s."""
        if not start < end:
            raise ParameterError("start, end", (start, end), "must increase")
        tolerance = _tolerance(np.array([start, end]), self.breakpoints)
        inside = (self.breakpoints > start + tolerance) & (self.breakpoints < end - tolerance)
        return self.on_breakpoints(np.concatenate(([start], self.breakpoints[inside], [end])))

    def selected(self, channels: Sequence[int]) -> PiecewisePolynomial:
        """The given channels only, in that order."""
        return PiecewisePolynomial(
            breakpoints=self.breakpoints, coefficients=self.coefficients[list(channels)]
        )

    def shifted(self, offset: ArrayLike) -> PiecewisePolynomial:
        """The function plus a constant `offset` (channels,)."""
        constant = np.broadcast_to(np.asarray(offset, dtype=np.float64), (self.channels,))
        coefficients = self.coefficients.copy()
        coefficients[:, :, 0] += constant[:, None]
        return PiecewisePolynomial(breakpoints=self.breakpoints, coefficients=coefficients)

    def mean(self) -> FloatArray:
        """Time average over [start, end], exact, (channels,)."""
        lengths = np.diff(self.breakpoints)
        powers = np.arange(1, self.degree + 2)
        weights = lengths[:, None] ** powers / powers
        integral = np.einsum("cki,ki->c", self.coefficients, weights)
        average: FloatArray = integral / (self.end - self.start)
        return average

    def largest_magnitude(self) -> FloatArray:
        """Largest |value| per channel over [start, end], (channels,).

        Taken over every breakpoint from both sides and seven points inside each segment.
        """
        fractions = np.linspace(0.0, 1.0, 9)
        values = self._inside_segments(fractions)
        peak: FloatArray = np.abs(values).max(axis=(1, 2))
        return peak

    def peak_to_peak(self) -> FloatArray:
        """Largest minus smallest value per channel, sampled as `largest_magnitude`."""
        values = self._inside_segments(np.linspace(0.0, 1.0, 9))
        span: FloatArray = values.max(axis=(1, 2)) - values.min(axis=(1, 2))
        return span

    def _inside_segments(self, fractions: FloatArray) -> FloatArray:
        """Values at the given fractions of every segment, (channels, k, fractions)."""
        offset = np.diff(self.breakpoints)[:, None] * fractions
        value = self.coefficients[:, :, -1, None] + 0.0 * offset
        for power in range(self.degree - 1, -1, -1):
            value = value * offset + self.coefficients[:, :, power, None]
        return value

    def _require_inside(self, first: float, last: float) -> None:
        tolerance = 1e3 * _COINCIDENCE * max(abs(self.start), abs(self.end))
        if not (first >= self.start - tolerance and last <= self.end + tolerance):
            raise ParameterError(
                "time",
                f"{first:.9g} … {last:.9g} s",
                f"must lie in [{self.start:.9g}, {self.end:.9g}] s, where the signal is defined",
            )


def from_ppoly(ppoly: PPoly) -> PiecewisePolynomial:
    """A SciPy PPoly (CubicSpline, PCHIP, …) with values of shape () or (channels,)."""
    descending = np.asarray(ppoly.c, dtype=np.float64)
    if descending.ndim == 2:
        descending = descending[:, :, None]
    return PiecewisePolynomial(
        breakpoints=ppoly.x, coefficients=np.moveaxis(descending[::-1], (0, 1, 2), (2, 1, 0))
    )


def quintic_hermite(
    times: ArrayLike, value: ArrayLike, rate: ArrayLike, second_rate: ArrayLike
) -> PiecewisePolynomial:
    """Piecewise quintic with the given value and two derivatives (channels, N) at `times` (N,).

    Twice continuously differentiable; between nodes h apart it stays within
    h⁶ max|f⁽⁶⁾| / 46080 of a smooth function f that was sampled.
    """
    instants = np.asarray(times, dtype=np.float64)
    h = np.diff(instants)
    x, v, a = (
        np.atleast_2d(np.asarray(item, dtype=np.float64)) for item in (value, rate, second_rate)
    )
    # What the Taylor part from the left node leaves over at the right one.
    dx = x[:, 1:] - x[:, :-1] - h * (v[:, :-1] + 0.5 * h * a[:, :-1])
    dv = v[:, 1:] - v[:, :-1] - h * a[:, :-1]
    da = a[:, 1:] - a[:, :-1]
    c3 = (10.0 * dx - 4.0 * h * dv + 0.5 * h**2 * da) / h**3
    c4 = (-15.0 * dx + 7.0 * h * dv - h**2 * da) / h**4
    c5 = (6.0 * dx - 3.0 * h * dv + 0.5 * h**2 * da) / h**5
    taylor = (x[:, :-1], v[:, :-1], 0.5 * a[:, :-1])
    return PiecewisePolynomial(
        breakpoints=instants, coefficients=np.stack((*taylor, c3, c4, c5), axis=2)
    )


def merged_breakpoints(*signals: PiecewisePolynomial) -> FloatArray:
    """Sorted union of the breakpoints of `signals`, instants equal up to rounding taken once."""
    if not signals:
        raise ParameterError("signals", (), "needs at least one")
    # Not np.unique: it loads all of numpy.ma.
    every = np.sort(np.concatenate([signal.breakpoints for signal in signals]))
    keep = np.concatenate(([True], np.diff(every) > _tolerance(every)))
    merged: FloatArray = every[keep]
    return merged


def stack(*signals: PiecewisePolynomial) -> PiecewisePolynomial:
    """All channels of `signals`, in order, on the union of their breakpoints.

    Raises ParameterError unless all start and end at the same instants (use `restricted`).
    """
    borders = merged_breakpoints(*signals)
    tolerance = _tolerance(borders)
    for signal in signals:
        if abs(signal.start - borders[0]) > tolerance or abs(signal.end - borders[-1]) > tolerance:
            raise ParameterError(
                "signals",
                [(item.start, item.end) for item in signals],
                "must all span the same time; cut the longer ones with .restricted(start, end)",
            )
    degree = max(signal.degree for signal in signals)
    parts = []
    for signal in signals:
        refined = signal.on_breakpoints(borders).coefficients
        parts.append(np.pad(refined, ((0, 0), (0, 0), (0, degree - signal.degree))))
    return PiecewisePolynomial(breakpoints=borders, coefficients=np.concatenate(parts, axis=0))


def _taylor_shift(coefficients: FloatArray, offset: FloatArray) -> FloatArray:
    """Coefficients (channels, k, d + 1) of p(s + offset_k) for each segment k."""
    order = coefficients.shape[2]
    shifted = np.zeros_like(coefficients)
    for low in range(order):
        for high in range(low, order):
            shifted[:, :, low] += (
                comb(high, low) * coefficients[:, :, high] * offset ** (high - low)
            )
    return shifted


def _tolerance(*instants: FloatArray) -> float:
    return _COINCIDENCE * max(float(np.abs(item).max()) for item in instants)


def _distance(instants: FloatArray, sorted_instants: FloatArray) -> FloatArray:
    """Distance from each instant to the nearest of `sorted_instants`."""
    right = np.clip(np.searchsorted(sorted_instants, instants), 1, sorted_instants.size - 1)
    distance: FloatArray = np.minimum(
        np.abs(instants - sorted_instants[right - 1]), np.abs(instants - sorted_instants[right])
    )
    return distance
