"""The search for certificates: solver, rounding, exact decision, and bisection of the box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, floor, log10, sqrt
from typing import TypeVar

import numpy as np
from flint import fmpq

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.adaptive_loop import AdaptiveLoop, exact
from mrac_design.stability.certificate import (
    StabilityCertificate,
    Timing,
    increment_of,
    vertices_of,
)
from mrac_design.stability.claims import (
    Claim,
    DecayClaim,
    EnergyClaim,
    Output,
    PeakClaim,
    first_failure,
)
from mrac_design.stability.coordinates import Coordinates, balanced
from mrac_design.stability.inequalities import (
    Corner,
    Increment,
    decay_blocks,
    derivative,
    energy_blocks,
    floating_corner,
    peak_blocks,
)
from mrac_design.stability.instability import unstable_corner
from mrac_design.stability.parameter_box import ParameterBox, relative_box
from mrac_design.stability.semidefinite import Blocks, Candidate, least_scalar, widest_margin
from mrac_design.stability.vertices import Vertex
from mrac_design.time_domain import Continuous
from mrac_design.verdict import Verdict

GainClaim = TypeVar("GainClaim", EnergyClaim, PeakClaim)

LEAST_DECAY = fmpq(1, 10**6)
"""Fall of V that counts as one, relative, per unit of scaled time or per sample."""
DECAY_STEPS = 128
"""Steps in which the decay is bisected, up to that of the slowest frozen pole."""
PEAK_RATES = (0.15, 0.35, 0.55, 0.7, 0.85)
"""Shares of the certified decay tried as the rate of the peak bound."""
SLACKS = (1.002, 1.02, 1.2)
"""Inflation of a solver's gain, tried in turn until the exact check passes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Polytope:
    """The corners in both arithmetics and how V changes along the loop."""

    increment: Increment
    vertices: tuple[Vertex, ...]
    floating: tuple[Corner, ...]
    """The corners of the gains, each once: the bounds of the exponential are 2⁻⁹⁵ apart."""
    coordinates: Coordinates
    """What the solver works in."""
    corners: tuple[Corner, ...]
    """The corners as the solver sees them."""

    @property
    def size(self) -> int:
        return len(self.floating[0].A)

    @property
    def frozen_decay(self) -> float:
        """Decay of V that poles frozen at a corner allow at best, in floats; a search is vain
        where it is not positive."""
        poles = np.linalg.eigvals(np.array([corner.A for corner in self.floating]))
        if self.increment is derivative:
            return float(-2 * poles.real.max())
        return float(1 - np.abs(poles).max() ** 2)

    def fitted(self, claim: DecayClaim) -> _Polytope:
        """The same in coordinates that suit a Lyapunov matrix of the loop."""
        coordinates = self.coordinates.fitted(claim.P)
        corners = coordinates.corners(self.floating)
        return replace(self, coordinates=coordinates, corners=corners)

    def proved(self, claim: Claim) -> bool:
        return first_failure(claim, self.increment, self.vertices) is None


