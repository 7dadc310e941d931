"""RST controllers in letters: closed forms and exact sensitivities to what they are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design.rst import RSTSpecification
from mrac_design.errors import ParameterError
from mrac_design.polynomials.expressions import Expression, Letter, solve_symbolic, symbols
from mrac_design.polynomials.rationals import Number, nearest_float

VELOCITY_GAIN = Letter(name="K2", latex="K_2")
STIFFNESS = Letter(name="Ks", latex="K_s")
BANDWIDTH = Letter(name="omega", latex=r"\omega")
DAMPING = Letter(name="xi", latex=r"\xi")
OBSERVER_POLE = Letter(name="ao", latex="a_o")
OBSERVER_FIRST = Letter(name="alpha1", latex=r"\alpha_1")
OBSERVER_SECOND = Letter(name="alpha2", latex=r"\alpha_2")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """One controller coefficient in letters."""

    name: str
    """Name, for instance "s0"."""

    expression: Expression
    """Its closed form."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensitivityTable:
    """How the controller coefficients depend on the numbers they are computed from."""

    coefficients: tuple[str, ...]
    """Names of the rows."""

    letters: tuple[str, ...]
    """Names of the columns."""

    derivatives: FloatArray
    """Partial derivatives in SI units, correctly rounded, (coefficients, letters)."""

    relative: FloatArray
    """Relative change of a coefficient per relative change of a letter, dimensionless,
    (coefficients, letters); nan in the row of a coefficient that is zero."""

    def _repr_markdown_(self) -> str:
        head = "| d ln / d ln | " + " | ".join(self.letters) + " |\n"
        rule = "|---" * (len(self.letters) + 1) + "|\n"
        rows = (
            f"| {name} | " + " | ".join(f"{value:.4g}" for value in row) + " |\n"
            for name, row in zip(self.coefficients, self.relative, strict=True)
        )
        return head + rule + "".join(rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm:
    """Coefficients of R, S and T as expressions in the plant's and the designer's letters."""

    entries: tuple[Coefficient, ...]
    """The coefficients that are not 1 or 0 by structure."""

    def __getitem__(self, name: str) -> Expression:
        for entry in self.entries:
            if entry.name == name:
                return entry.expression
        known = ", ".join(entry.name for entry in self.entries)
        raise ParameterError("coefficient", name, f"must be one of {known}")

    def at(self, values: Mapping[str, Number]) -> tuple[fmpq, ...]:
        """Exact values of all coefficients; floats are read as decimals."""
        return tuple(entry.expression.at(values) for entry in self.entries)

    def sensitivities(self, values: Mapping[str, Number]) -> SensitivityTable:
        """Exact derivatives by every letter, evaluated at `values` and rounded once."""
        letters = self.entries[0].expression.letters
        derivatives, relative = [], []
        for entry in self.entries:
            value = entry.expression.at(values)
            slopes = [entry.expression.derivative(letter.name).at(values) for letter in letters]
            derivatives.append([nearest_float(slope) for slope in slopes])
            points = [symbol.at(values) for symbol in symbols(letters)]
            relative.append(
                [nearest_float(slope * x / value) for slope, x in zip(slopes, points, strict=True)]
                if value != 0
                else [np.nan] * len(letters)
            )
        return SensitivityTable(
            coefficients=tuple(entry.name for entry in self.entries),
            letters=tuple(letter.name for letter in letters),
            derivatives=readonly(derivatives),
            relative=readonly(relative),
        )

    def _repr_latex_(self) -> str:
        rows = (
            f"{entry.name[0]}_{{{entry.name[1:]}}} &= {entry.expression.latex()}"
            for entry in self.entries
        )
        return "$\\begin{aligned}" + " \\\\ ".join(rows) + "\\end{aligned}$"


def rst_closed_form() -> ClosedForm:
    """r1, s0, s1, t0, t1 of the force plant in K2, Ks, omega, xi, ao.

    Derived by solving p(p + K2) R + Ks S = (p + ao)(p² + 2ξω p + ω²) in letters.
    """
    K2, Ks, omega, xi, ao = symbols((VELOCITY_GAIN, STIFFNESS, BANDWIDTH, DAMPING, OBSERVER_POLE))
    one, zero = K2.constant(1), K2.constant(0)
    Am, Ao = [one, 2 * xi * omega, omega * omega], [one, ao]
    R, S = solve_symbolic([one, K2, zero], [Ks], _product(Am, Ao))
    T = [omega * omega / Ks * value for value in Ao]
    return ClosedForm(
        entries=(*_numbered("r", 1, R[1:]), *_numbered("s", 0, S), *_numbered("t", 0, T))
    )


def integral_rst_closed_form() -> ClosedForm:
    """r1, s0, s1, s2, t0, t1, t2 of the controller with integrator, R = p(p + r1).

    Letters K2, Ks, omega, xi and alpha1, alpha2 of Ao = p² + α1 p + α2.
    """
    K2, Ks, omega, xi, alpha1, alpha2 = symbols(
        (VELOCITY_GAIN, STIFFNESS, BANDWIDTH, DAMPING, OBSERVER_FIRST, OBSERVER_SECOND)
    )
    one, zero = K2.constant(1), K2.constant(0)
    Am, Ao = [one, 2 * xi * omega, omega * omega], [one, alpha1, alpha2]
    X, S = solve_symbolic([one, K2, zero, zero], [Ks], _product(Am, Ao))
    T = [omega * omega / Ks * value for value in Ao]
    return ClosedForm(
        entries=(*_numbered("r", 1, X[1:]), *_numbered("s", 0, S), *_numbered("t", 0, T))
    )


def rst_sensitivities(specification: RSTSpecification) -> SensitivityTable:
    """Sensitivities of r1, s0, s1, t0, t1 to K2, Ks, ω, ξ and ao at a design."""
    model, plant = specification.reference_model, specification.plant
    return rst_closed_form().sensitivities(
        {
            "K2": plant.velocity_gain,
            "Ks": plant.stiffness,
            "omega": model.bandwidth,
            "xi": model.damping,
            "ao": specification.observer_pole,
        }
    )


def integral_rst_sensitivities(specification: RSTSpecification) -> SensitivityTable:
    """Sensitivities of r1, s0, s1, s2, t0, t1, t2 to K2, Ks, ω, ξ, α1 and α2 at a design.

    Raises ParameterError for a design whose internal model is not p.
    """
    if specification.internal_model != (1.0, 0.0):
        raise ParameterError("internal model", specification.internal_model, "must be p: (1, 0)")
    model, plant = specification.reference_model, specification.plant
    return integral_rst_closed_form().sensitivities(
        {
            "K2": plant.velocity_gain,
            "Ks": plant.stiffness,
            "omega": model.bandwidth,
            "xi": model.damping,
            "alpha1": specification.observer[1],
            "alpha2": specification.observer[2],
        }
    )


def _product(left: list[Expression], right: list[Expression]) -> list[Expression]:
    total = [left[0].constant(0)] * (len(left) + len(right) - 1)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            total[i + j] = total[i + j] + a * b
    return total


def _numbered(
    letter: str, first: int, expressions: Sequence[Expression]
) -> tuple[Coefficient, ...]:
    return tuple(
        Coefficient(name=f"{letter}{number}", expression=expression)
        for number, expression in enumerate(expressions, first)
    )
