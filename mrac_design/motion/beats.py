"""Finding the beats of a recorded motion: the most repeatable stretch, matched everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from mrac_design.arrays import FloatArray, readonly

WINDOW = 0.6
"""Length of the matched stretch as a fraction of the beat: about systole and relaxation."""
SHORTEST, LONGEST = 0.72, 1.45
"""Range of the beat lengths that are looked for, as fractions of the typical one."""
SPREAD = 0.1
"""Deviation of the beat length, as a fraction, at which its penalty is one unit."""
PENALTY = 0.02
"""Unit of that penalty as a fraction of a stretch's mean square: weak, the shapes decide."""
LIKENESS = 0.75
"""Share of the highest autocorrelation that makes a lag the beat's: two or three regular beats
are as alike as one, and a beat between two frames is less alike than two of them; halves of a
beat were never met above 0.65."""
REWARD = 0.8
"""Fraction of a stretch's mean square a match may leave unexplained and still be a beat."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Beats:
    """The beats found in a motion."""

    onsets: FloatArray
    """Start of the matched stretch of each beat, s, increasing."""
    typical_interval: float
    """Typical length of a beat, from the autocorrelation of the motion, s."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "onsets", readonly(self.onsets, (-1,)))


def find_beats(position: FloatArray, *, frame_rate: float, training: int) -> Beats:
    """Beats of a motion (frames, 3) without its breathing part, at `frame_rate`, Hz.

    Every stretch of the first three beats is tried as a template; the one that explains most
    of the first `training` frames is refined as the mean of its own matches among them. A
    chain of matches with plausible intervals is found by dynamic programming. Times in s.
    """
    typical = _typical_interval(position[:training], frame_rate)
    spline = CubicSpline(np.arange(position.shape[0]) / frame_rate, position)
    length = WINDOW * typical
    ages = np.linspace(0.0, length, round(2.0 * length * frame_rate) + 1)
    end = (position.shape[0] - 1) / frame_rate - length
    coarse = np.arange(0.0, end, 0.5 / frame_rate)
    windows = spline(np.add.outer(coarse, ages))
    in_training = coarse < training / frame_rate - length
    best_cost, template = np.inf, windows[0]
    for candidate in windows[coarse < 3.0 * typical][::2]:
        cost = _chain(coarse[in_training], windows[in_training], candidate, typical)[1]
        if cost < best_cost:
            best_cost, template = cost, candidate
    fine = np.arange(0.0, end, 0.1 / frame_rate)
    windows = spline(np.add.outer(fine, ages))
    onsets = np.empty(0)
    for _ in range(8):
        found = fine[_chain(fine, windows, template, typical)[0]]
        if found.size == onsets.size and np.array_equal(found, onsets):
            break
        onsets = found
        used = onsets[onsets < training / frame_rate - length]
        template = spline(np.add.outer(used, ages)).mean(axis=0)
    return Beats(onsets=onsets, typical_interval=typical)


def _typical_interval(position: FloatArray, frame_rate: float) -> float:
    """First lag between 0.4 and 2 s at which the autocorrelation peaks as high as anywhere, s."""
    centred = position - position.mean(axis=0)
    lags = np.arange(int(0.4 * frame_rate), int(2.0 * frame_rate) + 1)
    around = range(lags[0] - 1, lags[-1] + 2)
    both = np.array([np.mean(centred[lag:] * centred[: len(centred) - lag]) for lag in around])
    correlation = both[1:-1]
    peaks = (correlation >= both[:-2]) & (correlation >= both[2:])
    alike = peaks & (correlation >= LIKENESS * correlation.max())
    # A motion that never resembles itself has no such peak.
    first = np.argmax(alike) if alike.any() else np.argmax(correlation)
    return float(lags[first] / frame_rate)


def _chain(
    starts: FloatArray, windows: FloatArray, template: FloatArray, typical: float
) -> tuple[list[int], float]:
    """Indices of the cheapest chain of windows like `template`, and its cost.

    A window costs its mean square distance from the template less a reward, relative to the
    template's own mean square, so a chain grows where it explains the motion.
    """
    scale = float(np.mean((template - template.mean(axis=0)) ** 2))
    price = np.mean((windows - template) ** 2, axis=(1, 2)) / scale - REWARD
    step = starts[1] - starts[0]
    near, far = round(SHORTEST * typical / step), round(LONGEST * typical / step)
    # penalty[j] belongs to an interval of far − j steps.
    intervals = step * np.arange(far, near - 1, -1)
    penalty = PENALTY * ((intervals / typical - 1.0) / SPREAD) ** 2
    total, before = price.copy(), np.full(price.size, -1)
    for index in range(near, price.size):
        first = max(0, index - far)
        reach = total[first : index - near + 1] + penalty[first - (index - far) :]
        best = int(np.argmin(reach))
        if reach[best] < 0.0:
            total[index] += reach[best]
            before[index] = first + best
    index = int(np.argmin(total))
    cost = float(total[index])
    chain = []
    while index >= 0:
        chain.append(index)
        index = int(before[index])
    return chain[::-1], cost
