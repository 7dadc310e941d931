"""Rational expressions in letters, always reduced, and the Diophantine equation over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flint import Ordering, fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number, decimal_rational


@dataclass(frozen=True, slots=True, kw_only=True)
class Letter:
    """One symbol."""

    name: str
    """Name in Python, for instance "omega"."""

    latex: str
    """How it is printed, for instance r"\\omega"."""


@dataclass(frozen=True, slots=True, eq=False)
class Expression:
    """numerator/denominator in letters, without common factor; denominators are monic."""

    numerator: fmpq_mpoly
    """Polynomial over the rationals in the letters."""

    denominator: fmpq_mpoly
    """Polynomial in the same letters, not zero."""

    letters: tuple[Letter, ...]
    """The letters, in the order of the polynomials' variables."""

    def __post_init__(self) -> None:
        if self.denominator.is_zero():
            raise ZeroDivisionError("division of an expression by zero")
        common = self.numerator.gcd(self.denominator)
        numerator, denominator = self.numerator / common, self.denominator / common
        leading = denominator.leading_coefficient()
        object.__setattr__(self, "numerator", numerator / leading)
        object.__setattr__(self, "denominator", denominator / leading)

    def _lift(self, other: Expression | int | fmpq) -> Expression:
        return other if isinstance(other, Expression) else self.constant(other)

    def constant(self, value: int | fmpq) -> Expression:
        """A number as an expression in the same letters."""
        one = self.denominator.context().constant(1)
        return Expression(one * value, one, self.letters)

    def __add__(self, other: Expression | int | fmpq) -> Expression:
        right = self._lift(other)
        return Expression(
            self.numerator * right.denominator + right.numerator * self.denominator,
            self.denominator * right.denominator,
            self.letters,
        )

    def __mul__(self, other: Expression | int | fmpq) -> Expression:
        right = self._lift(other)
        return Expression(
            self.numerator * right.numerator, self.denominator * right.denominator, self.letters
        )

    def __truediv__(self, other: Expression | int | fmpq) -> Expression:
        right = self._lift(other)
        return Expression(
            self.numerator * right.denominator, self.denominator * right.numerator, self.letters
        )

    def __neg__(self) -> Expression:
        return Expression(-self.numerator, self.denominator, self.letters)

    def __sub__(self, other: Expression | int | fmpq) -> Expression:
        return self + (-self._lift(other))

    __radd__ = __add__
    __rmul__ = __mul__

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Expression | int | fmpq):
            return NotImplemented
        right = self._lift(other)
        return bool(self.numerator * right.denominator == right.numerator * self.denominator)

    @property
    def is_zero(self) -> bool:
        """Whether it vanishes identically."""
        return bool(self.numerator.is_zero())

    def derivative(self, name: str) -> Expression:
        """Exact partial derivative by the letter called `name`; ParameterError if unknown."""
        index = self._index(name)
        top, bottom = self.numerator, self.denominator
        return Expression(
            top.derivative(index) * bottom - top * bottom.derivative(index),
            bottom**2,
            self.letters,
        )

    def at(self, values: Mapping[str, Number]) -> fmpq:
        """Exact value with every letter replaced; floats are read as decimals.

        Raises ParameterError when a letter has no value or the denominator vanishes there.
        """
        missing = [letter.name for letter in self.letters if letter.name not in values]
        if missing:
            raise ParameterError("letters", ", ".join(missing), "need a value")
        point = [decimal_rational(values[letter.name]) for letter in self.letters]
        bottom = fmpq(self.denominator(*point))
        if bottom == 0:
            raise ParameterError("denominator", self.latex(), "vanishes at these values")
        return fmpq(self.numerator(*point)) / bottom

    def latex(self) -> str:
        """The expression in LaTeX."""
        top = _polynomial_latex(self.numerator, self.letters)
        if self.denominator.is_one():
            return top
        return f"\\frac{{{top}}}{{{_polynomial_latex(self.denominator, self.letters)}}}"

    def _repr_latex_(self) -> str:
        return f"${self.latex()}$"

    def _index(self, name: str) -> int:
        for index, letter in enumerate(self.letters):
            if letter.name == name:
                return index
        known = ", ".join(letter.name for letter in self.letters)
        raise ParameterError("letter", name, f"must be one of {known}")


def symbols(letters: Sequence[Letter]) -> tuple[Expression, ...]:
    """The letters themselves as expressions, which can be calculated with."""
    context = fmpq_mpoly_ctx.get([letter.name for letter in letters], Ordering.degrevlex)
    one = context.constant(1)
    return tuple(Expression(variable, one, tuple(letters)) for variable in context.gens())


def solve_symbolic(
    A: Sequence[Expression], B: Sequence[Expression], C: Sequence[Expression]
) -> tuple[tuple[Expression, ...], tuple[Expression, ...]]:
    """X and Y of A X + B Y = C with deg Y < deg A; coefficients highest power first.

    Raises ParameterError when A and B have a common factor whatever the letters' values.
    """
    degree_A, degree_B = len(A) - 1, len(B) - 1
    degree_X = max(len(C) - 1 - degree_A, degree_B - 1, 0)
    size = degree_X + degree_A + 1
    zero = A[0].constant(0)
    columns = [_shifted(A, size, shift, zero) for shift in range(degree_X, -1, -1)]
    columns += [_shifted(B, size, shift, zero) for shift in range(degree_A - 1, -1, -1)]
    right = _shifted(C, size, 0, zero)
    rows = [[column[i] for column in columns] + [right[i]] for i in range(size)]
    solution = _eliminate(rows)
    return tuple(solution[: degree_X + 1]), tuple(solution[degree_X + 1 :])


def _shifted(
    polynomial: Sequence[Expression], size: int, shift: int, zero: Expression
) -> list[Expression]:
    front = size - shift - len(polynomial)
    return [zero] * front + list(polynomial) + [zero] * shift


def _eliminate(rows: list[list[Expression]]) -> list[Expression]:
    """Gauss–Jordan elimination of an augmented square system."""
    for column in range(len(rows)):
        pivot = next((i for i in range(column, len(rows)) if not rows[i][column].is_zero), None)
        if pivot is None:
            raise ParameterError("A and B", "not coprime", "share a factor for all values")
        rows[column], rows[pivot] = rows[pivot], rows[column]
        head = [entry / rows[column][column] for entry in rows[column]]
        rows[column] = head
        for i, row in enumerate(rows):
            if i != column and not row[column].is_zero:
                factor = row[column]
                rows[i] = [a - factor * b for a, b in zip(row, head, strict=True)]
    return [row[-1] for row in rows]


def _polynomial_latex(polynomial: fmpq_mpoly, letters: tuple[Letter, ...]) -> str:
    terms = sorted(polynomial.terms(), key=lambda term: term[1] < 0)
    if not terms:
        return "0"
    text = "".join(_term_latex(exponents, value, letters) for exponents, value in terms)
    return text.removeprefix("+")


def _term_latex(exponents: tuple[int, ...], value: fmpq, letters: tuple[Letter, ...]) -> str:
    sign = "-" if value < 0 else "+"
    top, bottom = abs(int(value.p)), int(value.q)
    factors = " ".join(
        letter.latex if power == 1 else f"{letter.latex}^{{{power}}}"
        for letter, power in zip(letters, exponents, strict=True)
        if power
    )
    if (top, bottom) == (1, 1) and factors:
        return f"{sign}{factors}"
    size = str(top) if bottom == 1 else f"\\tfrac{{{top}}}{{{bottom}}}"
    return f"{sign}{size} {factors}".rstrip()
