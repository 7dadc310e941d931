"""Adaptation laws: how the gains move with the regressor and the augmented error.

All work on scaled quantities: the gains θ̂ = D⁻¹θ are of order one, the regressor φ̂ = b0 D φ is in
newtons like the augmented error ε, and time is counted in units of the reference model's 1/ω. One
gain γ̂ then serves every entry, where a scalar gain in SI units would have to span five decades.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from mrac_design.errors import ParameterError


class AdaptationLaw(Protocol):
    """What the controller asks of a law."""

    def parameters(self) -> Mapping[str, float]:
        """Tunable numbers of the law by name; they become inputs of the generated code."""

    def rate(
        self, symbols: Mapping[str, ca.SX], regressor: ca.SX, error: ca.SX, bandwidth: ca.SX
    ) -> ca.SX:
        """dθ̂/dt (1/s), shape of the `regressor` φ̂ (N); `error` ε in N, `bandwidth` ω in rad/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientLaw:
    """Plain gradient law dθ̂/dt = γ̂ ω φ̂ ε [AW 5.62]."""

    gain: float
    """Scaled adaptation gain γ̂ (1/N²); zero freezes the gains."""

    def __post_init__(self) -> None:
        _check_gain(self.gain)

    def parameters(self) -> Mapping[str, float]:
        return {"adaptation_gain": self.gain}

    def rate(
        self, symbols: Mapping[str, ca.SX], regressor: ca.SX, error: ca.SX, bandwidth: ca.SX
    ) -> ca.SX:
        return symbols["adaptation_gain"] * bandwidth * error * regressor


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalisedGradientLaw:
    """Normalised law dθ̂/dt = γ̂ ω φ̂ ε / (α + φ̂ᵀφ̂).

    Its speed is bounded whatever the force level, so large gains stay integrable and the usual
    boundedness proofs apply (Ioannou & Sun 1996, ch. 6).
    """

    gain: float
    """Scaled adaptation gain γ̂ (–); zero freezes the gains."""
    alpha: float
    """Normalisation constant α (N²), > 0."""

    def __post_init__(self) -> None:
        _check_gain(self.gain)
        if not 0 < self.alpha < float("inf"):
            raise ParameterError("alpha", self.alpha, "the normalisation constant must be > 0")

    def parameters(self) -> Mapping[str, float]:
        return {"adaptation_gain": self.gain, "normalisation": self.alpha}

    def rate(
        self, symbols: Mapping[str, ca.SX], regressor: ca.SX, error: ca.SX, bandwidth: ca.SX
    ) -> ca.SX:
        norm = symbols["normalisation"] + ca.dot(regressor, regressor)
        return (symbols["adaptation_gain"] * bandwidth * error / norm) * regressor


def _check_gain(gain: float) -> None:
    if not 0 <= gain < float("inf"):
        raise ParameterError("adaptation gain", gain, "must be a finite number >= 0")
