"""The RST controller of one force axis: A R + b0 S = Ao Am, T = (ω²/b0) Ao [Z 7–9]."""

from __future__ import annotations

import math
from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design.placed import PlacedController
from mrac_design.design.pole_placement import FollowModel, PolePlacement
from mrac_design.design.polynomial_design import (
    ExactPolynomialDesign,
    place_poles,
    place_poles_exact,
)
from mrac_design.design.reference_model import ReferenceModel
from mrac_design.design.zeros import KeepZeros
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.diophantine import RESIDUAL_LIMIT, SylvesterSystem
from mrac_design.polynomials.rationals import decimal_rational


@dataclass(frozen=True, slots=True, kw_only=True)
class RSTSpecification:
    """Force plant, reference model and observer pole: all that determines R, S and T.

    Raises ParameterError when ao is not positive and finite.
    """

    plant: ForcePlant
    """Process with b0 = Ks, as the designer believes it to be."""

    reference_model: ReferenceModel
    """Wanted response ω²/Am from uc to the force."""

    observer_pole: float
    """ao of Ao = p + ao, rad/s, positive. Degree 1 is the least that makes S/R proper."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.observer_pole) and self.observer_pole > 0.0):
            raise ParameterError("observer pole ao", self.observer_pole, "must be > 0, in rad/s")

    @property
    def placement(self) -> PolePlacement:
        """The same problem among those for any process."""
        Am = self.reference_model.exact_polynomial
        return PolePlacement(
            process=self.plant.process,
            Am=Am,
            Ao=fmpq_poly([decimal_rational(self.observer_pole), 1]),
            zeros=KeepZeros(),
            tracking=FollowModel(Bm=fmpq_poly([Am[0]])),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RSTDesign(PlacedController):
    """R u = T uc − S y with R = p + r1, S = s0 p + s1, T = t0 p + t1."""

    specification: RSTSpecification
    """What was asked for."""

    @property
    def r1(self) -> float:
        """Pole of the controller with opposite sign, 1/s."""
        return float(self.R[1])

    @property
    def s0(self) -> float:
        """Force gain of S, m/(s²·N)."""
        return float(self.S[0])

    @property
    def s1(self) -> float:
        """Static coefficient of S, m/(s³·N)."""
        return float(self.S[1])

    @property
    def t0(self) -> float:
        """Reference gain of T, m/(s²·N)."""
        return float(self.T[0])

    @property
    def t1(self) -> float:
        """Static coefficient of T, m/(s³·N)."""
        return float(self.T[1])

    @property
    def parameters(self) -> FloatArray:
        """θ⁰ = (r1 − ao, s0, s1, t0, t1), the coefficients of R − P2, S and T [AW 5.71], (5,)."""
        return readonly(
            [self.r1 - self.specification.observer_pole, self.s0, self.s1, self.t0, self.t1]
        )

    @property
    def scaling(self) -> FloatArray:
        """Diagonal D of θ = D θ̂ in time ωt and control (b0/ω²)u, (5,):
        (ω, ω²/b0, ω³/b0, ω²/b0, ω³/b0)."""
        omega = self.specification.reference_model.bandwidth
        b0 = self.specification.plant.b0
        return readonly([omega, omega**2 / b0, omega**3 / b0, omega**2 / b0, omega**3 / b0])

    @property
    def scaled_parameters(self) -> FloatArray:
        """θ̂⁰ = D⁻¹ θ⁰, dimensionless, (5,)."""
        return readonly(self.parameters / self.scaling)

    def _repr_markdown_(self) -> str:
        rows = (
            ("r1", self.r1, "1/s"),
            ("s0", self.s0, "m/(s²·N)"),
            ("s1", self.s1, "m/(s³·N)"),
            ("t0", self.t0, "m/(s²·N)"),
            ("t1", self.t1, "m/(s³·N)"),
        )
        poles = ", ".join(f"{pole:.6g}" for pole in self.closed_loop_poles)
        body = "".join(f"| {name} | {value:.8g} | {unit} |\n" for name, value, unit in rows)
        return (
            f"| coefficient | value | unit |\n|---|---|---|\n{body}\n"
            f"Closed-loop poles {poles} rad/s; Diophantine residual {self.residual:.2g}."
        )


def diophantine_system(specification: RSTSpecification) -> SylvesterSystem:
    """Linear equations (4 × 4) in the coefficients (1, r1, s0, s1) of R and S."""
    return SylvesterSystem.of(specification.placement.equation)


def design_rst(
    specification: RSTSpecification, *, residual_limit: float = RESIDUAL_LIMIT
) -> RSTDesign:
    """RST controller of the force plant in float64, with its residual.

    Raises IllConditionedError when the residual exceeds `residual_limit`.
    """
    solved = place_poles(specification.placement, residual_limit=residual_limit)
    return RSTDesign(specification=specification, solved=solved)


def design_rst_exact(specification: RSTSpecification) -> ExactPolynomialDesign:
    """The same controller over the rationals, the plant's and model's numbers read as decimals."""
    return place_poles_exact(specification.placement)
