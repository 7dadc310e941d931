"""When the beats come: lengths of successive beats, and the cardiac phase they give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.motion.jets import Jet, smooth_phase

_LARGEST_DEVIATION = 2.0
"""Random numbers are limited to this many standard deviations, so no draw is extravagant."""


class Rhythm(Protocol):
    """A source of beat lengths."""

    @property
    def mean_period(self) -> float:
        """Length of the average beat, s."""

    def intervals(self, count: int, random: np.random.Generator) -> FloatArray:
        """Lengths of the first `count` beats, s; a longer list starts with the shorter one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegularRhythm:
    """Every beat as long as the others."""

    mean_period: float
    """Length of a beat, s."""

    def __post_init__(self) -> None:
        _require_period(self.mean_period)

    def intervals(self, count: int, random: np.random.Generator) -> FloatArray:
        """`count` equal lengths, s."""
        return np.full(count, self.mean_period)


@dataclass(frozen=True, slots=True, kw_only=True)
class JitteredRhythm:
    """Beat lengths spread evenly within ± `jitter` of the mean, independent of each other."""

    mean_period: float
    """Length of the average beat, s."""
    jitter: float
    """Largest deviation as a fraction of the mean, 0 … 0.5."""

    def __post_init__(self) -> None:
        _require_period(self.mean_period)
        if not 0.0 <= self.jitter <= 0.5:
            raise ParameterError("jitter", self.jitter, "must lie in 0 … 0.5")

    def intervals(self, count: int, random: np.random.Generator) -> FloatArray:
        """`count` random lengths, s."""
        lengths: FloatArray = self.mean_period * (
            1.0 + self.jitter * random.uniform(-1.0, 1.0, count)
        )
        return lengths


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableRhythm:
    """Normally distributed beat lengths, each correlated with the one before."""

    mean_period: float
    """Length of the average beat, s."""
    deviation: float
    """Standard deviation of the length, s, at most a fifth of the mean."""
    correlation: float
    """Correlation of successive lengths, −1 < r < 1."""

    def __post_init__(self) -> None:
        _require_period(self.mean_period)
        if not 0.0 <= self.deviation <= 0.2 * self.mean_period:
            raise ParameterError("deviation", self.deviation, "must be 0 … mean_period / 5")
        if not -1.0 < self.correlation < 1.0:
            raise ParameterError("correlation", self.correlation, "must lie between −1 and 1")

    def intervals(self, count: int, random: np.random.Generator) -> FloatArray:
        """`count` random lengths, s."""
        scores = correlated_scores(count, np.array([self.correlation]), random)[0]
        lengths: FloatArray = self.mean_period + self.deviation * scores
        return lengths


@dataclass(frozen=True, slots=True, kw_only=True)
class WithEctopicBeat:
    """Another rhythm in which one beat comes early and a compensatory pause follows."""

    rhythm: Rhythm
    """The rhythm that is disturbed."""
    beat: int
    """Index of the shortened beat, 0 for the first."""
    prematurity: float
    """Fraction of the beat's length that is taken from it and given to the next, 0 … 0.6."""

    def __post_init__(self) -> None:
        if self.beat < 0:
            raise ParameterError("beat", self.beat, "must be 0 or more")
        if not 0.0 < self.prematurity <= 0.6:
            raise ParameterError("prematurity", self.prematurity, "must lie in 0 … 0.6")

    @property
    def mean_period(self) -> float:
        """Length of the undisturbed average beat, s."""
        return self.rhythm.mean_period

    def intervals(self, count: int, random: np.random.Generator) -> FloatArray:
        """The lengths of the disturbed rhythm, s."""
        lengths = self.rhythm.intervals(count, random).copy()
        if self.beat < count:
            moved = self.prematurity * lengths[self.beat]
            lengths[self.beat] -= moved
            if self.beat + 1 < count:
                lengths[self.beat + 1] += moved
        return lengths


def correlated_scores(
    count: int, correlations: FloatArray, random: np.random.Generator
) -> FloatArray:
    """First-order autoregressive sequences of unit variance, limited to ±2, (m, count).

    One sequence for each lag-one correlation in `correlations` (m,); a longer sequence starts
    with the shorter one of the same generator state.
    """
    noise = random.standard_normal((count, correlations.size))
    scores = np.empty_like(noise)
    innovation = np.sqrt(1.0 - correlations**2)
    for index in range(count):
        before = scores[index - 1] if index else noise[0]
        scores[index] = correlations * before + innovation * noise[index] if index else noise[0]
    limited: FloatArray = np.clip(scores.T, -_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    return limited


def cardiac_phase(
    t: FloatArray, intervals: FloatArray, *, mean_period: float, systole: float
) -> Jet:
    """Cardiac phase in beats at `t` (N,), s, for beats of the given `intervals` (n,), s, from 0.

    The first `systole` s of a beat (at most 80 % of a short one) pass as in a beat of
    `mean_period`; the rest, diastole, is stretched to fill the beat. systole = 0 stretches
    the whole beat. Changes of pace are spread over 15 % of the mean period.
    """
    fraction = systole / mean_period
    early = np.minimum(systole, 0.8 * intervals)
    late_rates = (1.0 - fraction) / (intervals - early)
    onsets = np.concatenate(([0.0], np.cumsum(intervals)))
    if systole == 0.0:
        return smooth_phase(t, onsets[1:-1], late_rates, 0.15 * mean_period)
    switches = np.stack((onsets[:-1] + early, onsets[1:]), axis=1).ravel()[:-1]
    rates = np.stack((fraction / early, late_rates), axis=1).ravel()
    return smooth_phase(t, switches, rates, 0.15 * mean_period)


def _require_period(period: float) -> None:
    if not (np.isfinite(period) and period > 0.0):
        raise ParameterError("mean_period", period, "must be a positive time in s")
