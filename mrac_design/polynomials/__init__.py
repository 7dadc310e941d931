"""Exact and floating polynomials, and the Diophantine equation A X + B Y = C.

Floating polynomials are NumPy arrays, highest power first; exact ones are
`flint.fmpq_poly` over the rationals.
"""

from mrac_design.polynomials.diophantine import (
    DiophantineEquation,
    DiophantineSolution,
    ExactDiophantineSolution,
    SylvesterSystem,
    solve_diophantine,
    solve_diophantine_exact,
)
from mrac_design.polynomials.expressions import Expression, Letter, solve_symbolic, symbols
from mrac_design.polynomials.rationals import (
    binary_rational,
    coefficients,
    decimal_rational,
    exact_polynomial,
    polynomial_latex,
    roots,
)

__all__ = [
    "DiophantineEquation",
    "DiophantineSolution",
    "ExactDiophantineSolution",
    "Expression",
    "Letter",
    "SylvesterSystem",
    "binary_rational",
    "coefficients",
    "decimal_rational",
    "exact_polynomial",
    "polynomial_latex",
    "roots",
    "solve_diophantine",
    "solve_diophantine_exact",
    "solve_symbolic",
    "symbols",
]