def certify(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> StabilityCertificate:
    """Stability, decay rate and gains of the adaptive loop over the box, as far as provable.

    The verdict is PROVED when a rounded Lyapunov matrix passes the exact check at every corner,
    REFUTED when the loop with gains frozen at a corner is proved unstable, UNDECIDED otherwise.
    Needs cvxpy and Clarabel.
    """
    polytope = _polytope(loop, box, timing)
    first = _decay_at(polytope, LEAST_DECAY) if polytope.frozen_decay > 0 else None
    if first is None:
        return _without_proof(loop, box, timing)
    polytope = polytope.fitted(first)
    decay = _fastest_decay(polytope, first)
    continuous = isinstance(timing, Continuous)
    return StabilityCertificate(
        loop=loop,
        box=box,
        timing=timing,
        decay=decay,
        energy=_least_energy_gain(polytope, Output.FORCE),
        peak=_least_peak_gain(polytope, decay.rate),
        mismatch=_least_energy_gain(polytope, Output.LINEARISED_COMMAND) if continuous else None,
        verdict=Verdict.PROVED,
        reason=(
            "exponentially stable for every path of the gains in the box and of the stiffness "
            f"in its range: {len(polytope.vertices)} corners decided in exact arithmetic"
        ),
    )


def has_common_lyapunov_function(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> bool:
    """Whether a common quadratic Lyapunov function was found and proved; False proves nothing."""
    polytope = _polytope(loop, box, timing)
    return polytope.frozen_decay > 0 and _decay_at(polytope, LEAST_DECAY) is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestBox:
    """The largest relative box with a proved common Lyapunov function."""

    fraction: fmpq
    """Every gain may be within ± this share of nominal; 0 when not even the nominal is proved."""
    proved: bool
    """False when no certificate exists even for gains frozen at nominal."""
    resolution: fmpq
    """Width of the last bisection step."""


def largest_box(
    loop: AdaptiveLoop,
    stiffness_range: tuple[Number, Number],
    timing: Timing,
    *,
    resolution: Number,
) -> LargestBox:
    """Bisect the relative gain box, 0 to 1, for the largest that is proved.

    Raises ParameterError for a resolution outside (0, 1).
    """
    width = exact(resolution, "resolution")
    if not 0 < width < 1:
        raise ParameterError("resolution", resolution, "must be between 0 and 1")
    count = int((1 / width).floor())
    low, high = -1, count
    while high - low > 1:
        middle = max(0, (low + high) // 2)
        box = relative_box(loop, middle * width, stiffness_range)
        if has_common_lyapunov_function(loop, box, timing):
            low = middle
        else:
            high = middle
    return LargestBox(fraction=max(low, 0) * width, proved=low >= 0, resolution=width)


def _polytope(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> _Polytope:
    vertices = vertices_of(loop, box, timing)
    distinct = vertices[: sum(1 for _ in box.corners())]
    floating = tuple(floating_corner(vertex) for vertex in distinct)
    coordinates = balanced([corner.A for corner in floating])
    return _Polytope(
        increment=increment_of(timing),
        vertices=vertices,
        floating=floating,
        coordinates=coordinates,
        corners=coordinates.corners(floating),
    )


def _without_proof(loop: AdaptiveLoop, box: ParameterBox, timing: Timing) -> StabilityCertificate:
    corner = unstable_corner(loop, box, timing)
    reason = "no common quadratic Lyapunov function was found; make the box smaller"
    verdict = Verdict.UNDECIDED
    if corner is not None:
        reason = f"the loop with gains frozen in a corner of the box is unstable: {corner}"
        verdict = Verdict.REFUTED
    return StabilityCertificate(
        loop=loop,
        box=box,
        timing=timing,
        decay=None,
        energy=None,
        peak=None,
        mismatch=None,
        verdict=verdict,
        reason=reason,
    )


def _fastest_decay(polytope: _Polytope, first: DecayClaim) -> DecayClaim:
    """The largest proved decay, by bisection from a first proof."""
    best = first
    step = _rounded_up(polytope.frozen_decay) / DECAY_STEPS
    low, high = 0, DECAY_STEPS
    while high - low > 1:
        middle = (low + high) // 2
        claim = _decay_at(polytope, middle * step)
        if claim is None:
            high = middle
        else:
            low, best = middle, claim
    return best


def _decay_at(polytope: _Polytope, rate: fmpq) -> DecayClaim | None:
    floating = int(rate.p) / int(rate.q)
    corners = polytope.corners

    def blocks(P: FloatArray, _: float) -> list[FloatArray]:
        found = [P]
        for corner in corners:
            found += decay_blocks(polytope.increment, corner, P, floating)
        return found

    candidate = widest_margin(blocks, polytope.size)
    if candidate is None:
        return None
    claim = DecayClaim(P=polytope.coordinates.form(candidate.P), rate=rate)
    return claim if polytope.proved(claim) else None


def _least_energy_gain(polytope: _Polytope, output: Output) -> EnergyClaim | None:
    corners = polytope.corners

    def blocks(P: FloatArray, squared: float) -> list[FloatArray]:
        found = [P]
        for corner in corners:
            row = output.row(corner)
            found += energy_blocks(polytope.increment, corner, P, row, squared)
        return found

    def claim(candidate: Candidate, gain: fmpq) -> EnergyClaim:
        P = polytope.coordinates.form(candidate.P)
        return EnergyClaim(P=P, output=output, gain=gain)

    least = least_scalar(blocks, polytope.size)
    return None if least is None else _proved_gain(polytope, blocks, claim, least.scalar)


def _least_peak_gain(polytope: _Polytope, decay: fmpq) -> PeakClaim | None:
    """The smallest proved peak bound over a few rates of the invariant ellipsoid."""
    fastest = int(decay.p) / int(decay.q)
    rates = [fmpq(ceil(share * fastest * 10**6), 10**6) for share in PEAK_RATES]
    bounds = [(least_scalar(_peak_blocks(polytope, rate), polytope.size), rate) for rate in rates]
    for squared, rate in sorted((found.scalar, rate) for found, rate in bounds if found):
        result = _peak_at(polytope, rate, squared)
        if result is not None:
            return result
    return None


def _peak_blocks(polytope: _Polytope, rate: fmpq) -> Blocks:
    corners, floating = polytope.corners, int(rate.p) / int(rate.q)

    def blocks(P: FloatArray, squared: float) -> list[FloatArray]:
        found = [P]
        for corner in corners:
            found += peak_blocks(polytope.increment, corner, P, floating, squared)
        return found

    return blocks


def _peak_at(polytope: _Polytope, rate: fmpq, squared: float) -> PeakClaim | None:
    def claim(candidate: Candidate, gain: fmpq) -> PeakClaim:
        return PeakClaim(P=polytope.coordinates.form(candidate.P), rate=rate, gain=gain)

    return _proved_gain(polytope, _peak_blocks(polytope, rate), claim, squared)


def _proved_gain(
    polytope: _Polytope,
    blocks: Blocks,
    claim: Callable[[Candidate, fmpq], GainClaim],
    squared: float,
) -> GainClaim | None:
    """Step back from the solver's optimum until the rounded claim is proved."""
    if squared <= 0:
        return None
    for slack in SLACKS:
        gain = _rounded_up(sqrt(squared) * slack)
        candidate = widest_margin(blocks, polytope.size, scalar=(int(gain.p) / int(gain.q)) ** 2)
        if candidate is not None:
            found = claim(candidate, gain)
            if polytope.proved(found):
                return found
    return None


def _rounded_up(value: float) -> fmpq:
    """`value` rounded up to four significant digits."""
    unit = floor(log10(value)) - 3
    return ceil(value / 10.0**unit) * fmpq(10) ** unit
