"""The instants a run stops at: input breakpoints, sampling and recording, all hit exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial

_COINCIDENCE = 1e-9
"""Instants closer than this fraction of the shortest wanted interval are one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Schedule:
    """Intervals between stops; inside one, inputs are a single polynomial and the memory holds."""

    start: FloatArray
    """Beginning of each interval (s), shape (N,)."""
    length: FloatArray
    """Length of each interval (s), shape (N,)."""
    substeps: NDArray[np.int64]
    """Integration steps inside each interval, shape (N,). Where one step spans several intervals
    its length stands at the first, and the others have none."""
    segment: NDArray[np.int64]
    """Input segment each interval lies in, shape (N,)."""
    offset: FloatArray
    """Time from the segment's first instant to the interval's (s), shape (N,)."""
    records: NDArray[np.bool_]
    """Whether the outputs are recorded at the interval's beginning, shape (N,)."""
    updates: NDArray[np.bool_]
    """Whether the memory is updated at the interval's beginning (before recording), shape (N,)."""


def build_schedule(
    inputs: PiecewisePolynomial,
    *,
    duration: float,
    step: float,
    record_period: float,
    sampling_period: float | None,
    spanning: bool = False,
) -> Schedule:
    """Stops of a run over [0, duration] s with integration steps of at most `step` s.

    `spanning` steps may be longer than a recording interval (the engine interpolates).
    Raises ParameterError when a time is not positive or the inputs end before the run.
    """
    for name, value in (("duration", duration), ("step", step), ("record period", record_period)):
        if not 0 < value < float("inf"):
            raise ParameterError(name, value, "must be a finite time > 0 s")
    if inputs.start > 0 or inputs.end < duration * (1 - 1e-12):
        raise ParameterError(
            "duration", duration, f"the inputs cover {inputs.start:g} to {inputs.end:g} s only"
        )
    recording = _multiples(record_period, duration)
    sampling = _multiples(sampling_period, duration) if sampling_period else np.empty(0)
    tolerance = _COINCIDENCE * min(step, record_period, sampling_period or np.inf)
    inside = inputs.breakpoints[(inputs.breakpoints > 0) & (inputs.breakpoints < duration)]
    stops = _distinct([[0.0, duration], recording, sampling, inside], tolerance)
    if spanning and step > record_period * (1 + 1e-6):
        borders = _distinct([[0.0, duration], sampling, inside], tolerance)
        steps = _equal_steps(borders, step)
        stops = np.sort(np.append(stops, steps[~_among(steps, stops, tolerance)]))
        first = np.flatnonzero(_among(stops[:-1], steps, tolerance))
        substeps = np.zeros(stops.size - 1, dtype=np.int64)
        substeps[first] = 1
        length = np.diff(stops)
        length[first] = np.diff(np.append(stops[first], duration))
    else:
        length = np.diff(stops)
        substeps = np.ceil(length / step - 1e-6).astype(np.int64).clip(min=1)
    start = stops[:-1]
    middle = start + np.diff(stops) / 2
    segment = np.searchsorted(inputs.breakpoints, middle, side="right") - 1
    segment = np.clip(segment, 0, inputs.segments - 1)
    return Schedule(
        start=readonly(start),
        length=readonly(length),
        substeps=substeps,
        segment=segment.astype(np.int64),
        offset=readonly(np.maximum(start - inputs.breakpoints[segment], 0.0)),
        records=_among(start, recording, tolerance),
        updates=_among(start, sampling, tolerance),
    )


def _distinct(instants: Sequence[ArrayLike], tolerance: float) -> FloatArray:
    """All of them in order, of such that nearly coincide only the first."""
    # Not np.unique: it loads all of numpy.ma.
    ordered = np.sort(np.concatenate([np.asarray(part, dtype=float) for part in instants]))
    return ordered[np.concatenate([[True], np.diff(ordered) > tolerance])]


def _equal_steps(borders: FloatArray, step: float) -> FloatArray:
    """Beginnings of steps of at most `step` that divide what lies between borders equally."""
    spans = np.diff(borders)
    counts = np.ceil(spans / step - 1e-6).astype(np.int64).clip(min=1)
    whole = np.repeat(np.arange(spans.size), counts)
    number = np.arange(whole.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return borders[whole] + number * (spans / counts)[whole]


def _multiples(period: float, end: float) -> FloatArray:
    count = int(np.ceil(end / period - 1e-9))
    return period * np.arange(count, dtype=np.float64)


def _among(instants: FloatArray, chosen: FloatArray, tolerance: float) -> NDArray[np.bool_]:
    if chosen.size == 0:
        return np.zeros(instants.size, dtype=bool)
    nearest = np.clip(np.searchsorted(chosen, instants + tolerance) - 1, 0, None)
    return np.abs(instants - chosen[nearest]) <= tolerance
