"""The RST controller of one force axis: A R + b0 S = Ao Am, T = (ω²/b0) Ao [Z 7–9]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design.loop import FeedbackLoop
from mrac_design.design.margins import StabilityMargins
from mrac_design.design.pole_placement import FollowModel, PolePlacement
from mrac_design.design.polynomial_design import (
    ExactPolynomialDesign,
    PolynomialDesign,
    place_poles,
    place_poles_exact,
)
from mrac_design.design.reference_model import ReferenceModel
from mrac_design.design.region import is_stable
from mrac_design.design.zeros import KeepZeros
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.diophantine import RESIDUAL_LIMIT, SylvesterSystem
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.time_domain import Continuous

if TYPE_CHECKING:
    import control


HIGHEST_DEGREE = 7
"""Largest degree of an observer: coefficients have names and units up to here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RSTSpecification:
    """Force plant, reference model, observer and internal model: all that determines R, S and T.

    Without internal model this is the controller of [Z 7-9]. A factor D of R opens the loop's gain
    where the heart moves: D = p is an integrator, D = p² + ν² a resonance in the heart's band
    (internal model principle, Francis & Wonham 1976; [AW §3.2]).

    Raises ParameterError when Ao or D is not monic, Ao is not stable or of a degree above
    HIGHEST_DEGREE, or deg Ao ≠ deg D + 1.
    """

    plant: ForcePlant
    """Process with b0 = Ks, as the designer believes it to be."""

    reference_model: ReferenceModel
    """Wanted response ω²/Am from uc to the force."""

    observer: tuple[float, ...]
    """Ao, highest power first, monic, all roots stable; (1, ao) for the paper's p + ao. Its degree
    is the least that makes S/R proper."""

    internal_model: tuple[float, ...] = (1.0,)
    """Factor D of R, highest power first, monic; (1,) is none."""

    def __post_init__(self) -> None:
        for name in ("observer", "internal_model"):
            values = tuple(float(value) for value in getattr(self, name))
            object.__setattr__(self, name, values)
            if not values or values[0] != 1.0 or not all(map(math.isfinite, values)):
                raise ParameterError(
                    name.replace("_", " "), values, "needs finite coefficients that begin with 1"
                )
        if len(self.observer) != len(self.internal_model) + 1:
            raise ParameterError(
                "observer",
                self.observer,
                f"must be of degree {len(self.internal_model)}, one more than the internal model",
            )
        if self.degree > HIGHEST_DEGREE:
            raise ParameterError(
                "observer", self.observer, f"must be of degree {HIGHEST_DEGREE} at most"
            )
        if not is_stable(self._exact(self.observer), Continuous()):
            raise ParameterError("observer", self.observer, "must have all roots left of 0")

    @property
    def degree(self) -> int:
        """Degree of Ao, S and T: one more than that of the internal model."""
        return len(self.observer) - 1

    @property
    def observer_pole(self) -> float:
        """ao of Ao = p + ao (rad/s). Raises ParameterError for an observer of higher degree."""
        if self.degree != 1:
            raise ParameterError(
                "observer", self.observer, "has no single pole: this needs the paper's p + ao"
            )
        return self.observer[1]

    @property
    def adapted_pole(self) -> float:
        """c of r1' = r1 − c (1/s): (p + c) D has the two highest coefficients of Ao, so R − Ao
        has none but r1' there; ao without internal model [AW 5.71]."""
        first = self.internal_model[1] if self.degree > 1 else 0.0
        return self.observer[1] - first

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Names of (r1', s0 … sn, t0 … tn), n the degree."""
        return gain_names(self.degree)

    @property
    def placement(self) -> PolePlacement:
        """The same problem among those for any process."""
        Am = self.reference_model.exact_polynomial
        return PolePlacement(
            process=self.plant.process,
            Am=Am,
            Ao=self._exact(self.observer),
            zeros=KeepZeros(),
            tracking=FollowModel(Bm=fmpq_poly([Am[0]])),
            fixed_R=self._exact(self.internal_model),
        )

    @staticmethod
    def _exact(polynomial: tuple[float, ...]) -> fmpq_poly:
        return fmpq_poly([decimal_rational(value) for value in reversed(polynomial)])


def gain_names(degree: int) -> tuple[str, ...]:
    """Names of the gains that adapt in a controller of that degree, r1' = r1 − c first."""
    numbers = range(degree + 1)
    return ("r1'", *(f"s{i}" for i in numbers), *(f"t{i}" for i in numbers))


def first_order_observer(pole: float) -> tuple[float, float]:
    """Ao = p + ao of the paper's controller, for `RSTSpecification.observer`."""
    return 1.0, pole


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RSTDesign:
    """Controller R u = T uc − S y with R = (p + r1) D, S = s0 pⁿ + … + sn, T = t0 pⁿ + … + tn."""

    specification: RSTSpecification
    """What was asked for."""

    solved: PolynomialDesign
    """The same controller as a solved pole placement."""

    @property
    def R(self) -> FloatArray:
        """(p + r1) D, highest power first, (n + 1,)."""
        return self.solved.R

    @property
    def S(self) -> FloatArray:
        """(s0, …, sn), highest power first; m/(s²·N) times 1, 1/s, …, (n + 1,)."""
        return self.solved.S

    @property
    def T(self) -> FloatArray:
        """(t0, …, tn), highest power first; units as S, (n + 1,)."""
        return self.solved.T

    @property
    def r1(self) -> float:
        """The controller's own pole with opposite sign, 1/s."""
        return float(self.R[1] - np.append(self.specification.internal_model, 0.0)[1])

    @property
    def coefficients(self) -> tuple[tuple[str, float, str], ...]:
        """(name, value, unit) of r1, s0 … sn, t0 … tn."""
        units = [f"m/(s{power}·N)" for power in "²³⁴⁵⁶⁷⁸⁹"[: len(self.S)]] * 2
        values = (*self.S.tolist(), *self.T.tolist())
        named = zip(self.specification.gain_names[1:], values, units, strict=True)
        return (("r1", self.r1, "1/s"), *named)

    @property
    def residual(self) -> float:
        """Largest coefficient of A R + b0 S − Ao Am relative to that of Ao Am, recomputed
        exactly from the float64 polynomials."""
        return self.solved.residual

    @property
    def parameters(self) -> FloatArray:
        """θ⁰ = (r1', s0 … sn, t0 … tn): the coefficients of R − P2, S and T [AW 5.71], with
        r1' = r1 − c, (2n + 3,)."""
        return readonly([self.r1 - self.specification.adapted_pole, *self.S, *self.T])

    @property
    def scaling(self) -> FloatArray:
        """Diagonal D of θ = D θ̂, (2n + 3,): what the coefficients are of the order of.

        Without internal model (ω, ω²/b0, ω³/b0, ω²/b0, ω³/b0), which is time ωt and control
        (b0/ω²) u; with one (ω, ω²/b0 · Ao, ω²/b0 · Ao), since its observer is slower than ω.
        """
        omega = self.specification.reference_model.bandwidth
        b0 = self.specification.plant.b0
        slow = self.specification.degree > 1
        powers = np.array(self.specification.observer if slow else (1.0, omega))
        return readonly([omega, *(omega**2 / b0 * powers), *(omega**2 / b0 * powers)])

    @property
    def scaled_parameters(self) -> FloatArray:
        """θ̂⁰ = D⁻¹ θ⁰, dimensionless, (2n + 3,)."""
        return readonly(self.parameters / self.scaling)

    @property
    def loop(self) -> FeedbackLoop:
        """The closed loop with the design plant."""
        return self.solved.loop

    @property
    def closed_loop_poles(self) -> NDArray[np.complex128]:
        """Roots of A R + b0 S, (n + 2,), rad/s."""
        return self.loop.poles

    def margins(self) -> StabilityMargins:
        """Gain, phase, delay and modulus margin with the parameters frozen."""
        return self.loop.margins()

    def loop_transfer(self) -> control.TransferFunction:
        """b0 S/(A R)."""
        return self.loop.loop_transfer()

    def disturbance_sensitivity(self) -> control.TransferFunction:
        """S_d = p(p + K2)(p + r1) D/(Ao Am), from d = −Ks Xh to the force."""
        return self.loop.disturbance_sensitivity()

    def complementary_sensitivity(self) -> control.TransferFunction:
        """b0 S/(Ao Am), from force-sensor noise to minus the force."""
        return self.loop.complementary_sensitivity()

    def control_sensitivity(self) -> control.TransferFunction:
        """A S/(Ao Am), from force-sensor noise to minus the command, m/(s²·N)."""
        return self.loop.control_sensitivity()

    def reference_transfer(self) -> control.TransferFunction:
        """b0 T/(A R + b0 S), from uc to the force; its common factor Ao is left in."""
        return self.loop.reference_transfer()

    def _repr_markdown_(self) -> str:
        rows = self.coefficients
        poles = ", ".join(f"{pole:.6g}" for pole in self.closed_loop_poles)
        body = "".join(f"| {name} | {value:.8g} | {unit} |\n" for name, value, unit in rows)
        return (
            f"| coefficient | value | unit |\n|---|---|---|\n{body}\n"
            f"Closed-loop poles {poles} rad/s; Diophantine residual {self.residual:.2g}."
        )

    def _repr_latex_(self) -> str:
        return self.solved._repr_latex_()


def diophantine_system(specification: RSTSpecification) -> SylvesterSystem:
    """Linear equations in the coefficients of R/D and S; 4 × 4 in (1, r1, s0, s1) without D."""
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
