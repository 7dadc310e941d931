"""Positive, strictly and strongly strictly positive real: three questions, decided exactly.

For a rational G with real coefficients (Ioannou and Tao 1987; Wen 1988; Khalil, Nonlinear
Systems, Lemma 6.1):

- positive real: no pole in Re s > 0, poles on the axis (infinity included) simple with positive
  residue, Re G(jω) >= 0 elsewhere on the axis;
- strictly positive real, G(s − ε) positive real for some ε > 0: no pole in Re s >= 0,
  Re G(jω) > 0 for all ω, and at high frequency lim ω² Re G(jω) > 0 for relative degree 1,
  lim Re G(jω) > 0 with a positive slope lim G(jω)/jω for relative degree −1;
- strongly strictly positive real: Re G(jω) >= δ > 0 up to infinity, which excludes relative
  degree 1. In discrete time the circle is compact and the last two are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import control

from mrac_design.polynomials.sign import Sign
from mrac_design.stability.boundary import (
    Boundary,
    Extremum,
    axis_poles,
    boundary_of,
    lowest_real_part,
)
from mrac_design.stability.hypotheses import (
    Hypothesis,
    decided,
    first_violated,
    hypotheses_markdown,
)
from mrac_design.stability.rational_function import (
    Coefficients,
    RationalFunction,
    rational_function,
    to_float,
)
from mrac_design.stability.witness import (
    RealPartFactorisation,
    StorageFunction,
    real_part_factorisation,
    storage_function,
)
from mrac_design.time_domain import Continuous, TimeDomain
from mrac_design.verdict import Verdict


class Kind(Enum):
    """The three kinds of positive realness."""

    POSITIVE_REAL = "positive real"
    STRICTLY_POSITIVE_REAL = "strictly positive real"
    STRONGLY_STRICTLY_POSITIVE_REAL = "strongly strictly positive real"


@dataclass(frozen=True, slots=True, kw_only=True)
class PositiveRealness:
    """Whether a transfer function is positive real in one of the three senses, and why."""

    kind: Kind
    """The question asked."""
    verdict: Verdict
    """PROVED or REFUTED; the question is decidable over the rationals."""
    reason: str
    """A plain sentence with the number that decides."""
    margin: float
    """inf over ω of Re G(jω), in units of G; 0 when it is reached in the limit only."""
    worst_frequency: float
    """Frequency (rad/s) of that infimum; inf when it is the limit at high frequency."""
    hypotheses: tuple[Hypothesis, ...]
    """The conditions of the definition, one by one."""
    boundary: Boundary
    """The exact analysis behind the verdict."""
    witness: StorageFunction | RealPartFactorisation | None
    """Rational data that prove the verdict again when multiplied out; None when REFUTED."""

    @property
    def function(self) -> RationalFunction:
        """The transfer function judged, in lowest terms."""
        return self.boundary.function

    def _repr_markdown_(self) -> str:
        head = f"**{self.kind.value}: {self.verdict.value}.** {self.reason}"
        return f"{head}\n\n{hypotheses_markdown(self.hypotheses)}"


def positive_real(
    numerator: RationalFunction | control.TransferFunction | Coefficients,
    denominator: Coefficients | None = None,
    domain: TimeDomain | None = None,
) -> PositiveRealness:
    """Whether G is positive real. Arguments and errors as for `rational_function`."""
    boundary = boundary_of(rational_function(numerator, denominator, domain))
    conditions = (
        _at_most_one_order(boundary),
        _no_pole_outside(boundary),
        _axis_poles_lossless(boundary),
        _real_part_not_negative(boundary),
    )
    return _judged(Kind.POSITIVE_REAL, boundary, conditions)


def strictly_positive_real(
    numerator: RationalFunction | control.TransferFunction | Coefficients,
    denominator: Coefficients | None = None,
    domain: TimeDomain | None = None,
) -> PositiveRealness:
    """Whether G is strictly positive real. Arguments and errors as for `rational_function`."""
    boundary = boundary_of(rational_function(numerator, denominator, domain))
    strict_end = (
        _strict_at_infinity(boundary)
        if isinstance(boundary.function.domain, Continuous)
        else _bounded_away_at_infinity(boundary)
    )
    conditions = (
        _at_most_one_order(boundary),
        _poles_inside(boundary),
        _real_part_positive(boundary),
        strict_end,
    )
    return _judged(Kind.STRICTLY_POSITIVE_REAL, boundary, conditions)


def strongly_strictly_positive_real(
    numerator: RationalFunction | control.TransferFunction | Coefficients,
    denominator: Coefficients | None = None,
    domain: TimeDomain | None = None,
) -> PositiveRealness:
    """Whether Re G stays above a positive number. Arguments as for `rational_function`."""
    boundary = boundary_of(rational_function(numerator, denominator, domain))
    conditions = (
        _at_most_one_order(boundary),
        _poles_inside(boundary),
        _real_part_positive(boundary),
        _bounded_away_at_infinity(boundary),
    )
    return _judged(Kind.STRONGLY_STRICTLY_POSITIVE_REAL, boundary, conditions)


def _judged(kind: Kind, boundary: Boundary, conditions: tuple[Hypothesis, ...]) -> PositiveRealness:
    failed = first_violated(conditions)
    lowest = lowest_real_part(boundary)
    return PositiveRealness(
        kind=kind,
        verdict=Verdict.PROVED if failed is None else Verdict.REFUTED,
        reason=_reason(kind, boundary, lowest) if failed is None else failed.evidence,
        margin=lowest.value,
        worst_frequency=lowest.frequency,
        hypotheses=conditions,
        boundary=boundary,
        witness=None if failed is not None else _witness(kind, boundary),
    )


def _witness(kind: Kind, boundary: Boundary) -> StorageFunction | RealPartFactorisation:
    if kind is Kind.POSITIVE_REAL:
        return real_part_factorisation(boundary)
    return storage_function(boundary)


def _reason(kind: Kind, boundary: Boundary, lowest: Extremum) -> str:
    if kind is not Kind.POSITIVE_REAL and boundary.relative_degree == 1:
        limit = to_float(boundary.high_frequency_limit)
        return f"all poles stable, Re G > 0 for all ω and ω² Re G → {limit:.6g} > 0"
    return f"Re G is at least {lowest.value:.6g} ({_at(lowest.frequency)})"


def _no_pole_outside(boundary: Boundary) -> Hypothesis:
    outside = boundary.poles.outside
    evidence = (
        f"no pole in {_region(boundary, 'unstable')}"
        if outside == 0
        else f"{_poles(outside)} in {_region(boundary, 'unstable')}"
    )
    return decided("no unstable pole", outside == 0, evidence)


def _poles_inside(boundary: Boundary) -> Hypothesis:
    name = "every pole strictly stable"
    poles = boundary.poles
    if not isinstance(boundary.function.domain, Continuous) and boundary.relative_degree < 0:
        return decided(name, False, "a pole at z = −1")
    if poles.stable:
        return decided(name, True, f"all poles in {_region(boundary, 'stable')}")
    if poles.outside:
        evidence = f"{_poles(poles.outside)} in {_region(boundary, 'unstable')}"
        return decided(name, False, evidence)
    places = ", ".join(f"{frequency:.6g}" for frequency, _ in axis_poles(boundary))
    where = f" at ω = {places} rad/s" if places else ""
    return decided(name, False, f"{_poles(poles.boundary)} on {_edge(boundary)}{where}")


def _axis_poles_lossless(boundary: Boundary) -> Hypothesis:
    name = "poles on the boundary simple with positive residue"
    if boundary.poles.boundary == 0:
        return decided(name, True, f"no pole on {_edge(boundary)}")
    if not boundary.poles.boundary_simple:
        return decided(name, False, f"multiple pole on {_edge(boundary)}")
    for frequency, sign in axis_poles(boundary):
        if sign <= 0:
            evidence = f"the residue of the pole at ω = {frequency:.6g} rad/s is not positive"
            return decided(name, False, evidence)
    return decided(name, True, f"{_poles(boundary.poles.boundary)}, each residue positive")


def _at_most_one_order(boundary: Boundary) -> Hypothesis:
    if not isinstance(boundary.function.domain, Continuous):
        return _proper_at_minus_one(boundary)
    name = "relative degree −1, 0 or 1"
    degree = boundary.relative_degree
    if boundary.numerator == 0:
        return decided(name, True, "G = 0")
    if degree > 1:
        text = f"relative degree {degree}: the phase ends {90 * degree}° off, beyond ±90°"
        return decided(name, False, text)
    if degree < -1:
        return decided(name, False, f"a pole of order {-degree} at infinity")
    slope = boundary.function.high_frequency_gain
    if degree == -1 and slope < 0:
        text = f"G(s)/s → {to_float(slope):.6g} < 0: a pole at infinity with negative residue"
        return decided(name, False, text)
    return decided(name, True, f"relative degree {degree}")


def _proper_at_minus_one(boundary: Boundary) -> Hypothesis:
    """For a discrete G, infinity of the image is z = −1, an ordinary point of the circle."""
    name = "no pole at z = −1, or a simple one with positive residue"
    degree = boundary.relative_degree
    if boundary.numerator == 0 or degree >= 0:
        return decided(name, True, "no pole at z = −1")
    leading = boundary.numerator.leading_coefficient() * boundary.denominator.leading_coefficient()
    evidence = "a simple pole at z = −1" if degree == -1 else "a multiple pole at z = −1"
    if degree == -1 and leading < 0:
        evidence = "the residue of the pole at z = −1 is not positive"
    return decided(name, degree == -1 and leading > 0, evidence)


def _real_part_not_negative(boundary: Boundary) -> Hypothesis:
    name = "Re G >= 0 on the boundary"
    if boundary.sign.sign is Sign.NEGATIVE_SOMEWHERE:
        return decided(name, False, _negative_at(boundary))
    return decided(name, True, "Sturm: Re G times the squared modulus of D is nowhere negative")


def _real_part_positive(boundary: Boundary) -> Hypothesis:
    name = "Re G > 0 on the boundary"
    if boundary.sign.sign is Sign.NEGATIVE_SOMEWHERE:
        return decided(name, False, _negative_at(boundary))
    if boundary.sign.sign is Sign.NON_NEGATIVE:
        lowest = lowest_real_part(boundary)
        return decided(name, False, f"Re G = 0 {_at(lowest.frequency)}")
    return decided(name, True, "Sturm: Re G times the squared modulus of D is positive for every ω")


def _strict_at_infinity(boundary: Boundary) -> Hypothesis:
    name = "strict at high frequency"
    degree = boundary.relative_degree
    if boundary.numerator != 0 and degree == 1:
        limit = to_float(boundary.high_frequency_limit)
        evidence = f"ω² Re G → {limit:.6g} at high frequency"
        if boundary.high_frequency_limit <= 0:
            evidence += ", where relative degree 1 needs a positive limit"
        return decided(name, bool(boundary.high_frequency_limit > 0), evidence)
    return _bounded_away_at_infinity(boundary)


def _bounded_away_at_infinity(boundary: Boundary) -> Hypothesis:
    discrete = not isinstance(boundary.function.domain, Continuous)
    name = "Re G > 0 at z = −1" if discrete else "Re G bounded away from 0 at high frequency"
    place = "at z = −1" if discrete else "at high frequency"
    limit = boundary.direct_gain
    return decided(name, bool(limit > 0), f"Re G → {to_float(limit):.6g} {place}")


def _negative_at(boundary: Boundary) -> str:
    """Names the lowest point, or a rational one near a pole where Re G has no lowest point."""
    lowest = lowest_real_part(boundary)
    witness = boundary.sign.witness
    if lowest.value == float("-inf") and witness is not None:
        value = to_float(boundary.value_at(witness))
        return f"Re G = {value:.6g} {_at(boundary.frequency(witness))}"
    return f"Re G = {lowest.value:.6g} {_at(lowest.frequency)}"


def _at(frequency: float) -> str:
    if frequency == float("inf"):
        return "in the limit of high frequency"
    return f"at ω = {frequency:.6g} rad/s"


def _poles(count: int) -> str:
    return "1 pole" if count == 1 else f"{count} poles"


def _region(boundary: Boundary, side: str) -> str:
    if isinstance(boundary.function.domain, Continuous):
        return "Re s < 0" if side == "stable" else "Re s > 0"
    return "|z| < 1" if side == "stable" else "|z| > 1"


def _edge(boundary: Boundary) -> str:
    return "the imaginary axis" if isinstance(boundary.function.domain, Continuous) else "|z| = 1"
