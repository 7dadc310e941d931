"""Solved pole placements, floating and exact, which judge themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from flint import fmpq_poly
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray
from mrac_design.design.loop import FeedbackLoop
from mrac_design.design.margins import StabilityMargins
from mrac_design.design.pole_placement import PolePlacement
from mrac_design.errors import CancellationError, IllConditionedError
from mrac_design.polynomials.diophantine import (
    RESIDUAL_LIMIT,
    SylvesterSystem,
    cancellation,
    relative_residual,
    require_coprime,
    solve_diophantine,
    solve_diophantine_exact,
)
from mrac_design.polynomials.rationals import (
    binary_polynomial,
    coefficients,
    polynomial_latex,
    roots,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolynomialDesign:
    """Floating controller R u = T uc − S y of a pole placement."""

    specification: PolePlacement
    """What was asked for."""

    R: FloatArray
    """Monic denominator, highest power first."""

    S: FloatArray
    """Feedback numerator, highest power first."""

    T: FloatArray
    """Reference numerator, highest power first."""

    residual: float
    """Largest coefficient of A R + B S − Ao Am B⁺ relative to that of Ao Am B⁺, evaluated
    exactly at the float64 values of R and S."""

    coprimeness: float
    """Smallest singular value of the scaled Sylvester matrix, 0 (common factor) … 1."""

    condition: float
    """How strongly a relative change of the coefficients of A and B changes R and S."""

    @property
    def loop(self) -> FeedbackLoop:
        """The loop these floats close, over the rationals they are."""
        R, S, T = (binary_polynomial(part) for part in (self.R, self.S, self.T))
        return FeedbackLoop(process=self.specification.process, R=R, S=S, T=T)

    @property
    def closed_loop_poles(self) -> NDArray[np.complex128]:
        """Roots of A R + B S, (n,)."""
        return self.loop.poles

    def margins(self) -> StabilityMargins:
        """Stability margins of the loop."""
        return self.loop.margins()

    def _repr_latex_(self) -> str:
        return _controller_latex(self.R, self.S, self.T, self.specification)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactPolynomialDesign:
    """Controller R u = T uc − S y of a pole placement over the rationals."""

    specification: PolePlacement
    """What was asked for."""

    R: fmpq_poly
    """Monic denominator."""

    S: fmpq_poly
    """Feedback numerator."""

    T: fmpq_poly
    """Reference numerator."""

    @property
    def remainder(self) -> fmpq_poly:
        """A R + B S − Ao Am B⁺ recomputed from the polynomials; identically zero."""
        return self.loop.characteristic - self.specification.closed_loop

    @property
    def loop(self) -> FeedbackLoop:
        """The closed loop."""
        return FeedbackLoop(process=self.specification.process, R=self.R, S=self.S, T=self.T)

    def _repr_latex_(self) -> str:
        return _controller_latex(self.R, self.S, self.T, self.specification)


def place_poles(
    specification: PolePlacement, *, residual_limit: float = RESIDUAL_LIMIT
) -> PolynomialDesign:
    """Solve a pole placement in float64.

    Raises NotCoprimeError when A Rf and B⁻ Sf, or A and B, cannot be told from polynomials
    with a common root, IllConditionedError when the residual exceeds `residual_limit`.
    """
    require_coprime(specification.process.A, specification.process.B)
    solution = solve_diophantine(
        SylvesterSystem.of(specification.equation), residual_limit=residual_limit
    )
    R, S, T = specification.controller(binary_polynomial(solution.X), binary_polynomial(solution.Y))
    unchecked = PolynomialDesign(
        specification=specification,
        R=coefficients(R),
        S=coefficients(S),
        T=coefficients(T),
        residual=solution.residual,
        coprimeness=solution.coprimeness,
        condition=solution.condition,
    )
    return rounded_design(unchecked, R=R, S=S, residual_limit=residual_limit)


def rounded_design(
    design: PolynomialDesign, *, R: fmpq_poly, S: fmpq_poly, residual_limit: float
) -> PolynomialDesign:
    """`design` with R and S rounded to float64 and its residual evaluated at them.

    Raises IllConditionedError when the residual exceeds `residual_limit`.
    """
    floating_R, floating_S = coefficients(R), coefficients(S)
    specification = design.specification
    problem = (specification.process.A, specification.process.B, specification.closed_loop)
    residual = relative_residual(*problem, floating_R, floating_S)
    if not residual <= residual_limit:
        raise IllConditionedError(
            residual=residual,
            limit=residual_limit,
            cancellation=cancellation(*problem, floating_R, floating_S),
            coprimeness=design.coprimeness,
        )
    return replace(design, R=floating_R, S=floating_S, residual=residual)


def place_poles_exact(specification: PolePlacement) -> ExactPolynomialDesign:
    """Solve a pole placement over the rationals.

    Raises CancellationError when the cancelled zeros are irrational and cannot be separated
    from the kept ones, NotCoprimeError as `PolePlacement.equation`.
    """
    if not specification.split.exact:
        raise CancellationError(
            [complex(zero) for zero in roots(specification.split.cancelled)],
            "over the rationals they cannot be separated from zeros that stay; design in "
            "floating arithmetic, or change the region so that it does not part them",
        )
    solution = solve_diophantine_exact(specification.equation)
    R, S, T = specification.controller(solution.X, solution.Y)
    return ExactPolynomialDesign(specification=specification, R=R, S=S, T=T)


def _controller_latex(
    R: FloatArray | fmpq_poly,
    S: FloatArray | fmpq_poly,
    T: FloatArray | fmpq_poly,
    specification: PolePlacement,
) -> str:
    variable = specification.process.domain.variable
    rows = (
        f"{name}({variable}) &= {polynomial_latex(part, variable)}"
        for name, part in (("R", R), ("S", S), ("T", T))
    )
    return "$\\begin{aligned}" + " \\\\ ".join(rows) + "\\end{aligned}$"
