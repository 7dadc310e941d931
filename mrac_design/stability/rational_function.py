"""Transfer functions with rational coefficients, in lowest terms."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import control
import numpy as np
from flint import fmpq, fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import (
    Number,
    binary_rational,
    coefficients,
    decimal_rational,
    polynomial_latex,
)
from mrac_design.polynomials.stable import disc_to_half_plane
from mrac_design.time_domain import Continuous, Discrete, TimeDomain

Coefficients = fmpq_poly | Iterable[Number]
"""A polynomial over the rationals, or its coefficients, highest power first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RationalFunction:
    """G = numerator/denominator over the rationals, common factors cancelled."""

    numerator: fmpq_poly
    """N(s) or N(z)."""
    denominator: fmpq_poly
    """D(s) or D(z), leading coefficient 1."""
    domain: TimeDomain = field(default_factory=Continuous)
    """Continuous() for G(s), Discrete(period) for G(z)."""
    cancelled: fmpq_poly = field(default_factory=lambda: fmpq_poly([1]))
    """Common factor of the numerator and denominator as given; 1 when they were coprime."""

    @property
    def relative_degree(self) -> int:
        """Degree of the denominator minus degree of the numerator."""
        return int(self.denominator.degree() - self.numerator.degree())

    @property
    def high_frequency_gain(self) -> fmpq:
        """Leading coefficient of the numerator, the denominator being monic."""
        return self.numerator.leading_coefficient()

    def half_plane_image(self) -> tuple[fmpq_poly, fmpq_poly]:
        """(N, D) in s. For G(z): with z = (1 + s)/(1 − s), which keeps positive realness."""
        if isinstance(self.domain, Continuous):
            return self.numerator, self.denominator
        degree = max(self.numerator.degree(), self.denominator.degree())
        if self.numerator == 0:
            return fmpq_poly([]), disc_to_half_plane(self.denominator, degree)
        return (
            disc_to_half_plane(self.numerator, degree),
            disc_to_half_plane(self.denominator, degree),
        )

    def transfer_function(self) -> control.TransferFunction:
        """The same function as a python-control object, coefficients rounded to float64."""
        period = 0 if isinstance(self.domain, Continuous) else self.domain.period
        return control.TransferFunction(
            coefficients(self.numerator), coefficients(self.denominator), period
        )

    def latex(self) -> str:
        """The fraction in LaTeX, decimals with six digits."""
        letter = "p" if isinstance(self.domain, Continuous) else "z"
        above = polynomial_latex(coefficients(self.numerator), letter)
        below = polynomial_latex(coefficients(self.denominator), letter)
        return above if below == "1" else rf"\frac{{{above}}}{{{below}}}"

    def _repr_latex_(self) -> str:
        return f"${self.latex()}$"


def rational_function(
    numerator: RationalFunction | control.TransferFunction | Coefficients,
    denominator: Coefficients | None = None,
    domain: TimeDomain | None = None,
) -> RationalFunction:
    """G in lowest terms from coefficients (highest power first) or a python-control object.

    A float is taken as the binary fraction it holds, a string as it is written ("0.1", "1/3").
    A python-control object brings its own time domain; coefficients are continuous unless
    `domain` says otherwise. Raises ParameterError for a zero denominator, coefficients that are
    no finite numbers, or several inputs or outputs.
    """
    if isinstance(numerator, RationalFunction):
        return numerator
    if isinstance(numerator, control.TransferFunction):
        above, below, domain = _control_parts(numerator)
    else:
        above = _polynomial(numerator)
        below = _polynomial([1] if denominator is None else denominator)
    if below == 0:
        raise ParameterError("denominator", 0, "must not be the zero polynomial")
    common = above.gcd(below)
    leading = below.leading_coefficient()
    return RationalFunction(
        numerator=above // common / leading,
        denominator=below // common / leading,
        domain=Continuous() if domain is None else domain,
        cancelled=common,
    )


def to_float(value: fmpq) -> float:
    """The nearest float64; ±inf beyond its range."""
    try:
        return int(value.p) / int(value.q)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _polynomial(values: Coefficients) -> fmpq_poly:
    if isinstance(values, fmpq_poly):
        return values
    return fmpq_poly([_exact(value) for value in values][::-1])


def _exact(value: Number) -> fmpq:
    return binary_rational(value) if isinstance(value, float) else decimal_rational(value)


def _control_parts(
    system: control.TransferFunction,
) -> tuple[fmpq_poly, fmpq_poly, TimeDomain]:
    if system.ninputs != 1 or system.noutputs != 1:
        raise ParameterError(
            "transfer function",
            f"{system.noutputs} outputs, {system.ninputs} inputs",
            "needs one input and one output",
        )
    above, below = (np.asarray(part[0][0], float) for part in (system.num, system.den))
    discrete = system.isdtime(strict=True)
    period = 1.0 if system.dt is True else system.dt
    domain: TimeDomain = Discrete(float(period)) if discrete else Continuous()
    return _polynomial(above.tolist()), _polynomial(below.tolist()), domain
