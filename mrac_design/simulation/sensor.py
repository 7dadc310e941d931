"""Force sensors of a sampled loop: a flexible mode, noise, quantisation and a rate of their own.

    force ─► mode ──►(+)──► quantiser ──► taken every m-th sample, held in between ──► reading
                      ▲
                    noise and bias (an input of the loop, constant over a sampling period)

Noise comes from outside, drawn beforehand, so that a run is a function of its inputs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial


class Quantiser(Protocol):
    """How finely a sensor reads."""

    def parameters(self) -> Mapping[str, float]:
        """Numbers that become inputs of the generated code, by name."""

    def read(self, value: ca.SX, symbols: Mapping[str, ca.SX]) -> ca.SX:
        """Reading of `value`, same shape and unit."""


@dataclass(frozen=True, slots=True)
class FineReading:
    """Every value is read as it is."""

    def parameters(self) -> Mapping[str, float]:
        return {}

    def read(self, value: ca.SX, symbols: Mapping[str, ca.SX]) -> ca.SX:
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformQuantiser:
    """Readings are multiples of a resolution, the nearest one."""

    resolution: float
    """Step between readings (N), > 0."""

    def __post_init__(self) -> None:
        if not 0 < self.resolution < math.inf:
            raise ParameterError("resolution", self.resolution, "must be a force > 0 N")

    def parameters(self) -> Mapping[str, float]:
        return {"resolution": self.resolution}

    def read(self, value: ca.SX, symbols: Mapping[str, ca.SX]) -> ca.SX:
        return symbols["resolution"] * ca.floor(value / symbols["resolution"] + 0.5)


class ForceSensing(Protocol):
    """A force sensor read by a sampled controller, k force axes."""

    def state(self, axes: int) -> Layout:
        """Its continuous states."""

    def rate(
        self, states: Mapping[str, ca.SX], force: ca.SX, symbols: Mapping[str, ca.SX]
    ) -> Mapping[str, ca.SX]:
        """Derivatives of its states under the contact force (N), by name."""

    def resting(self, force: FloatArray) -> Mapping[str, FloatArray]:
        """Its states after a long rest at `force` (N), by name."""

    def memory(self, axes: int) -> Layout:
        """What it holds between samples, `measured_force` (N) among it."""

    def parameters(self) -> Mapping[str, float]:
        """Numbers that become inputs of the generated code, by name."""

    def sample(
        self,
        memory: Mapping[str, ca.SX],
        force: ca.SX,
        noise: ca.SX,
        symbols: Mapping[str, ca.SX],
        states: Mapping[str, ca.SX],
    ) -> Mapping[str, ca.SX]:
        """The memory after a sampling instant; its `measured_force` (N) is what is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensor:
    """A stiff force sensor read by a sampled controller."""

    decimation: int
    """The controller's samples per reading, an integer ≥ 1: 1 is a reading every sample."""
    quantiser: Quantiser
    """How finely it reads."""

    def __post_init__(self) -> None:
        if not (isinstance(self.decimation, int) and self.decimation >= 1):
            raise ParameterError(
                "decimation", self.decimation, "must be a whole number of samples ≥ 1"
            )

    def state(self, axes: int) -> Layout:
        """None: it follows the force at once."""
        return Layout(())

    def rate(
        self, states: Mapping[str, ca.SX], force: ca.SX, symbols: Mapping[str, ca.SX]
    ) -> Mapping[str, ca.SX]:
        """None, as it has no state."""
        return {}

    def resting(self, force: FloatArray) -> Mapping[str, FloatArray]:
        """None, as it has no state."""
        return {}

    def memory(self, axes: int) -> Layout:
        """What it holds between samples: how many until the next reading, and the last reading."""
        return Layout((("sensor_wait", 1), ("measured_force", axes)))

    def parameters(self) -> Mapping[str, float]:
        """Numbers that become inputs of the generated code, by name."""
        return {"decimation": float(self.decimation), **self.quantiser.parameters()}

    def sample(
        self,
        memory: Mapping[str, ca.SX],
        force: ca.SX,
        noise: ca.SX,
        symbols: Mapping[str, ca.SX],
        states: Mapping[str, ca.SX],
    ) -> Mapping[str, ca.SX]:
        """The memory after a sampling instant; its `measured_force` (N) is what is measured."""
        due = memory["sensor_wait"] <= 0
        fresh = self.quantiser.read(force + noise, symbols)
        return {
            "sensor_wait": ca.if_else(due, symbols["decimation"], memory["sensor_wait"]) - 1,
            "measured_force": ca.if_else(due, fresh, memory["measured_force"]),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class WithFlexibleMode:
    """The sensor inside behind an elastic body that rings: ẍ + 2ζω ẋ + ω² x = ω² F."""

    sensor: ForceSensing
    """The sensor inside, which reads x."""
    frequency: float
    """Natural frequency ω/2π (Hz), > 0."""
    damping: float
    """ζ, > 0; a few per cent for metal."""

    def __post_init__(self) -> None:
        for name in ("frequency", "damping"):
            if not 0 < getattr(self, name) < math.inf:
                raise ParameterError(f"sensor mode {name}", getattr(self, name), "must be > 0")

    def state(self, axes: int) -> Layout:
        """The mode's force and its rate, beside the states of the sensor inside."""
        inner = self.sensor.state(axes).blocks
        return Layout((*inner, ("felt_force", axes), ("felt_force_rate", axes)))

    def rate(
        self, states: Mapping[str, ca.SX], force: ca.SX, symbols: Mapping[str, ca.SX]
    ) -> Mapping[str, ca.SX]:
        """Derivatives of the mode under the contact force (N), by name."""
        x, rate = states["felt_force"], states["felt_force_rate"]
        stiffness, damping = symbols["mode_stiffness"], symbols["mode_damping"]
        return {
            **self.sensor.rate(states, x, symbols),
            "felt_force": rate,
            "felt_force_rate": stiffness * (force - x) - damping * rate,
        }

    def resting(self, force: FloatArray) -> Mapping[str, FloatArray]:
        """The mode settled on `force` (N), by name."""
        still = np.zeros_like(force)
        return {**self.sensor.resting(force), "felt_force": force, "felt_force_rate": still}

    def memory(self, axes: int) -> Layout:
        """That of the sensor inside."""
        return self.sensor.memory(axes)

    def parameters(self) -> Mapping[str, float]:
        """Numbers that become inputs of the generated code, by name."""
        w = 2 * math.pi * self.frequency
        own = {"mode_stiffness": w**2, "mode_damping": 2 * self.damping * w}
        return {**self.sensor.parameters(), **own}

    def sample(
        self,
        memory: Mapping[str, ca.SX],
        force: ca.SX,
        noise: ca.SX,
        symbols: Mapping[str, ca.SX],
        states: Mapping[str, ca.SX],
    ) -> Mapping[str, ca.SX]:
        """The memory after a sampling instant: the sensor inside reads the mode's force."""
        return self.sensor.sample(memory, states["felt_force"], noise, symbols, states)


PERFECT_SENSOR = ForceSensor(decimation=1, quantiser=FineReading())
"""Reads the force exactly at every sample (with the noise the loop is given, if any)."""


def gaussian_noise(
    *, deviation: ArrayLike, period: float, duration: float, seed: int
) -> PiecewisePolynomial:
    """White noise held over every `period` (s): one channel per standard `deviation` (N).

    The same seed gives the same noise. A deviation of 0 is silence. Raises ParameterError for a
    negative deviation or a time that is not positive.
    """
    deviations = np.atleast_1d(np.asarray(deviation, dtype=float))
    if not np.all((deviations >= 0) & np.isfinite(deviations)):
        raise ParameterError("noise deviation", deviation, "must be finite and >= 0 N")
    for name, value in (("noise period", period), ("duration", duration)):
        if not 0 < value < math.inf:
            raise ParameterError(name, value, "must be a finite time > 0 s")
    count = math.ceil(duration / period - 1e-9)
    breakpoints = np.arange(count + 1, dtype=np.float64) * period
    breakpoints[-1] = duration
    samples = np.random.default_rng(seed).standard_normal((count, deviations.size))
    return PiecewisePolynomial(
        breakpoints=breakpoints, coefficients=(samples * deviations).T[:, :, None]
    )


def no_noise(*, axes: int, duration: float) -> PiecewisePolynomial:
    """Silence on `axes` channels over [0, duration] s."""
    return PiecewisePolynomial(
        breakpoints=np.array([0.0, duration]), coefficients=np.zeros((axes, 1, 1))
    )
