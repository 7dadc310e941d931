"""Where in its parameters a transfer function is strictly positive real: in symbols, and on a grid.

All letters stand for positive numbers. For a denominator of any degree Routh's column and for a
real part M(w), w = ω², of degree at most two the conditions are necessary and sufficient.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.polynomials.expressions import Expression, Letter, symbols
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.positive_real import strictly_positive_real
from mrac_design.stability.rational_function import RationalFunction
from mrac_design.verdict import Verdict

LETTERS = (
    Letter(name="K2", latex="K_2"),
    Letter(name="omega", latex=r"\omega"),
    Letter(name="xi", latex=r"\xi"),
    Letter(name="ao", latex="a_o"),
    Letter(name="c", latex="c"),
)
"""Velocity gain, bandwidth, damping, observer pole and filter zero, all positive."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SPRCondition:
    """When numerator/denominator in letters is strictly positive real, the letters positive."""

    name: str
    """The transfer function, in letters."""
    positive: tuple[Expression, ...]
    """Expressions that must be > 0 and are not so by the letters' signs alone."""
    valley: tuple[Expression, Expression, Expression] | None
    """(m0, m1, m2) of a quadratic M(w), whose lowest point must be above zero."""
    impossible: str | None
    """Why it can never be strictly positive real; None when it can."""

    def holds(self, values: Mapping[str, Number]) -> bool:
        """Whether the condition is met for values of all letters."""
        if self.impossible is not None:
            return False
        if any(expression.at(values) <= 0 for expression in self.positive):
            return False
        if self.valley is None:
            return True
        m0, m1, m2 = (coefficient.at(values) for coefficient in self.valley)
        return bool(m1 >= 0 or m1 * m1 < 4 * m0 * m2)

    def latex(self) -> str:
        """The inequalities in LaTeX."""
        if self.impossible is not None:
            return rf"\text{{never: {self.impossible}}}"
        parts = [f"{expression.latex()} > 0" for expression in self.positive]
        if self.valley is not None:
            m0, m1, m2 = (coefficient.latex() for coefficient in self.valley)
            parts.append(rf"{m1} > -2\sqrt{{({m0})({m2})}}")
        return r",\quad ".join(parts) if parts else r"\text{always}"

    def _repr_latex_(self) -> str:
        return f"${self.latex()}$"


def spr_condition(
    name: str, numerator: Sequence[Expression], denominator: Sequence[Expression]
) -> SPRCondition:
    """The condition for coefficients in letters, highest power first, leading ones not zero.

    Raises ParameterError when M(w) has a degree above two, where no closed form is attempted.
    """
    D, N = list(denominator), list(numerator)
    relative_degree = len(D) - len(N)
    if relative_degree not in (0, 1):
        return _never(name, f"relative degree {relative_degree}")
    M = _real_part(N, D)
    top = len(D) - 1 - relative_degree
    if top > 2:
        raise ParameterError(name, top, "M(w) needs a degree of at most 2 for a closed form")
    if D[-1].is_zero:
        return _never(name, "pole at 0")
    if M[top].is_zero:
        return _never(name, "no real part left at high frequency")
    required = [*_routh_column(D), M[0], M[top]]
    unsure = [item for item in (_stripped(e) for e in required) if not _surely_positive(item)]
    valley = (M[0], M[1], M[2]) if top == 2 and not _surely_positive(M[1]) else None
    distinct: list[Expression] = []
    for expression in unsure:
        if not any(expression == other for other in distinct):
            distinct.append(expression)
    return SPRCondition(name=name, positive=tuple(distinct), valley=valley, impossible=None)


def candidate_conditions() -> tuple[SPRCondition, ...]:
    """Conditions for the factors G1 and the error models Q/(Ao Am) that are used for the plant."""
    K2, omega, xi, ao, c = symbols(LETTERS)
    one = K2.constant(1)
    zero = K2.constant(0)
    Am = [one, 2 * (xi * omega), omega * omega]
    AoAm = _product([one, ao], Am)
    return (
        spr_condition("1/(p + K2)", [one], [one, K2]),
        spr_condition("(p + c)/(p + K2)", [one, c], [one, K2]),
        spr_condition("(p + c)/(p(p + K2))", [one, c], [one, K2, zero]),
        spr_condition("(p + c)/Am", [one, c], Am),
        spr_condition("1/Ao", [one], [one, ao]),
        spr_condition("(p + c)²/(Ao Am)", _product([one, c], [one, c]), AoAm),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RegionGrid:
    """Verdicts over a grid of two parameters, for a plot."""

    first: FloatArray
    """Values of the first parameter, (m,)."""
    second: FloatArray
    """Values of the second parameter, (n,)."""
    strictly_positive_real: NDArray[np.bool_]
    """Exact verdict at every grid point, (m, n)."""


def region_on_grid(
    function: Callable[[float, float], RationalFunction], first: FloatArray, second: FloatArray
) -> RegionGrid:
    """Decide strict positive realness exactly at every point of a grid."""
    verdicts = np.array(
        [
            [strictly_positive_real(function(x, y)).verdict is Verdict.PROVED for y in second]
            for x in first.tolist()
        ]
    )
    verdicts.setflags(write=False)
    return RegionGrid(
        first=readonly(first), second=readonly(second), strictly_positive_real=verdicts
    )


def _real_part(N: Sequence[Expression], D: Sequence[Expression]) -> list[Expression]:
    """Coefficients of Re N(jω) D(−jω) in w = ω², lowest first."""
    zero = D[0].constant(0)
    size = len(D)
    M = [zero] * size
    for i, a in enumerate(reversed(N)):
        for k, b in enumerate(reversed(D)):
            if (i + k) % 2 == 0:
                # jⁱ (−j)ᵏ = (−1)ᵏ j^(i+k), and j² = −1.
                sign = (-1) ** (k + (i + k) // 2)
                M[(i + k) // 2] = M[(i + k) // 2] + sign * (a * b)
    return M


def _routh_column(D: Sequence[Expression]) -> list[Expression]:
    """First column of Routh's array after the leading coefficient, in letters."""
    zero = D[0].constant(0)
    upper, lower = list(D[0::2]), list(D[1::2])
    column = []
    while lower:
        column.append(lower[0])
        ratio = upper[0] / lower[0]
        padded = lower[1:] + [zero] * (len(upper) - len(lower))
        upper, lower = lower, [a - ratio * b for a, b in zip(upper[1:], padded, strict=True)]
    return column


def _stripped(expression: Expression) -> Expression:
    """The numerator without the letters that divide it; positive factors change no sign."""
    numerator = expression.numerator
    one = numerator.context().constant(1)
    for letter in numerator.context().gens():
        while divmod(numerator, letter)[1] == 0:
            numerator = divmod(numerator, letter)[0]
    return Expression(numerator, one, expression.letters)


def _surely_positive(expression: Expression) -> bool:
    """Whether every coefficient is positive, so that positive letters make it positive."""
    coefficients = [*expression.numerator.coeffs(), *expression.denominator.coeffs()]
    return all(value > fmpq(0) for value in coefficients)


def _product(a: Sequence[Expression], b: Sequence[Expression]) -> list[Expression]:
    result = [a[0].constant(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            result[i + k] = result[i + k] + x * y
    return result


def _never(name: str, why: str) -> SPRCondition:
    return SPRCondition(name=name, positive=(), valley=None, impossible=why)
