"""A contestant: a name, what its law needs, and a controller for every tuning vector."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.setting import AxisSetting, Periods
from mrac_design.controller.step import ControllerStep
from mrac_design.errors import ParameterError


class Family(Enum):
    """Where a contestant belongs; the value is the word shown to people."""

    FROZEN = "fixed RST"
    ADAPTIVE = "adaptive RST"
    RIVAL = "rival"


@dataclass(frozen=True, slots=True, kw_only=True)
class Features:
    """What a law asks for and offers, beside its error."""

    motion_model: bool
    """Needs a model of the motion (a disturbance model, harmonics, a remembered period)."""
    periodicity: bool
    """Needs the motion to repeat."""
    ecg: bool
    """Needs the instants of the beats."""
    adapts: bool
    """Adapts its feedback gains to the tissue's stiffness."""
    linear: bool
    """Is linear, so that the limit of linear control binds it."""
    proof: str
    """What is proved about its closed loop, a few words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningParameter:
    """A positive number the tuner chooses, searched on a logarithmic scale."""

    name: str
    """Name for people, Markdown."""
    unit: str
    """Unit; empty for a pure number."""
    low: float
    """Least value, > 0."""
    high: float
    """Greatest value."""
    start: float
    """Where the search begins, between them."""

    def __post_init__(self) -> None:
        if not 0 < self.low <= self.start <= self.high < float("inf") or self.low == self.high:
            raise ParameterError(
                self.name, (self.low, self.start, self.high), "needs 0 < low <= start <= high"
            )


LEAD = TuningParameter(name="lead", unit="s", low=1e-4, high=5e-3, start=1.5e-3)
"""The lead as the tuner sees it: every contestant with a model's inverse may choose it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TunedAxis:
    """A controller with the velocity loop it stands on."""

    step: ControllerStep
    """The controller."""
    velocity_gain: float
    """K2 (1/s)."""


Build = Callable[[AxisSetting, Periods, FloatArray], TunedAxis]
"""(setting, usual beat and breath, tuning vector) → controller; raises the package's errors."""
Proof = Callable[[AxisSetting, FloatArray], bool]
"""(setting, tuning vector) → whether the proof the contestant claims was found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contestant:
    """One law, ready to be tuned."""

    name: str
    """Key in tables and files."""
    title: str
    """Name for people."""
    family: Family
    """Where it belongs."""
    features: Features
    """What it needs and offers."""
    parameters: tuple[TuningParameter, ...]
    """What the tuner chooses, in the order of the tuning vector."""
    base: int
    """How many of them, the first ones, make the controller that the others adapt; these are tuned
    first, with the others where they start."""
    build: Build
    """Makes the controller."""
    proof: Proof | None = None
    """A proof every admissible tuning must have; None asks for none."""

    @property
    def start(self) -> FloatArray:
        """Tuning vector the search begins with, (parameters,)."""
        return readonly([parameter.start for parameter in self.parameters])

    def values(self, position: ArrayLike) -> FloatArray:
        """Tuning vector at a position in the unit cube, (parameters,)."""
        logarithms = self._logarithms()
        share = np.clip(np.asarray(position, dtype=float), 0.0, 1.0)
        return readonly(np.exp(logarithms[0] + share * (logarithms[1] - logarithms[0])))

    def position(self, values: ArrayLike) -> FloatArray:
        """Position of a tuning vector in the unit cube, (parameters,)."""
        low, high = self._logarithms()
        return readonly((np.log(np.asarray(values, dtype=float)) - low) / (high - low))

    def _logarithms(self) -> tuple[FloatArray, FloatArray]:
        return (
            np.log([parameter.low for parameter in self.parameters]),
            np.log([parameter.high for parameter in self.parameters]),
        )
