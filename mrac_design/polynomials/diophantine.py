"""The Diophantine equation A X + B Y = C, in floating and in exact arithmetic.

Polynomials here have no roles yet: in pole placement A and B are the process, X and Y
become R and S, and C is the wanted closed loop [AW 5.66]. The solution is the one with
deg Y < deg A, unique when A and B are coprime; all others are X + Q B, Y − Q A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import fmpq_poly

from mrac_design.arrays import FloatArray
from mrac_design.errors import IllConditionedError, NotCoprimeError, ParameterError
from mrac_design.polynomials.rationals import (
    binary_polynomial,
    coefficients,
    polynomial_latex,
    roots,
)
from mrac_design.polynomials.sylvester import SylvesterMatrix, closest_roots, coprimeness

RESIDUAL_LIMIT = 1e-10
"""Largest relative residual a floating solution may have, unless the caller says otherwise."""

REFINEMENTS = 8
"""Most steps of iterative refinement; three are usual."""

COPRIME_LIMIT = 1e12
"""Largest Bauer–Skeel condition number at which float64 data still tell coprime from not.

Data that a componentwise relative change of 1e-12 would make share a root have at least
this condition number, so they are always refused; 1e-12 leaves room for coefficients that
were themselves computed, for instance from roots spread over decades.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class DiophantineEquation:
    """A X + B Y = C with A and B coprime over the rationals.

    Raises ParameterError when A is constant or B or C is zero, NotCoprimeError with the
    common roots when A and B share a factor.
    """

    A: fmpq_poly
    """First coefficient polynomial, degree at least 1."""

    B: fmpq_poly
    """Second coefficient polynomial, not zero."""

    C: fmpq_poly
    """Right-hand side, not zero."""

    def __post_init__(self) -> None:
        if self.A.degree() < 1:
            raise ParameterError("degree of A", self.A.degree(), "must be at least 1")
        for name, polynomial in (("B", self.B), ("C", self.C)):
            if polynomial.is_zero():
                raise ParameterError(name, 0, "must not be the zero polynomial")
        common = self.A.gcd(self.B)
        if common.degree() > 0:
            raise NotCoprimeError([complex(root) for root in roots(common)])

    @property
    def degree_X(self) -> int:
        """Largest degree X can have in the solution of minimal degree."""
        return max(self.C.degree() - self.A.degree(), self.B.degree() - 1, 0)

    @property
    def degree_Y(self) -> int:
        """Largest degree Y can have in the solution of minimal degree."""
        return self.A.degree() - 1

    def remainder(self, X: fmpq_poly, Y: fmpq_poly) -> fmpq_poly:
        """C − A X − B Y, exactly."""
        return self.C - self.A * X - self.B * Y

    def _repr_latex_(self) -> str:
        A, B, C = (polynomial_latex(part, "p") for part in (self.A, self.B, self.C))
        return f"$({A})\\,X + ({B})\\,Y = {C}$"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SylvesterSystem:
    """The linear equations in the coefficients of X and Y: `matrix` @ (X, Y) = `right_side`."""

    equation: DiophantineEquation
    """The polynomial equation these are."""

    sylvester: SylvesterMatrix
    """The coefficients, scaled and equilibrated."""

    @staticmethod
    def of(equation: DiophantineEquation) -> SylvesterSystem:
        """The equations of the solution of minimal degree, deg Y < deg A."""
        return SylvesterSystem(
            equation=equation,
            sylvester=SylvesterMatrix.of(
                equation.A, equation.B, equation.degree_X, equation.degree_Y
            ),
        )

    @property
    def matrix(self) -> FloatArray:
        """Sylvester matrix (N, N), N = deg X + deg Y + 2; row i belongs to power N − 1 − i, the
        columns to the coefficients of X, then of Y, highest power first."""
        return self.sylvester.unscaled()

    @property
    def right_side(self) -> FloatArray:
        """Coefficients of C, highest power first, (N,)."""
        return coefficients(self.equation.C, self.sylvester.size)

    def _repr_latex_(self) -> str:
        rows = " \\\\ ".join(" & ".join(f"{value:.6g}" for value in row) for row in self.matrix)
        unknowns = [f"x_{{{power}}}" for power in range(self.equation.degree_X, -1, -1)]
        unknowns += [f"y_{{{power}}}" for power in range(self.equation.degree_Y, -1, -1)]
        right = " \\\\ ".join(f"{value:.6g}" for value in self.right_side)
        columns = "".join(
            f"\\begin{{pmatrix}}{body}\\end{{pmatrix}}{sign}"
            for body, sign in ((rows, ""), (" \\\\ ".join(unknowns), "="), (right, ""))
        )
        return f"${columns}$"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiophantineSolution:
    """Floating solution of minimal degree, with what is needed to judge it."""

    equation: DiophantineEquation
    """What it solves."""

    X: FloatArray
    """Coefficients of X, highest power first."""

    Y: FloatArray
    """Coefficients of Y, highest power first."""

    residual: float
    """Largest coefficient of A X + B Y − C relative to that of C, evaluated exactly at the
    float64 values of X and Y; a coefficient of C stands here for that of the polynomial
    whose roots are the moduli of C's roots, which never vanishes by cancellation."""

    coprimeness: float
    """Smallest singular value of the Sylvester matrix of A and B, each of unit norm, with
    time scaled: below relative changes of the coefficients by this / √(deg A + deg B) (2-norm)
    A and B stay coprime. 1 is best, 0 means a common factor."""

    condition: float
    """Bauer–Skeel condition number of the equations: a relative change of the data by δ can
    change the solution by about δ times this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactDiophantineSolution:
    """Solution of minimal degree over the rationals; its remainder is identically zero."""

    equation: DiophantineEquation
    """What it solves."""

    X: fmpq_poly
    """First unknown."""

    Y: fmpq_poly
    """Second unknown, deg Y < deg A."""

    @property
    def remainder(self) -> fmpq_poly:
        """C − A X − B Y recomputed from the polynomials."""
        return self.equation.remainder(self.X, self.Y)


def solve_diophantine_exact(equation: DiophantineEquation) -> ExactDiophantineSolution:
    """The solution with deg Y < deg A over the rationals, by Euclid's algorithm."""
    _, _, cofactor = equation.A.xgcd(equation.B)
    Y = (cofactor * equation.C) % equation.A
    X = (equation.C - equation.B * Y) // equation.A
    return ExactDiophantineSolution(equation=equation, X=X, Y=Y)


