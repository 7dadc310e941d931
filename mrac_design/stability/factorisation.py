"""Splittings G = G1 G2 of the force plant, with the verdicts an adaptation law depends on."""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq, fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number, binary_rational, decimal_rational
from mrac_design.polynomials.stable import is_hurwitz, is_schur
from mrac_design.stability.positive_real import (
    PositiveRealness,
    positive_real,
    strictly_positive_real,
)
from mrac_design.stability.rational_function import RationalFunction, rational_function
from mrac_design.time_domain import Continuous, TimeDomain
from mrac_design.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Factorisation:
    """One splitting of a transfer function into G1, to be strictly positive real, and G2."""

    name: str
    """How the splitting is written, in the letters of the problem."""
    first: RationalFunction
    """G1."""
    second: RationalFunction | None
    """G2; None where G1 is an error model of its own and there is nothing left over."""
    positive: PositiveRealness
    """Whether G1 is positive real."""
    strict: PositiveRealness
    """Whether G1 is strictly positive real."""

    @property
    def second_stable(self) -> bool:
        """Whether every pole of G2 is strictly stable."""
        if self.second is None:
            return True
        stable = is_hurwitz if isinstance(self.second.domain, Continuous) else is_schur
        return stable(self.second.denominator)

    @property
    def usable(self) -> bool:
        """Whether G1 is strictly positive real and G2 stable, as augmented-error proofs ask."""
        return self.strict.verdict is Verdict.PROVED and self.second_stable

    @property
    def summary(self) -> str:
        """A sentence: the verdict on G1, its reason, and what is wrong with G2 if anything is."""
        verdict = "SPR" if self.strict.verdict is Verdict.PROVED else "not SPR"
        text = f"{verdict}: {self.strict.reason}"
        if self.strict.verdict is not Verdict.PROVED and self.positive.verdict is Verdict.PROVED:
            text += "; positive real all the same"
        if not self.second_stable:
            text += "; G2 is not strictly stable"
        return text


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorisationTable:
    """Splittings of one plant, in a fixed order."""

    rows: tuple[Factorisation, ...]
    """The splittings."""

    def _repr_markdown_(self) -> str:
        lines = [
            f"| {row.name} | {row.positive.verdict.value} | {row.strict.verdict.value} "
            f"| {'yes' if row.second_stable else 'no'} | {row.summary} |"
            for row in self.rows
        ]
        head = "| G1 · G2 | G1 positive real | G1 strictly | G2 stable | reason |"
        return "\n".join(
            [head, "|---|---|---|---|---|", *(line.replace("|z|", "z") for line in lines)]
        )


def factorisations(
    stiffness: Number,
    velocity_gain: Number,
    *,
    filter_zero: Number,
    bandwidth: Number,
    damping: Number,
) -> FactorisationTable:
    """Splittings of G = Ks/(p(p + K2)) with a filter p + c, and the error model (p + c)/Am.

    `stiffness` Ks (N/m) > 0, `velocity_gain` K2 (1/s) >= 0, `filter_zero` c (1/s) > 0, and the
    reference model's `bandwidth` ω (rad/s) and `damping` ξ. Raises ParameterError outside these
    ranges. The transfer function behind [Z 10] and [AW 5.67].
    """
    Ks, K2, c, omega, xi = _checked(stiffness, velocity_gain, filter_zero, bandwidth, damping)
    p, one = fmpq_poly([0, 1]), fmpq_poly([1])
    Am = p * p + 2 * xi * omega * p + omega * omega
    splittings = (
        ("Ks/(p + K2) · 1/p", (Ks * one, p + K2), (one, p)),
        ("(p + c)/(p + K2) · Ks/(p(p + c))", (p + c, p + K2), (Ks * one, p * (p + c))),
        ("(p + c)/(p(p + K2)) · Ks/(p + c)", (p + c, p * (p + K2)), (Ks * one, p + c)),
        ("Ks · 1/(p(p + K2))", (Ks * one, one), (one, p * (p + K2))),
        ("Ks/(p(p + K2)) · 1", (Ks * one, p * (p + K2)), (one, one)),
        ("(p + c)/Am", (p + c, Am), None),
    )
    rows = (
        judged_splitting(name, first, second, Continuous()) for name, first, second in splittings
    )
    return FactorisationTable(rows=tuple(rows))


def judged_splitting(
    name: str,
    first: tuple[fmpq_poly, fmpq_poly],
    second: tuple[fmpq_poly, fmpq_poly] | None,
    domain: TimeDomain,
) -> Factorisation:
    """A splitting from (numerator, denominator) pairs, with its verdicts."""
    G1 = rational_function(*first, domain)
    return Factorisation(
        name=name,
        first=G1,
        second=None if second is None else rational_function(*second, domain),
        positive=positive_real(G1),
        strict=strictly_positive_real(G1),
    )


def _checked(
    stiffness: Number,
    velocity_gain: Number,
    filter_zero: Number,
    bandwidth: Number,
    damping: Number,
) -> tuple[fmpq, ...]:
    named = (
        ("stiffness Ks", stiffness, True),
        ("velocity gain K2", velocity_gain, False),
        ("filter zero c", filter_zero, True),
        ("bandwidth ω", bandwidth, True),
        ("damping ξ", damping, True),
    )
    values = []
    for name, value, strict in named:
        exact = binary_rational(value) if isinstance(value, float) else decimal_rational(value)
        if exact < 0 or (strict and exact == 0):
            raise ParameterError(name, value, f"must be {'> 0' if strict else '>= 0'}")
        values.append(exact)
    return tuple(values)
