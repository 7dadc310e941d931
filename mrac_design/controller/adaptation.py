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
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdaptationSignals:
    """What a law may look at."""

    gains: ca.SX
    """Scaled gains θ̂ as used by the controller, (size,)."""
    regressor: ca.SX
    """Scaled regressor φ̂ (N), (size,)."""
    error: ca.SX
    """Augmented error ε (N)."""
    bandwidth: ca.SX
    """Bandwidth ω of the reference model (rad/s), the unit of time of the scaled law."""


class AdaptationLaw(Protocol):
    """What the controller asks of a law."""

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        """Tunable numbers of a law for `size` gains; they become inputs of the generated code."""

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        """dθ̂/dt (1/s), shape of the gains; `symbols` are the law's parameters."""

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        """The admissible gains nearest to `gains`: what a step of finite length is pulled back to
        and what the controller uses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientLaw:
    """Plain gradient law dθ̂/dt = γ̂ ω φ̂ ε [AW 5.62]."""

    gain: float | tuple[float, ...]
    """Scaled adaptation gain γ̂ (1/N²), one for all gains or one each; zero freezes them."""

    def __post_init__(self) -> None:
        _check_gain(self.gain)

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return {"adaptation_gain": np.broadcast_to(self.gain, size)}

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        return symbols["adaptation_gain"] * (signals.bandwidth * signals.error * signals.regressor)

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        return gains


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalisedGradientLaw:
    """Normalised law dθ̂/dt = γ̂ ω φ̂ ε / (α + φ̂ᵀφ̂).

    Its speed is bounded whatever the force level, so large gains stay integrable and the usual
    boundedness proofs apply (Ioannou & Sun 1996, ch. 6).
    """

    gain: float | tuple[float, ...]
    """Scaled adaptation gain γ̂ (–), one for all gains or one each; zero freezes them."""
    alpha: float
    """Normalisation constant α (N²), > 0."""

    def __post_init__(self) -> None:
        _check_gain(self.gain)
        if not 0 < self.alpha < float("inf"):
            raise ParameterError("alpha", self.alpha, "the normalisation constant must be > 0")

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return {
            "adaptation_gain": np.broadcast_to(self.gain, size),
            "normalisation": self.alpha,
        }

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        norm = symbols["normalisation"] + ca.dot(signals.regressor, signals.regressor)
        step = (signals.bandwidth * signals.error / norm) * signals.regressor
        return symbols["adaptation_gain"] * step

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        return gains


def _check_gain(gain: float | tuple[float, ...]) -> None:
    gains = np.asarray(gain, dtype=float)
    if not np.all((gains >= 0) & np.isfinite(gains)):
        raise ParameterError("adaptation gain", gain, "must be finite and >= 0")
