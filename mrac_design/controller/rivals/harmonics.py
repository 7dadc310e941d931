"""An observer that tells the beat's harmonics from everything else in the force.

    x⁺ = Φ x + Γ (u + p),   p⁺ = p + noise,   y = C x + Σ_i c_i,   c_i ⟲ 2π i f h + noise

Each harmonic is a rotation whose phase and size the filter keeps adapting; the slow p takes the
breathing. Rotating the estimates on gives the forecast of the beat's part of the force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.rivals.linear import Columns
from mrac_design.controller.rivals.observation import SampledModel, kalman_gain, sampled_plant
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class BeatObserver:
    """How the beat is told apart."""

    frequency: float
    """Heart rate f (Hz), taken as known."""
    harmonics: int
    """Number of harmonics, the fundamental included."""
    drive: float
    """Standard deviation of the harmonics' change from sample to sample (N)."""
    slow_drive: float
    """Standard deviation of the slow disturbance's change from sample to sample (m/s²)."""
    force_noise: float
    """Standard deviation of the force sensor's noise (N)."""

    def __post_init__(self) -> None:
        for name in ("frequency", "drive", "slow_drive", "force_noise"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ParameterError(name.replace("_", " "), value, "must be finite and > 0")
        if int(self.harmonics) != self.harmonics or self.harmonics < 1:
            raise ParameterError("harmonics", self.harmonics, "must be a whole number >= 1")

    @property
    def size(self) -> int:
        """Number of states: the plant's two, the slow disturbance, two for each harmonic."""
        return 3 + 2 * self.harmonics


def beat_model(observer: BeatObserver, plant: ForcePlant, domain: Discrete) -> SampledModel:
    """Plant with a slow disturbance at its input and the beat's harmonics at its output."""
    inner = sampled_plant(plant, domain, delay=0).with_disturbance(np.eye(1), np.ones(1))
    rotations = block_diag(*(_rotation(observer, domain, i, 1) for i in _orders(observer)))
    return SampledModel(
        transition=readonly(block_diag(inner.transition, rotations)),
        input=readonly(np.concatenate([inner.input, np.zeros(2 * observer.harmonics)])),
        output=readonly(np.concatenate([inner.output, np.tile([1.0, 0.0], observer.harmonics)])),
        delay=0,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeatRows:
    """The observer in the columns of a controller."""

    observer: BeatObserver
    """How the beat is told apart."""
    domain: Discrete
    """Sampling."""
    filtered: FloatArray
    """Filtered state, (size, columns)."""
    following: dict[str, FloatArray]
    """How the observer's block advances."""

    def forecast(self, ahead: int) -> FloatArray:
        """Row of the beat's part of the force `ahead` samples from now (N), (columns,)."""
        row = np.zeros(self.filtered.shape[1])
        for i in _orders(self.observer):
            turned = _rotation(self.observer, self.domain, i, ahead)[0]
            row += turned @ self.filtered[1 + 2 * i : 3 + 2 * i]
        return row


def beat_observer_rows(
    columns: Columns,
    observer: BeatObserver,
    plant: ForcePlant,
    domain: Discrete,
    *,
    delay: int,
    command: FloatArray,
) -> BeatRows:
    """The observer over the block `beat_observer`.

    The command acting now is found in the block `commands` (newest first) behind the dead time,
    or is `command` itself without one.
    """
    model = beat_model(observer, plant, domain)
    drive = np.diag([0.0, 0.0, observer.slow_drive] + [observer.drive] * 2 * observer.harmonics)
    gain = kalman_gain(model, drive, observer.force_noise)
    predicted = columns.block("beat_observer")
    filtered = predicted + np.outer(gain, columns.force - model.output @ predicted)
    acting = columns.block("commands")[delay - 1] if delay else command
    following = model.transition @ filtered + np.outer(model.input, acting)
    return BeatRows(
        observer=observer,
        domain=domain,
        filtered=filtered,
        following={"beat_observer": following},
    )


def _orders(observer: BeatObserver) -> range:
    return range(1, observer.harmonics + 1)


def _rotation(observer: BeatObserver, domain: Discrete, order: int, steps: int) -> FloatArray:
    angle = 2.0 * np.pi * order * observer.frequency * domain.period * steps
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