def solve_diophantine(
    system: SylvesterSystem, *, residual_limit: float = RESIDUAL_LIMIT
) -> DiophantineSolution:
    """Solve the linear equations in float64: scaled in time, equilibrated, refined.

    Raises NotCoprimeError when the data cannot be told from data with a common root, and
    IllConditionedError when no float64 X, Y were found that meet `residual_limit`.
    """
    equation, sylvester = system.equation, system.sylvester
    condition = sylvester.condition
    if not condition < COPRIME_LIMIT:
        raise NotCoprimeError(closest_roots(equation.A, equation.B))
    X, Y, residual = _refine(equation, sylvester)
    separation = coprimeness(equation.A, equation.B, sylvester.frequency)
    if not residual <= residual_limit:
        raise IllConditionedError(
            residual=residual,
            limit=residual_limit,
            cancellation=cancellation(equation.A, equation.B, equation.C, X, Y),
            coprimeness=separation,
        )
    return DiophantineSolution(
        equation=equation,
        X=X,
        Y=Y,
        residual=residual,
        coprimeness=separation,
        condition=condition,
    )


def require_coprime(A: fmpq_poly, B: fmpq_poly) -> None:
    """Refuse A and B that float64 cannot tell from polynomials with a common root.

    Raises NotCoprimeError with the roots that meet.
    """
    if B.degree() > 0:
        sylvester = SylvesterMatrix.of(A, B, B.degree() - 1, A.degree() - 1)
        if not sylvester.condition < COPRIME_LIMIT:
            raise NotCoprimeError(closest_roots(A, B))


def relative_residual(
    A: fmpq_poly, B: fmpq_poly, C: fmpq_poly, X: FloatArray, Y: FloatArray
) -> float:
    """Residual of floating X and Y as `DiophantineSolution.residual` defines it."""
    remainder = C - A * binary_polynomial(X) - B * binary_polynomial(Y)
    return _relative(remainder, _majorant(C))


def cancellation(A: fmpq_poly, B: fmpq_poly, C: fmpq_poly, X: FloatArray, Y: FloatArray) -> float:
    """Largest coefficient of |A||X| + |B||Y| relative to that of C, at least about 1.

    Rounding X and Y to float64 alone makes a residual of about 1e-16 times this.
    """
    sizes = _absolute(A) * binary_polynomial(np.abs(X)) + _absolute(B) * binary_polynomial(
        np.abs(Y)
    )
    return _relative(sizes, _majorant(C))


def _absolute(polynomial: fmpq_poly) -> fmpq_poly:
    return fmpq_poly([abs(value) for value in polynomial.coeffs()])


def _relative(remainder: fmpq_poly, majorant: fmpq_poly) -> float:
    length = max(majorant.degree(), remainder.degree()) + 1
    size = coefficients(majorant, length)
    error = np.abs(coefficients(remainder, length))
    # Above C's own degree there is nothing to be relative to: any error there is total.
    ratio = np.divide(error, size, out=np.where(error > 0.0, np.inf, 0.0), where=size > 0.0)
    return float(ratio.max())


def _majorant(polynomial: fmpq_poly) -> fmpq_poly:
    """The polynomial with the moduli of the roots: its coefficients bound the other's.

    A root at the origin counts with the geometric mean of the others, or 1.
    """
    moduli = np.abs(roots(polynomial))
    others = moduli[moduli > 0.0]
    typical = float(np.exp(np.log(others).mean())) if others.size else 1.0
    product = fmpq_poly([abs(polynomial.leading_coefficient())])
    for modulus in moduli:
        product *= binary_polynomial([1.0, modulus if modulus > 0.0 else typical])
    return product


def _refine(
    equation: DiophantineEquation, sylvester: SylvesterMatrix
) -> tuple[FloatArray, FloatArray, float]:
    """Iterative refinement with the residual taken in exact arithmetic."""
    vector = sylvester.solve(coefficients(equation.C, sylvester.size))
    best = (*sylvester.split(vector), np.inf)
    majorant = _majorant(equation.C)
    for _ in range(REFINEMENTS):
        X, Y = sylvester.split(vector)
        remainder = equation.remainder(binary_polynomial(X), binary_polynomial(Y))
        residual = _relative(remainder, majorant)
        if not residual < best[2]:
            break
        best = (X, Y, residual)
        if remainder.is_zero():
            break
        vector = vector + sylvester.solve(coefficients(remainder, sylvester.size))
    return best
