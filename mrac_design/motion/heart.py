"""The motion of one point of the beating heart, with where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial

AXES = ("X", "Y", "Z")
"""Names of the three channels of a heart motion."""


class Origin(Enum):
    """How far a number or a signal can be trusted; the value is the word shown to people."""

    RECORDED = "recorded"
    FITTED = "fitted to a recording"
    ASSUMED = "assumed"
    DERIVED = "derived"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeartMotion:
    """Displacement of the heart's surface at the contact point, about its mean position.

    The displacement need not vanish at t = 0: a simulation starts the robot's tip on the
    surface, at `initial_displacement`, so that no jump of position occurs.
    """

    name: str
    """Short name, as shown in tables."""
    origin: Origin
    """Recorded, fitted to a recording, or assumed."""
    source: str
    """Publication, data set or file the motion comes from."""
    assumptions: tuple[str, ...]
    """Everything that had to be assumed to make the motion, one sentence each."""
    displacement: PiecewisePolynomial
    """X, Y, Z from t = 0, m, continuous, zero mean over the duration."""

    def __post_init__(self) -> None:
        signal = self.displacement
        if signal.channels != len(AXES):
            raise ParameterError("displacement", f"{signal.channels} channels", "must be X, Y, Z")
        if signal.start != 0.0:
            raise ParameterError("displacement.start", signal.start, "must be 0 s")
        object.__setattr__(self, "assumptions", tuple(self.assumptions))

    @property
    def duration(self) -> float:
        """Length of the motion, s."""
        return self.displacement.end

    @property
    def initial_displacement(self) -> FloatArray:
        """Displacement at t = 0, m, (3,)."""
        return self.displacement([0.0])[:, 0]

    @property
    def peak_to_peak(self) -> FloatArray:
        """Largest minus smallest displacement of each axis, m, (3,)."""
        return self.displacement.peak_to_peak()

    @property
    def peak_velocity(self) -> FloatArray:
        """Largest |velocity| of each axis, m/s, (3,)."""
        return self.displacement.derivative().largest_magnitude()

    @property
    def peak_acceleration(self) -> FloatArray:
        """Largest |acceleration| of each axis, m/s², (3,)."""
        return self.displacement.derivative().derivative().largest_magnitude()

    def _repr_markdown_(self) -> str:
        """Name, origin, the numbers of each axis and the assumptions."""
        columns = (self.peak_to_peak * 1e3, self.peak_velocity * 1e3, self.peak_acceleration)
        rows = [
            f"| {axis} | {span:.2f} | {velocity:.1f} | {acceleration:.2f} |"
            for axis, span, velocity, acceleration in zip(AXES, *columns, strict=True)
        ]
        return "\n".join(
            [
                f"**Heart motion “{self.name}”** — {self.origin.value}, {self.duration:g} s  ",
                f"Source: {self.source}",
                "",
                "| axis | peak to peak, mm | peak velocity, mm/s | peak acceleration, m/s² |",
                "|---|---|---|---|",
                *rows,
                "",
                "Assumed or chosen:",
                "",
                *(f"- {item}" for item in self.assumptions),
            ]
        )


def centred_motion(
    *,
    name: str,
    origin: Origin,
    source: str,
    assumptions: tuple[str, ...],
    displacement: PiecewisePolynomial,
) -> HeartMotion:
    """A HeartMotion of `displacement`, m, less its time average.

    Raises ParameterError as HeartMotion does.
    """
    centred = displacement.shifted(-np.asarray(displacement.mean()))
    return HeartMotion(
        name=name, origin=origin, source=source, assumptions=assumptions, displacement=centred
    )
