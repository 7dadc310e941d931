"""Force references: piecewise-constant sequences of steps, one for each force axis."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial, stack


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSequence:
    """Force demanded on one axis: `levels[i]` from `times[i]` until the next instant."""

    times: tuple[float, ...]
    """Instants at which the level changes, s; the first is 0, then increasing."""
    levels: tuple[float, ...]
    """Force from each instant on, N, as many as `times`."""

    def __post_init__(self) -> None:
        times = tuple(float(item) for item in self.times)
        levels = tuple(float(item) for item in self.levels)
        if not times or len(times) != len(levels):
            raise ParameterError(
                "times and levels", f"{len(times)} and {len(levels)} numbers", "need one level each"
            )
        if not np.isfinite(times).all() or not np.isfinite(levels).all():
            raise ParameterError("times and levels", (times, levels), "must be finite")
        if times[0] != 0.0:
            raise ParameterError("times[0]", times[0], "must be 0, so the force is always defined")
        if any(after <= before for before, after in pairwise(times)):
            raise ParameterError("times", times, "must increase strictly")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "levels", levels)

    def piecewise(self, end: float) -> PiecewisePolynomial:
        """One channel, N, on [0, end] s; steps at or after `end` are left out."""
        if not (np.isfinite(end) and end > 0.0):
            raise ParameterError("end", end, "must be a positive time in s")
        count = sum(instant < end for instant in self.times)
        return PiecewisePolynomial(
            breakpoints=np.array([*self.times[:count], end]),
            coefficients=np.array(self.levels[:count]).reshape(1, -1, 1),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceReference:
    """Force reference before the pre-filter [Z 5], one step sequence for each force axis."""

    steps: tuple[StepSequence, ...]
    """Sequences in the order of the robot's force axes (X, Y, Z)."""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ParameterError("steps", (), "needs a step sequence for each force axis")
        object.__setattr__(self, "steps", tuple(self.steps))

    @property
    def initial(self) -> FloatArray:
        """Force of each axis at time 0, N, shape (axes,)."""
        return readonly([axis.levels[0] for axis in self.steps])

    @property
    def peak(self) -> tuple[float, ...]:
        """Largest |level| of each axis, N."""
        return tuple(max(abs(level) for level in axis.levels) for axis in self.steps)

    def piecewise(self, end: float) -> PiecewisePolynomial:
        """All axes as channels, N, on [0, end] s, on common breakpoints."""
        return stack(*(axis.piecewise(end) for axis in self.steps))


def constant_force(level: float) -> StepSequence:
    """A force of `level` N for all time."""
    return StepSequence(times=(0.0,), levels=(level,))


def square_wave(
    *, first: float, second: float, half_period: float, first_switch: float, duration: float
) -> StepSequence:
    """`first` N until `first_switch` s, then `second` and `first` in turn, `half_period` s each.

    Steps stop before `duration`, s. Raises ParameterError unless the three times are positive.
    """
    for name, value in (
        ("half_period", half_period),
        ("first_switch", first_switch),
        ("duration", duration),
    ):
        if not (np.isfinite(value) and value > 0.0):
            raise ParameterError(name, value, "must be a positive time in s")
    count = max(0, int(np.ceil((duration - first_switch) / half_period - 1e-9)))
    switches = tuple(first_switch + index * half_period for index in range(count))
    levels = tuple(second if index % 2 == 0 else first for index in range(count))
    return StepSequence(times=(0.0, *switches), levels=(first, *levels))
