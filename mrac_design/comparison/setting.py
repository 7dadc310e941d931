"""What every contestant of a comparison faces: the axis, its sensor, and the motions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete

INPUT_DEGREE = 5
"""Degree all motions are written in, so that one compiled loop runs them all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSetting:
    """One sampled force axis and the rule of robustness, the same for every contestant."""

    stiffness: float
    """Ks every contestant is designed for, and tuned on (N/m)."""
    velocity_gain: float
    """K2 of the velocity loop (1/s)."""
    period: float
    """Sampling period (s)."""
    delay: int
    """Whole samples between a measurement and its command."""
    noise: float
    """Standard deviation of the force sensor's noise (N), > 0."""
    resolution: float
    """Step between its readings (N), > 0."""
    prefilter: ReferenceModel
    """Pre-filter Hm of the force reference [Z 5]."""
    extra_delay: int
    """Samples of additional dead time the loop has to bear."""
    allowed_growth: float
    """Factor by which that dead time may raise the rms force error, > 1."""

    def __post_init__(self) -> None:
        for name in ("noise", "resolution", "period"):
            if not 0 < getattr(self, name) < math.inf:
                raise ParameterError(name, getattr(self, name), "must be finite and > 0")
        for name in ("delay", "extra_delay"):
            value = getattr(self, name)
            if int(value) != value or value < 0:
                raise ParameterError(name, value, "must be a whole number of samples >= 0")
        if not 1 < self.allowed_growth < math.inf:
            raise ParameterError("allowed growth", self.allowed_growth, "must be > 1")
        self.plant  # noqa: B018  raises for a plant that cannot be

    @property
    def plant(self) -> ForcePlant:
        """Plant of the design."""
        return ForcePlant(stiffness=self.stiffness, velocity_gain=self.velocity_gain)

    @property
    def domain(self) -> Discrete:
        """Time domain of the controllers."""
        return Discrete(self.period)

    @property
    def sensor_noise(self) -> float:
        """Noise and quantisation together (N), the latter as uniform and independent."""
        return math.sqrt(self.noise**2 + self.resolution**2 / 12.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Periods:
    """What laws that take the motion's rhythms as known are told."""

    beat: float
    """Length of the usual beat (s), > 0."""
    breath: float
    """Length of a breath (s), > 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Condition:
    """A motion, a force reference and a tissue under which contestants are run."""

    name: str
    """Key in tables and files."""
    title: str
    """Name for people."""
    heart: PiecewisePolynomial
    """Motion of the surface (m), one channel from 0 s."""
    reference: PiecewisePolynomial
    """Force reference before the pre-filter (N), one channel over the same time."""
    beats: FloatArray
    """Instants at which beats begin (s), increasing: what an ECG would show, (beats,)."""
    periods: Periods
    """Usual beat and breath: what laws that take them as known are told."""
    stiffness_factor: float
    """True stiffness over the design's."""
    settling: float
    """Instant from which the force error counts (s)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "beats", readonly(self.beats, (-1,)))
        object.__setattr__(self, "heart", of_degree(self.heart, INPUT_DEGREE))
        if not 0 <= self.settling < self.duration:
            raise ParameterError("settling", self.settling, "must lie inside the motion")

    @property
    def duration(self) -> float:
        """Length of the run (s)."""
        return self.heart.end

    def beat_age(self) -> PiecewisePolynomial:
        """Time since the last beat began (s); before the first, since one period earlier."""
        inside = self.beats[(self.beats > 1e-9) & (self.beats < self.duration - 1e-9)]
        before = self.beats[self.beats <= 1e-9]
        first = 0.0 if before.size == 0 else -float(before[-1])
        if before.size == 0 and inside.size:
            first = max(0.0, self.periods.beat - float(inside[0]))
        ages = np.concatenate([[first], np.zeros(inside.size)])
        return PiecewisePolynomial(
            breakpoints=np.concatenate([[0.0], inside, [self.duration]]),
            coefficients=np.stack([ages, np.ones(ages.size)], axis=1)[None],
        )


def of_degree(signal: PiecewisePolynomial, degree: int) -> PiecewisePolynomial:
    """The same function written with powers up to `degree`, at least its own."""
    missing = degree - signal.degree
    if missing < 0:
        raise ParameterError("degree", degree, f"is below the signal's own {signal.degree}")
    return PiecewisePolynomial(
        breakpoints=signal.breakpoints,
        coefficients=np.pad(signal.coefficients, ((0, 0), (0, 0), (0, missing))),
    )
