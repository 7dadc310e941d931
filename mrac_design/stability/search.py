"""Every splitting G = G1 G2 that poles, zeros and added filter factors allow, with its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import control
from flint import fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.adaptive_loop import exact
from mrac_design.stability.factorisation import FactorisationTable, judged_splitting
from mrac_design.stability.rational_function import (
    Coefficients,
    RationalFunction,
    rational_function,
    to_float,
)
from mrac_design.time_domain import Continuous, TimeDomain

MOST_SPLITTINGS = 4096
"""More than this many splittings nobody reads."""

_Part = tuple[str, fmpq_poly]


def search_factorisations(
    numerator: RationalFunction | control.TransferFunction | Coefficients,
    denominator: Coefficients | None = None,
    domain: TimeDomain | None = None,
    *,
    filter_zeros: Sequence[Number],
) -> FactorisationTable:
    """All G = G1 G2 with proper G2, usable ones first.

    Every factor of G irreducible over the rationals goes to G1 or G2. For each −c in
    `filter_zeros`, a factor p + c (c a rational) may be added to the numerator of one side and the
    denominator of the other, or left out. The gain stays with G1. Raises ParameterError when more
    than 4096 splittings would come out, and as `rational_function` does.
    """
    G = rational_function(numerator, denominator, domain)
    letter = "p" if isinstance(G.domain, Continuous) else "z"
    above, below = _parts(G.numerator, letter), _parts(G.denominator, letter)
    added = [_filter(value, letter) for value in filter_zeros]
    count = 2 ** (len(above) + len(below)) * 3 ** len(added)
    if count > MOST_SPLITTINGS:
        raise ParameterError(
            "splittings", count, f"must be at most {MOST_SPLITTINGS}: give fewer filter factors"
        )
    rows = {
        name: judged_splitting(name, first, second, G.domain)
        for name, first, second in _splittings(G, above, below, added)
    }
    ranked = sorted(rows.values(), key=lambda row: (not row.usable, row.strict.verdict.value))
    return FactorisationTable(rows=tuple(ranked))


def _splittings(
    G: RationalFunction, above: list[_Part], below: list[_Part], added: list[_Part]
) -> Iterator[tuple[str, tuple[fmpq_poly, fmpq_poly], tuple[fmpq_poly, fmpq_poly]]]:
    """(name, G1, G2) of every choice that leaves G2 proper."""
    gain = fmpq_poly([G.high_frequency_gain])
    choices = [range(2)] * (len(above) + len(below)) + [range(3)] * len(added)
    for choice in product(*choices):
        tops: tuple[list[_Part], list[_Part]] = ([], [])
        bottoms: tuple[list[_Part], list[_Part]] = ([], [])
        for part, side in zip(above, choice[: len(above)], strict=True):
            tops[side].append(part)
        for part, side in zip(below, choice[len(above) : len(above) + len(below)], strict=True):
            bottoms[side].append(part)
        for part, side in zip(added, choice[len(above) + len(below) :], strict=True):
            if side < 2:
                tops[side].append(part)
                bottoms[1 - side].append(part)
        first = (gain * _multiplied(tops[0]), _multiplied(bottoms[0]))
        second = (_multiplied(tops[1]), _multiplied(bottoms[1]))
        if second[0].degree() <= second[1].degree():
            size = f"{to_float(G.high_frequency_gain):.6g}" if gain != 1 else ""
            name = f"{_fraction(size, tops[0], bottoms[0])} · {_fraction('', tops[1], bottoms[1])}"
            yield name, first, second


def _parts(p: fmpq_poly, letter: str) -> list[_Part]:
    """Monic factors irreducible over the rationals, repeated by multiplicity, with names."""
    if p.degree() < 1:
        return []
    _, factors = p.factor()
    parts = []
    for factor, multiplicity in factors:
        monic = factor / factor.leading_coefficient()
        parts += [(_name(monic, letter), monic)] * int(multiplicity)
    return parts


def _filter(zero: Number, letter: str) -> _Part:
    polynomial = fmpq_poly([-exact(zero, "filter zero"), 1])
    return _name(polynomial, letter), polynomial


def _name(p: fmpq_poly, letter: str) -> str:
    """A monic polynomial with six digits, for instance p² + 2p + 5."""
    powers = {0: "", 1: letter, 2: f"{letter}²", 3: f"{letter}³"}
    text = ""
    for k in range(p.degree(), -1, -1):
        value = to_float(p[k])
        if value == 0:
            continue
        size = "" if abs(value) == 1 and k else f"{abs(value):.6g}"
        sign = ("-" if value < 0 else "") if not text else (" - " if value < 0 else " + ")
        text += sign + size + powers.get(k, f"{letter}^{k}")
    return text


def _fraction(gain: str, tops: list[_Part], bottoms: list[_Part]) -> str:
    above = gain + "".join(f"({name})" if " " in name else name for name, _ in tops) or "1"
    below = "".join(f"({name})" if " " in name else name for name, _ in bottoms)
    if len(bottoms) > 1:
        below = f"({below})"
    return f"{above}/{below}" if below else above


def _multiplied(parts: list[_Part]) -> fmpq_poly:
    result = fmpq_poly([1])
    for _, polynomial in parts:
        result *= polynomial
    return result
