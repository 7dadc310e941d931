"""An observer that tells the harmonics of beat and breath from everything else in the force.

    x⁺ = Φ x + Γ (u + p),   p⁺ = p + noise,   y = C x + Σ_i c_i,   c_i ⟲ 2π i f h + noise

Each harmonic is a rotation whose phase and size the filter keeps adapting; the slow p takes what
is left, and the breathing too unless it is given as a rhythm of its own. Rotating the estimates on
gives the forecast of their part of the force.

A breath so described is the internal model 1 − q⁻ᵀ of [Ginhoux 2005] with its first harmonics
only: two states each, where the polynomial would keep T = thousands of samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.rivals.linear import Columns
from mrac_design.controller.rivals.observation import SampledModel, kalman_gain, sampled_plant
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class Rhythm:
    """Something periodic in the force: the beat, or the breath."""

    frequency: float
    """Frequency f (Hz), taken as known."""
    harmonics: int
    """Number of harmonics, the fundamental included."""
    drive: float
    """Standard deviation of the harmonics' change from sample to sample (N)."""

    def __post_init__(self) -> None:
        _require_positive(self, "frequency", "drive")
        if int(self.harmonics) != self.harmonics or self.harmonics < 1:
            raise ParameterError("harmonics", self.harmonics, "must be a whole number >= 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class RhythmObserver:
    """How the periodic parts of the force are told apart."""

    rhythms: tuple[Rhythm, ...]
    """The beat and, if it is known, the breath; their harmonics must all differ."""
    slow_drive: float
    """Standard deviation of the slow disturbance's change from sample to sample (m/s²)."""
    force_noise: float
    """Standard deviation of the force sensor's noise (N)."""

    def __post_init__(self) -> None:
        _require_positive(self, "slow_drive", "force_noise")
        met = sorted(frequency for frequency, _ in self.lines)
        if not met or any(b - a < 1e-6 for a, b in pairwise(met)):
            raise ParameterError("rhythms", self.rhythms, "need harmonics that all differ")

    @property
    def lines(self) -> tuple[tuple[float, float], ...]:
        """Frequency (Hz) and drive (N) of every harmonic, in the order of the state."""
        return tuple(
            (order * rhythm.frequency, rhythm.drive)
            for rhythm in self.rhythms
            for order in range(1, rhythm.harmonics + 1)
        )

    @property
    def size(self) -> int:
        """Number of states: the plant's two, the slow disturbance, two for each harmonic."""
        return 3 + 2 * len(self.lines)


def rhythm_model(observer: RhythmObserver, plant: ForcePlant, domain: Discrete) -> SampledModel:
    """Plant with a slow disturbance at its input and the harmonics at its output."""
    inner = sampled_plant(plant, domain, delay=0).with_disturbance(np.eye(1), np.ones(1))
    rotations = block_diag(*(_rotation(frequency, domain, 1) for frequency, _ in observer.lines))
    count = len(observer.lines)
    return SampledModel(
        transition=readonly(block_diag(inner.transition, rotations)),
        input=readonly(np.concatenate([inner.input, np.zeros(2 * count)])),
        output=readonly(np.concatenate([inner.output, np.tile([1.0, 0.0], count)])),
        delay=0,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RhythmRows:
    """The observer in the columns of a controller."""

    observer: RhythmObserver
    """How the periodic parts are told apart."""
    domain: Discrete
    """Sampling."""
    filtered: FloatArray
    """Filtered state, (size, columns)."""
    following: dict[str, FloatArray]
    """How the observer's block advances."""

    def forecast(self, ahead: int) -> FloatArray:
        """Row of the periodic part of the force `ahead` samples from now (N), (columns,)."""
        row = np.zeros(self.filtered.shape[1])
        for i, (frequency, _) in enumerate(self.observer.lines):
            turned = _rotation(frequency, self.domain, ahead)[0]
            row += turned @ self.filtered[3 + 2 * i : 5 + 2 * i]
        return row


def rhythm_observer_rows(
    columns: Columns,
    observer: RhythmObserver,
    plant: ForcePlant,
    domain: Discrete,
    *,
    delay: int,
    command: FloatArray,
) -> RhythmRows:
    """The observer over the block `rhythm_observer`.

    The command acting now is found in the block `commands` (newest first) behind the dead time,
    or is `command` itself without one.
    """
    model = rhythm_model(observer, plant, domain)
    drives = np.repeat([drive for _, drive in observer.lines], 2)
    drive = np.diag([0.0, 0.0, observer.slow_drive, *drives])
    gain = kalman_gain(model, drive, observer.force_noise)
    predicted = columns.block("rhythm_observer")
    filtered = predicted + np.outer(gain, columns.force - model.output @ predicted)
    acting = columns.block("commands")[delay - 1] if delay else command
    following = model.transition @ filtered + np.outer(model.input, acting)
    return RhythmRows(
        observer=observer,
        domain=domain,
        filtered=filtered,
        following={"rhythm_observer": following},
    )


def _rotation(frequency: float, domain: Discrete, steps: int) -> FloatArray:
    angle = 2.0 * np.pi * frequency * domain.period * steps
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _require_positive(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not 0 < value < float("inf"):
            raise ParameterError(name.replace("_", " "), value, "must be finite and > 0")
