"""Force sensors of a sampled loop: noise, quantisation and a rate below the controller's.

    force ──►(+)──► quantiser ──► taken every m-th sample, held in between ──► reading
              ▲
            noise (an input of the loop, constant over a sampling period)

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


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensor:
    """A force sensor read by a sampled controller."""

    decimation: int
    """The controller's samples per reading, an integer ≥ 1: 1 is a reading every sample."""
    quantiser: Quantiser
    """How finely it reads."""

    def __post_init__(self) -> None:
        if not (isinstance(self.decimation, int) and self.decimation >= 1):
            raise ParameterError(
                "decimation", self.decimation, "must be a whole number of samples ≥ 1"
            )

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
    ) -> Mapping[str, ca.SX]:
        """The memory after a sampling instant; its `measured_force` (N) is what is measured."""
        due = memory["sensor_wait"] <= 0
        fresh = self.quantiser.read(force + noise, symbols)
        return {
            "sensor_wait": ca.if_else(due, symbols["decimation"], memory["sensor_wait"]) - 1,
            "measured_force": ca.if_else(due, fresh, memory["measured_force"]),
        }


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
