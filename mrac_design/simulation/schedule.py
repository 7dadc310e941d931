"""The instants a run stops at: input breakpoints, sampling and recording, all hit exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """Integration steps inside each interval, shape (N,)."""
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
) -> Schedule:
    """Stops of a run over [0, duration] s with integration steps of at most `step` s.

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
    stops = np.unique(np.concatenate([[0.0, duration], recording, sampling, inside]))
    stops = stops[np.concatenate([[True], np.diff(stops) > tolerance])]
    start, length = stops[:-1], np.diff(stops)
    segment = np.searchsorted(inputs.breakpoints, start + length / 2, side="right") - 1
    segment = np.clip(segment, 0, inputs.segments - 1)
    return Schedule(
        start=readonly(start),
        length=readonly(length),
        substeps=np.ceil(length / step - 1e-6).astype(np.int64).clip(min=1),
        segment=segment.astype(np.int64),
        offset=readonly(np.maximum(start - inputs.breakpoints[segment], 0.0)),
        records=_among(start, recording, tolerance),
        updates=_among(start, sampling, tolerance),
    )


def _multiples(period: float, end: float) -> FloatArray:
    count = int(np.ceil(end / period - 1e-9))
    return period * np.arange(count, dtype=np.float64)


def _among(instants: FloatArray, chosen: FloatArray, tolerance: float) -> NDArray[np.bool_]:
    if chosen.size == 0:
        return np.zeros(instants.size, dtype=bool)
    nearest = np.clip(np.searchsorted(chosen, instants + tolerance) - 1, 0, None)
    return np.abs(instants - chosen[nearest]) <= tolerance
