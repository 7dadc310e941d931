"""Judging a tuned contestant: motions it was not tuned on, many draws of the sensor's noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.bench import Bench, Sensing, root_mean_square
from mrac_design.comparison.contestant import Contestant
from mrac_design.comparison.setting import Condition
from mrac_design.errors import MracDesignError, ParameterError

CONFIDENCE = 0.95
"""Coverage of all intervals."""
FIRST_SEED = 1000
"""Seed of the first noise of judging; the tuner's is another."""
LOST = 1.0
"""A loop whose force error exceeds this has lost control (N): the contact itself is 1 N."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """Force errors of one contestant under one condition, one entry for every noise."""

    rms: FloatArray
    """Rms force errors (N), inf where the loop diverged, (seeds,)."""
    largest: FloatArray
    """Largest |force error| (N), inf where the loop diverged, (seeds,)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rms", readonly(self.rms, (-1,)))
        object.__setattr__(self, "largest", readonly(self.largest, (self.rms.size,)))
        if self.rms.size < 2:
            raise ParameterError("seeds", self.rms.size, "an interval needs at least 2")

    @property
    def lost(self) -> bool:
        """Whether the loop lost control in any run."""
        return not bool(np.all(self.largest < LOST))

    @property
    def mean(self) -> float:
        """Mean rms force error (N)."""
        return float(self.rms.mean())

    @property
    def half_width(self) -> float:
        """Half width of the t-interval of the mean (N), over draws of the noise."""
        if not np.isfinite(self.rms).all():
            return math.inf
        return interval_half_width(self.rms)

    @property
    def worst(self) -> float:
        """Largest |force error| of all runs (N)."""
        return float(self.largest.max())


def interval_half_width(samples: FloatArray) -> float:
    """Half width of the two-sided t-interval of a mean at CONFIDENCE."""
    from scipy.stats import t

    count = samples.size
    quantile = float(t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1))
    return quantile * float(samples.std(ddof=1)) / math.sqrt(count)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judgement:
    """Everything measured of one tuned contestant."""

    conditions: Mapping[str, Measured]
    """Measured errors by condition."""
    motion_error: float
    """Rms force error on the first condition with a perfect sensor (N)."""
    amplification: float
    """Rms force the sensor's noise causes there, over the rms of that noise."""


def judge(
    contestant: Contestant,
    values: FloatArray,
    bench: Bench,
    conditions: Sequence[Condition],
    *,
    seeds: int,
    progress: Callable[[float], None] | None = None,
) -> Judgement:
    """Run a tuned contestant under every condition with `seeds` draws of noise, at least 2.

    Laws that take usual beat and breath as known are told each condition's own.
    """
    setting = bench.setting
    measured: dict[str, Measured] = {}
    noisy: FloatArray | None = None
    for number, condition in enumerate(conditions):
        axis = contestant.build(setting, condition.periods, values)
        rms, largest = np.full((2, seeds), np.inf)
        for run in range(seeds):
            sensing = Sensing.of(setting, FIRST_SEED + run)
            try:
                error = bench.force_error(axis, condition, sensing)
            except MracDesignError:
                break  # it diverged, as it would under any other noise
            rms[run], largest[run] = root_mean_square(error), float(np.abs(error).max())
            if number == run == 0:
                noisy = error
        measured[condition.name] = Measured(rms=rms, largest=largest)
        if progress is not None:
            progress((number + 1) / len(conditions))
    motion_error, amplification = math.inf, math.inf
    if noisy is not None:
        axis = contestant.build(setting, conditions[0].periods, values)
        clean = bench.force_error(axis, conditions[0], Sensing.perfect())
        motion_error = root_mean_square(clean)
        # The same motion with and without noise: what differs is the noise's doing.
        amplification = root_mean_square(noisy - clean) / setting.sensor_noise
    return Judgement(conditions=measured, motion_error=motion_error, amplification=amplification)
