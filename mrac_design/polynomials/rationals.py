"""Between numbers as people and processors write them and polynomials over the rationals.

A float is a rational number, but which one? `decimal_rational` takes the shortest decimal
that rounds to it (0.7 is 7/10: what the engineer typed), `binary_rational` the value the
processor holds (0.7 is 3152519739159347/2^52). Both round back to the same float. Data of a
problem are read the first way, computed results are judged the second way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from numbers import Rational
from typing import cast

import numpy as np
from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly, fmpz
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError

Number = int | float | str | Fraction | fmpq | fmpz
"""What counts as a rational number: "2/3" and "0.7" are strings that do."""

ROOT_PRECISION = 128
"""Bits used to enclose roots before they are rounded to float64."""


def decimal_rational(value: Number) -> fmpq:
    """The rational number a person means by `value`; a float is read as its shortest decimal.

    Raises ParameterError when it is not a finite real number.
    """
    if isinstance(value, fmpq | fmpz):
        return fmpq(value)
    try:
        if isinstance(value, np.integer):
            fraction = Fraction(int(value))
        elif isinstance(value, str | Rational):
            fraction = Fraction(value)
        else:
            fraction = Fraction(repr(float(value)))
    except (TypeError, ValueError, ZeroDivisionError) as error:
        raise ParameterError("coefficient", value, "must be a finite real number") from error
    return fmpq(fraction.numerator, fraction.denominator)


def binary_rational(value: float) -> fmpq:
    """The rational number the processor holds for the finite float `value`.

    Raises ParameterError when it is not finite.
    """
    if not math.isfinite(value):
        raise ParameterError("coefficient", value, "must be a finite real number")
    return fmpq(*float(value).as_integer_ratio())


def exact_polynomial(values: fmpq_poly | Number | Iterable[Number]) -> fmpq_poly:
    """Polynomial over the rationals from its coefficients, highest power first.

    A single number is a constant polynomial. Raises ParameterError for coefficients that
    are not finite real numbers.
    """
    if isinstance(values, fmpq_poly):
        return fmpq_poly(values)
    if isinstance(values, str | float | int | Rational | fmpq | fmpz | np.number):
        return fmpq_poly([decimal_rational(values)])
    return fmpq_poly([decimal_rational(value) for value in values][::-1])


def binary_polynomial(values: Sequence[float] | FloatArray) -> fmpq_poly:
    """The polynomial over the rationals that a floating one, highest power first, is."""
    return fmpq_poly([binary_rational(float(value)) for value in values][::-1])


def nearest_float(value: fmpq) -> float:
    """The float64 nearest to a rational number."""
    return int(value.p) / int(value.q)


def coefficients(polynomial: fmpq_poly, length: int | None = None) -> FloatArray:
    """Correctly rounded coefficients, highest power first, padded in front to `length`."""
    values = [nearest_float(value) for value in polynomial.coeffs()] or [0.0]
    padding = 0 if length is None else length - len(values)
    return readonly([0.0] * padding + values[::-1])


def roots(polynomial: fmpq_poly) -> NDArray[np.complex128]:
    """All roots with their multiplicity, (degree,), each rounded from a proved enclosure.

    Multiple roots come out equal, which no floating method achieves. Raises ParameterError
    for the zero polynomial.
    """
    if polynomial.is_zero():
        raise ParameterError("polynomial", 0, "every number is a root of zero")
    return np.array([_rounded(root) for root in _enclosures(polynomial)], complex)


def dyadic_factor(polynomial: fmpq_poly, chosen: NDArray[np.bool_]) -> fmpq_poly:
    """Monic factor with the `chosen` ones of the roots in the order of `roots`, to 128 bits.

    The chosen roots must come with their conjugates.
    """
    with ctx.workprec(ROOT_PRECISION):
        product = acb_poly([1])
        for root, wanted in zip(_enclosures(polynomial), chosen, strict=True):
            if wanted:
                product *= acb_poly([-root, 1])
        return fmpq_poly([_midpoint(value.real) for value in product.coeffs()])


def _enclosures(polynomial: fmpq_poly) -> list[acb]:
    """Enclosures of all roots, by modulus, then real, then imaginary part."""
    with ctx.workprec(ROOT_PRECISION):
        enclosed = cast(list[tuple[acb, int]], polynomial.complex_roots())
    found = [root for root, multiplicity in enclosed for _ in range(multiplicity)]
    return sorted(found, key=_order)


def _order(root: acb) -> tuple[float, float, float]:
    value = _rounded(root)
    return abs(value), value.real, value.imag


def _rounded(root: acb) -> complex:
    return complex(float(root.real.mid()), float(root.imag.mid()))


def _midpoint(ball: arb) -> fmpq:
    mantissa, exponent = ball.mid().man_exp()
    return fmpq(mantissa) * fmpq(2) ** int(exponent)


def polynomial_latex(polynomial: fmpq_poly | Sequence[float] | FloatArray, variable: str) -> str:
    """The polynomial in LaTeX, six digits for floats, fractions for rationals."""
    if isinstance(polynomial, fmpq_poly):
        exact = [Fraction(int(value.p), int(value.q)) for value in polynomial.coeffs()]
        terms = [(_signed_fraction(value), power) for power, value in enumerate(exact) if value]
    else:
        descending = np.trim_zeros(np.asarray(polynomial, float), "f")
        terms = [
            (_signed_decimal(value), power)
            for power, value in enumerate(descending[::-1])
            if value != 0.0
        ]
    if not terms:
        return "0"
    text = " ".join(_term(sign, size, power, variable) for (sign, size), power in terms[::-1])
    return text.removeprefix("+ ") if text[0] == "+" else "-" + text[2:]


def _term(sign: str, size: str, power: int, variable: str) -> str:
    if power == 0:
        return f"{sign} {size}"
    factor = variable if power == 1 else f"{variable}^{{{power}}}"
    return f"{sign} {factor}" if size == "1" else f"{sign} {size}\\,{factor}"


def _signed_fraction(value: Fraction) -> tuple[str, str]:
    size = abs(value)
    integer = size.denominator == 1
    text = str(size) if integer else f"\\tfrac{{{size.numerator}}}{{{size.denominator}}}"
    return ("-" if value < 0 else "+", text)


def _signed_decimal(value: float) -> tuple[str, str]:
    mantissa, _, exponent = f"{abs(value):.6g}".partition("e")
    text = f"{mantissa}\\cdot 10^{{{int(exponent)}}}" if exponent else mantissa
    return ("-" if value < 0 else "+", text)
