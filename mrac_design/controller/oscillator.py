r"""Harmonic feedforward: sinusoids as further regressors of the adaptive controller.

A periodic heart motion adds Σ a_i cos iϕ + b_i sin iϕ, ϕ' = ν, to what the controller has to
cancel. With the pairs (cos iϕ, sin iϕ) among the regressors their sizes are adapted like every
other gain. If ν is off by δ, the pairs of gains turn by iδ per second, so their turning

    δ = Σ i (a_i' b_i − b_i' a_i) / Σ i² (a_i² + b_i²)

is the frequency's error, which a phase-locked loop integrates away.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.advance import integral_advance
from mrac_design.errors import ParameterError
from mrac_design.time_domain import Discrete, TimeDomain


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillator:
    """One fundamental with its harmonics."""

    frequency: float
    """Frequency at the start (Hz)."""
    lowest: float
    """Lowest frequency the tracking may reach (Hz)."""
    highest: float
    """Highest frequency the tracking may reach (Hz)."""
    harmonics: int
    """Number of harmonics, the fundamental included."""
    force: float
    """Size of the regressors (N), like the bias force."""
    tracking: float
    """Gain of the phase-locked loop (1/s); 0 keeps the frequency. A quarter of the rate at which
    the harmonic gains settle damps it critically."""
    floor: float
    """Size of the scaled harmonic gains below which tracking fades, > 0."""

    def __post_init__(self) -> None:
        if not 0 < self.lowest <= self.frequency <= self.highest < float("inf"):
            bounds = (self.lowest, self.frequency, self.highest)
            raise ParameterError("oscillator frequencies", bounds, "must be positive, in order")
        if int(self.harmonics) != self.harmonics or self.harmonics < 1:
            raise ParameterError("harmonics", self.harmonics, "must be a whole number >= 1")
        for name in ("force", "floor"):
            if not 0 < getattr(self, name) < float("inf"):
                raise ParameterError(f"oscillator {name}", getattr(self, name), "must be > 0")
        if not 0 <= self.tracking < float("inf"):
            raise ParameterError("oscillator tracking", self.tracking, "must be >= 0")

    @property
    def blocks(self) -> tuple[tuple[str, int], ...]:
        """Blocks of the controller's state."""
        return (("harmonic_gains", 2 * self.harmonics), ("oscillator", 2))


def oscillator_values(
    oscillator: Oscillator, *, unit_force: float
) -> Mapping[str, FloatArray | float]:
    """Parameters of the generated code; `unit_force` Ao(0) ω²/b0 makes 1/(Ao Am) a force, as it
    does for the bias."""
    return {
        "harmonic_scaling": np.full(2 * oscillator.harmonics, unit_force * oscillator.force),
        "oscillator_start": 2 * np.pi * oscillator.frequency,
        "oscillator_range": 2 * np.pi * np.array([oscillator.lowest, oscillator.highest]),
        "oscillator_tracking": oscillator.tracking,
        "oscillator_floor": oscillator.floor**2,
    }


@dataclass(frozen=True, slots=True, eq=False)
class HarmonicSignals:
    """The regressors before and after the reference model's filter."""

    coarse: ca.SX
    """P1 φ, pairs (cos iϕ, sin iϕ)/Ao(0)."""
    regressor: ca.SX
    """φ = (1/Am) of those, settled at the present frequency."""


def harmonic_signals(
    oscillator: Oscillator, state: ca.SX, *, static: ca.SX, model: ca.SX
) -> HarmonicSignals:
    """Both for the oscillator's `state` (ϕ, ν); `static` is Ao(0), `model` 2ξω and ω² of Am.

    A sinusoid passes 1/Am = 1/((ω² − ν²) + 2jξων) scaled and turned; the filter settles in a few
    1/ω, far faster than a frequency changes.
    """
    phase, frequency = state[0], state[1]
    cosine, sine = ca.cos(phase), ca.sin(phase)
    turned = (ca.SX(1), ca.SX(0))
    coarse, regressor = [], []
    for order in range(1, oscillator.harmonics + 1):
        turned = (
            turned[0] * cosine - turned[1] * sine,
            turned[1] * cosine + turned[0] * sine,
        )
        c, s = (part / static for part in turned)
        real = model[1] - (order * frequency) ** 2
        imaginary = model[0] * order * frequency
        size = real**2 + imaginary**2
        coarse += [c, s]
        regressor += [(real * c + imaginary * s) / size, (real * s - imaginary * c) / size]
    return HarmonicSignals(ca.vertcat(*coarse), ca.vertcat(*regressor))


def oscillator_advance(
    oscillator: Oscillator,
    domain: TimeDomain,
    symbols: Mapping[str, ca.SX],
    state: ca.SX,
    gains: ca.SX,
    rate: ca.SX,
) -> ca.SX:
    """How (ϕ, ν) advances while the harmonic `gains` move at `rate`."""
    turning, size = ca.SX(0), symbols["oscillator_floor"]
    for i in range(oscillator.harmonics):
        a, b = gains[2 * i], gains[2 * i + 1]
        turning += (i + 1) * (rate[2 * i] * b - rate[2 * i + 1] * a)
        size = size + (i + 1) ** 2 * (a**2 + b**2)
    lowest, highest = symbols["oscillator_range"][0], symbols["oscillator_range"][1]
    pull = symbols["oscillator_tracking"] * turning / size
    pull = ca.if_else(state[1] <= lowest, ca.fmax(pull, 0), pull)
    pull = ca.if_else(state[1] >= highest, ca.fmin(pull, 0), pull)
    phase = integral_advance(domain, state[0], state[1])
    frequency = integral_advance(domain, state[1], pull)
    if isinstance(domain, Discrete):
        # Whole turns are taken off, so the phase keeps its digits however long it runs.
        phase = phase - 2 * np.pi * ca.floor(phase / (2 * np.pi))
        frequency = ca.fmax(ca.fmin(frequency, highest), lowest)
    return ca.vertcat(phase, frequency)
