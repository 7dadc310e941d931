"""Robust adaptation laws, made by wrapping: each wrapper changes one thing about the law inside.

Noise, a disturbance or a reference too poor to show all gains lets a pure gradient law drift.
With V = θ̃ᵀΓ⁻¹θ̃ / 2, θ̃ = θ̂ − θ̂⁰, and an error ε = −φ̂ᵀθ̃ + d:

- a dead zone stops the law where |ε| cannot be told from a disturbance |d| ≤ width,
- projection keeps the gains in a box and takes from θ̇ only what would raise V,
- leakage pulls the gains towards a centre: constantly (σ) or in step with |ε| (e).

Wrappers compose: `WithProjection(law=WithDeadZone(law=NormalisedGradientLaw(...), ...), ...)`.
(Ioannou & Sun 1996, ch. 8; Narendra & Annaswamy 1987 for leakage in step with the error.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray
from mrac_design.controller.adaptation import AdaptationLaw, AdaptationSignals
from mrac_design.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class GainBox:
    """Interval for each scaled gain; gains after the last one named (bias, …) are free."""

    lower: tuple[float, ...]
    """Least values, as many as `upper`; −inf leaves a side open."""
    upper: tuple[float, ...]
    """Greatest values, each ≥ its least value."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "lower", tuple(float(value) for value in self.lower))
        object.__setattr__(self, "upper", tuple(float(value) for value in self.upper))
        if len(self.lower) != len(self.upper) or not self.lower:
            raise ParameterError("gain box", (self.lower, self.upper), "needs pairs of limits")
        if not all(low <= high for low, high in zip(self.lower, self.upper, strict=True)):
            raise ParameterError("gain box", (self.lower, self.upper), "needs lower <= upper")

    @staticmethod
    def around(centre: tuple[float, ...], *, fraction: float) -> GainBox:
        """The box centre ± `fraction` of each centre's size, fraction ≥ 0."""
        if not 0 <= fraction < float("inf"):
            raise ParameterError("box fraction", fraction, "must be finite and >= 0")
        half = [fraction * abs(value) for value in centre]
        return GainBox(
            lower=tuple(value - width for value, width in zip(centre, half, strict=True)),
            upper=tuple(value + width for value, width in zip(centre, half, strict=True)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WithProjection:
    """The law inside, with the gains kept in a box.

    On a face, the part of the rate that points out is dropped. With a diagonal adaptation gain
    this keeps θ̃ᵀΓ⁻¹θ̂' at or below what the law inside gives, for every θ̂⁰ in the box.
    """

    law: AdaptationLaw
    """The law inside."""
    box: GainBox
    """Where the gains stay."""

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return _extended(
            self.law.parameters(size),
            gain_lower=_padded("gain box", self.box.lower, size, -np.inf),
            gain_upper=_padded("gain box", self.box.upper, size, np.inf),
        )

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        rate = self.law.rate(symbols, signals)
        low, high = signals.gains <= symbols["gain_lower"], signals.gains >= symbols["gain_upper"]
        rate = ca.if_else(low, ca.fmax(rate, 0), rate)
        return ca.if_else(high, ca.fmin(rate, 0), rate)

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        inner = self.law.confined(symbols, gains)
        return ca.fmax(ca.fmin(inner, symbols["gain_upper"]), symbols["gain_lower"])


@dataclass(frozen=True, slots=True, kw_only=True)
class WithDeadZone:
    """The law inside, blind to errors up to `width`.

    ε is replaced by ε − clip(ε, ±width), continuous, so V cannot grow while |d| ≤ width.
    """

    law: AdaptationLaw
    """The law inside."""
    width: float
    """Largest error that is taken for a disturbance (N), ≥ 0."""

    def __post_init__(self) -> None:
        _require_not_negative("dead zone width", self.width)

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return _extended(self.law.parameters(size), dead_zone=self.width)

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        width = symbols["dead_zone"]
        beyond = signals.error - ca.fmax(ca.fmin(signals.error, width), -width)
        return self.law.rate(symbols, replace(signals, error=beyond))

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        return self.law.confined(symbols, gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class WithLeakage:
    """σ-modification: θ̂' = law − σ (θ̂ − centre).

    A law whose rate is at most m keeps |θ̂ − centre| within max(its start, m/σ): no drift, at the
    price of gains that sag towards the centre when nothing excites them.
    """

    law: AdaptationLaw
    """The law inside."""
    leakage: float
    """σ (1/s), ≥ 0."""
    centre: tuple[float, ...]
    """Where the gains leak to; gains after the last one named leak to zero."""

    def __post_init__(self) -> None:
        _require_not_negative("leakage", self.leakage)

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return _extended(
            self.law.parameters(size),
            leakage=self.leakage,
            leakage_centre=_padded("leakage centre", self.centre, size, 0.0),
        )

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        pull = signals.gains - symbols["leakage_centre"]
        return self.law.rate(symbols, signals) - symbols["leakage"] * pull

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        return self.law.confined(symbols, gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class WithErrorLeakage:
    """e-modification: θ̂' = law − ν |ε| (θ̂ − centre).

    The pull fades with the error, so without disturbance the gains settle where ε does. A law
    of rate at most m |ε| keeps |θ̂ − centre| within max(its start, m/ν), whatever ε does.
    """

    law: AdaptationLaw
    """The law inside."""
    leakage: float
    """ν (1/(N·s)), ≥ 0."""
    centre: tuple[float, ...]
    """Where the gains leak to; gains after the last one named leak to zero."""

    def __post_init__(self) -> None:
        _require_not_negative("error leakage", self.leakage)

    def parameters(self, size: int) -> Mapping[str, ArrayLike]:
        return _extended(
            self.law.parameters(size),
            error_leakage=self.leakage,
            error_leakage_centre=_padded("error leakage centre", self.centre, size, 0.0),
        )

    def rate(self, symbols: Mapping[str, ca.SX], signals: AdaptationSignals) -> ca.SX:
        pull = ca.fabs(signals.error) * (signals.gains - symbols["error_leakage_centre"])
        return self.law.rate(symbols, signals) - symbols["error_leakage"] * pull

    def confined(self, symbols: Mapping[str, ca.SX], gains: ca.SX) -> ca.SX:
        return self.law.confined(symbols, gains)


def _extended(inner: Mapping[str, ArrayLike], **own: ArrayLike) -> Mapping[str, ArrayLike]:
    """Parameters of the law inside and of its wrapper; a wrapper may be used once in a chain."""
    twice = set(inner) & set(own)
    if twice:
        raise ParameterError("adaptation law", ", ".join(sorted(twice)), "wrapped twice alike")
    return {**inner, **own}


def _padded(name: str, values: tuple[float, ...], size: int, filling: float) -> FloatArray:
    if len(values) > size:
        raise ParameterError(name, values, f"names more than the {size} gains there are")
    return np.concatenate([np.asarray(values, dtype=float), np.full(size - len(values), filling)])


def _require_not_negative(name: str, value: float) -> None:
    if not 0 <= value < float("inf"):
        raise ParameterError(name, value, "must be finite and >= 0")
