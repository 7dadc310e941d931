r"""The adaptive loop linearised about a constant force: what adaptation does to margins and noise.

Pressing with a constant force F0 the regressor rests at φ̂₀ and only the gains along it matter.
With λ = γ̂ ω |φ̂₀|² (divided by α + |φ̂₀|² for the normalised law) they act on the command as

    u = −(S/R) y − (Ao/R) v,      v = (λω²/b0) Am / (p Q) · y,      Q = Am + λ (p + 2ξω)

a hidden integral action of speed λ. The loop gain is L = b0/A · (S/R + λω² Ao Am/(b0 R p Q)) and
1 + L = Ao Am² (p + λ)/(A R p Q): the poles of the frozen loop, and −λ.
Follows from the error model of [AW 5.67, 5.71] with Q = Ao Am, P1 = Am, P2 = Ao.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from flint import fmpq_poly
from scipy.integrate import trapezoid

from mrac_design.arrays import FloatArray
from mrac_design.design import RSTDesign, StabilityMargins, stability_margins
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import binary_rational, coefficients, decimal_rational
from mrac_design.simulation.scenario import AdaptationChoice
from mrac_design.time_domain import Continuous

_POLYNOMIAL_P = fmpq_poly([0, 1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdaptationLoop:
    """One axis under a constant force, linearised together with its adaptation."""

    design: RSTDesign
    """The controller, at its nominal gains."""
    speed: float
    """λ (1/s), >= 0; 0 is the frozen controller, inf the limit of infinitely fast adaptation."""

    def __post_init__(self) -> None:
        if not self.speed >= 0:
            raise ParameterError("adaptation speed λ", self.speed, "must be >= 0 1/s")

    @property
    def loop_gain(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and denominator of L, negative feedback taken out."""
        specification = self.design.specification
        model = specification.reference_model
        p, Am = _POLYNOMIAL_P, model.exact_polynomial
        omega, xi = decimal_rational(model.bandwidth), decimal_rational(model.damping)
        Ao = fmpq_poly([decimal_rational(value) for value in reversed(specification.observer)])
        loop = self.design.loop
        BS, AR = loop.process.B * loop.S, loop.process.A * loop.R
        if self.speed == 0:
            return BS, AR
        lead = p + 2 * xi * omega
        if math.isinf(self.speed):
            return BS * p * lead + omega**2 * Ao * Am, AR * p * lead
        rate = binary_rational(self.speed)
        Q = Am + rate * lead
        return BS * p * Q + rate * omega**2 * Ao * Am, AR * p * Q

    def margins(self) -> StabilityMargins:
        """Margins of L, exact as those of the frozen loop."""
        return stability_margins(*self.loop_gain, Continuous())

    def noise_gain(self) -> float:
        """rms force (N) for sensor noise of density 1 N²/Hz, one-sided up to infinity.

        The noise of a sensor sampled every h s with rms σ has density 2 σ² h.
        """
        numerator, denominator = self.loop_gain
        omega = self.design.specification.reference_model.bandwidth * np.geomspace(1e-5, 1e4, 6000)
        n, d = (np.polyval(coefficients(q), 1j * omega) for q in (numerator, denominator))
        power = np.abs(n / (n + d)) ** 2
        return float(math.sqrt(trapezoid(power * omega, np.log(omega)) / (2 * math.pi)))


def regressor_square(design: RSTDesign, force: float, bias_force: float) -> float:
    """|φ̂₀|² (N²) at rest at a constant `force` (N): sn and tn see the force through D, 1/Ao and
    1/Am (ω F0/ao without internal model), the bias its own."""
    specification = design.specification
    static = specification.observer[-1] * specification.reference_model.bandwidth**2
    ratio = specification.plant.b0 * float(design.scaling[-1]) / static
    return 2 * (ratio * force) ** 2 + bias_force**2


def adaptation_speed(
    design: RSTDesign, adaptation: AdaptationChoice, *, gain: float, force: float
) -> float:
    """λ (1/s) of the chosen law with scaled gain γ̂ = `gain` at a constant `force` (N)."""
    return gain * _speed_per_gain(design, adaptation, force)


def gain_for_speed(
    design: RSTDesign, adaptation: AdaptationChoice, *, speed: float, force: float
) -> float:
    """γ̂ that gives λ = `speed` (1/s) at `force` (N); inf where no gain reaches it."""
    per_gain = _speed_per_gain(design, adaptation, force)
    return speed / per_gain if per_gain > 0 else math.inf


def _speed_per_gain(design: RSTDesign, adaptation: AdaptationChoice, force: float) -> float:
    square = regressor_square(design, force, adaptation.bias_force)
    if adaptation.law == "normalised":
        square /= adaptation.normalisation + square
    return design.specification.reference_model.bandwidth * square


def noise_drift(design: RSTDesign, *, rms: float, period: float) -> FloatArray:
    """E[φ̂ ε] (N²) of (r1', s0 … sn) under sensor noise at zero force, gains at nominal.

    Noise correlates with itself through the regressor, so the gains drift although nothing is to
    be learnt: dθ̂/dt starts at γ̂ω E[φ̂ε] (divided by α for the normalised law). `rms` (N) is the
    noise of a sensor sampled every `period` s. Source: averaging (Åström & Wittenmark, ch. 6).
    """
    for name, value in (("noise rms", rms), ("noise period", period)):
        if not 0 <= value < math.inf:
            raise ParameterError(name, value, "must be finite and >= 0")
    specification = design.specification
    model, b0 = specification.reference_model, specification.plant.b0
    omega = model.bandwidth * np.geomspace(1e-5, 1e4, 6000)
    p = 1j * omega
    Am, Ao = (np.polyval(q, p) for q in (model.polynomial, specification.observer))
    AoAm = Ao * Am
    error = np.polyval(specification.plant.A, p) * np.polyval(design.R, p) / AoAm
    command = -np.polyval(design.S, p) / np.polyval(design.R, p) * error
    modelled = np.polyval(specification.internal_model, p) * command
    powers = [p**i * error for i in range(specification.degree, -1, -1)]
    scaling = b0 * design.scaling[: specification.degree + 2]
    regressor = scaling[:, None] * np.array([modelled, *powers]) / AoAm
    # A sample held for one period: the density falls off as sinc².
    density = rms**2 * period * np.sinc(omega * period / (2 * math.pi)) ** 2
    cross = np.real(regressor * error.conj()) * density * omega / math.pi
    return np.asarray(trapezoid(cross, np.log(omega), axis=1))
