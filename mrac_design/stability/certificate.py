"""Certificates that cover an adaptive force axis for every path of its gains inside a box.

A semidefinite program proposes Lyapunov matrices; they are rounded to rationals, and each claim
is then decided at every corner of the polytope in exact arithmetic. Only that second step gives a
verdict.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

from flint import fmpq

from mrac_design.errors import ParameterError
from mrac_design.stability.adaptive_loop import AdaptiveLoop
from mrac_design.stability.claims import Claim, DecayClaim, EnergyClaim, PeakClaim, first_failure
from mrac_design.stability.inequalities import Increment, derivative, difference
from mrac_design.stability.parameter_box import ParameterBox
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.sampled_loop import (
    Sampling,
    hold_terms,
    sampled_vertices,
    velocity_exponential,
)
from mrac_design.stability.vertices import Vertex, continuous_vertices
from mrac_design.time_domain import Continuous
from mrac_design.verdict import Verdict

Timing = Continuous | Sampling
"""How the loop runs: continuously, or sampled with a computational delay."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StabilityCertificate:
    """What is proved of one adaptive force axis, and the numbers that prove it."""

    loop: AdaptiveLoop
    """The axis."""
    box: ParameterBox
    """Where the gains and the stiffness may be, and move at will."""
    timing: Timing
    """Continuous() or Sampling(period, delay)."""
    decay: DecayClaim | None
    """Exponential stability; None when no certificate was found."""
    energy: EnergyClaim | None
    """L2 gain from the heart's motion to the force."""
    peak: PeakClaim | None
    """Peak gain from the heart's motion to the force."""
    mismatch: EnergyClaim | None
    """L2 gain from an acceleration error to f*, whose inverse is the tolerated inertia mismatch."""
    verdict: Verdict
    """PROVED, REFUTED (a frozen corner is unstable) or UNDECIDED."""
    reason: str
    """A plain sentence."""

    @property
    def claims(self) -> tuple[Claim, ...]:
        """The claims that were proved."""
        found = (self.decay, self.energy, self.peak, self.mismatch)
        return tuple(claim for claim in found if claim is not None)

    def verify(self) -> str | None:
        """Decide every claim again in exact arithmetic; the first failure, or None."""
        vertices = vertices_of(self.loop, self.box, self.timing)
        increment = increment_of(self.timing)
        failures = (first_failure(claim, increment, vertices) for claim in self.claims)
        return next((failure for failure in failures if failure is not None), None)

    @property
    def decay_rate(self) -> float:
        """Certified rate (1/s) at which any deviation dies out: |x| <= const · e^(−rate·t)."""
        if self.decay is None:
            return 0.0
        if isinstance(self.timing, Continuous):
            return to_float(self.decay.rate * self.loop.bandwidth) / 2
        return -log(1 - to_float(self.decay.rate)) / (2 * to_float(self.timing.period))

    @property
    def energy_gain(self) -> float:
        """Certified gain (N per m/s²) from d = Ẍh + K2 Ẋh to the force, both in the L2 norm.

        Sampled: the force at the sampling instants counts with one period each.
        """
        if self.energy is None:
            return float("inf")
        gain = to_float(self.energy.gain * self.loop.disturbance_scale)
        if isinstance(self.timing, Continuous):
            return gain
        return gain * sqrt(to_float(self.timing.period * self.loop.bandwidth))

    @property
    def peak_gain(self) -> float:
        """Certified gain (N per m/s²) from sup |Ẍh + K2 Ẋh| to sup |force|, between samples too."""
        if self.peak is None:
            return float("inf")
        gain = self.peak.gain
        if isinstance(self.timing, Sampling):
            gain += self.box.stiffness_ratio[1] * _held_response(self.loop, self.timing)
        return to_float(gain * self.loop.disturbance_scale)

    @property
    def tolerated_mismatch(self) -> float:
        """Largest ‖Mx⁻¹ M̂x − 1‖ (force axes, any posture path) that keeps the loop stable."""
        return 0.0 if self.mismatch is None else to_float(1 / self.mismatch.gain)

    def force_bound(self, peak_velocity: float, peak_acceleration: float) -> float:
        """Bound (N) of the force the heart adds, |Ẋh| (m/s) and |Ẍh| (m/s²) below the peaks.

        From rest. The part of the force that follows the reference comes on top.
        Raises ParameterError for a negative peak.
        """
        for name, value in (("velocity", peak_velocity), ("acceleration", peak_acceleration)):
            if not 0 <= value < float("inf"):
                raise ParameterError(f"peak {name}", value, "must be a finite number >= 0")
        disturbance = peak_acceleration + to_float(self.loop.velocity_gain) * peak_velocity
        return self.peak_gain * disturbance

    def _repr_markdown_(self) -> str:
        lines = [f"**{self.verdict.value}**: {self.reason}"]
        if self.verdict is Verdict.PROVED:
            lines += [
                "",
                "| certified | value |",
                "|---|---|",
                f"| decay rate | {self.decay_rate:.4g} 1/s |",
                f"| energy gain, heart acceleration to force | {self.energy_gain:.4g} N/(m/s²) |",
                f"| peak gain | {self.peak_gain:.4g} N/(m/s²) |",
            ]
            if self.mismatch is not None:
                lines.append(f"| tolerated inertia mismatch | {self.tolerated_mismatch:.3g} |")
        return "\n".join(lines)


def vertices_of(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> tuple[Vertex, ...]:
    """The loop's matrices at every corner of the polytope."""
    if isinstance(timing, Continuous):
        return continuous_vertices(loop, box)
    return sampled_vertices(loop, box, timing)


def increment_of(timing: Timing) -> Increment:
    """How V changes: by its derivative, or over one sample."""
    return derivative if isinstance(timing, Continuous) else difference


def _held_response(loop: AdaptiveLoop, timing: Sampling) -> fmpq:
    """ŷ after one period of d̂ = 1: bounds what the heart adds between two samples."""
    a = velocity_exponential(loop, timing)[0]
    period = timing.period * loop.bandwidth
    return hold_terms(a, loop.scaled_velocity_gain, period)[1]
