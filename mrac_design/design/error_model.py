"""The error model of adaptive output feedback for any filters Q, P1, P2 [AW §5.8].

With all process zeros cancelled, A R + B S = Ao Am B⁺ gives Ao Am e = b0 (R u + S y − T uc) for
e = y − ym. Dividing by P = P1 P2 and splitting P2 off R,

    ef = (Q/P) e = G [ (1/P1) u + φᵀθ⁰ ],     G = b0 Q/(Ao Am),

    θ⁰ = coefficients of R − P2, S, T,     φ = p^k/P of u, of y and of −uc.

Which G is strictly positive real decides whether θ can be adapted by θ' = Γ φ ε.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from flint import fmpq, fmpq_poly

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design.polynomial_design import ExactPolynomialDesign
from mrac_design.design.region import is_stable
from mrac_design.errors import DegreeConditionError, NotCausalError, ParameterError
from mrac_design.polynomials.rationals import (
    coefficients,
    nearest_float,
    polynomial_latex,
    roots,
)
from mrac_design.time_domain import Continuous
from mrac_design.transfer import transfer_function

if TYPE_CHECKING:
    import control


class MeasuredSignal(Enum):
    """The signals a regressor is filtered from."""

    CONTROL = "u"
    OUTPUT = "y"
    COMMAND = "uc"


@dataclass(frozen=True, slots=True, kw_only=True)
class RegressorEntry:
    """One entry of φ: sign · p^power/P applied to a signal, and the parameter beside it."""

    parameter: str
    """Name of the entry of θ, for instance "s0"; r1', r2', … belong to R − P2."""

    signal: MeasuredSignal
    """What is filtered."""

    power: int
    """Power of p in the numerator of the filter."""

    sign: int
    """−1 for the command, +1 for the others."""

    ideal: fmpq
    """Entry of θ⁰, exact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModel:
    """ef = G [(1/P1) u + φᵀθ⁰] for one choice of Q, P1 and P2.

    Raises ParameterError when time is discrete, a process zero is kept or P1 or P2 is unstable;
    DegreeConditionError and NotCausalError when the degrees do not fit (see the fields).
    """

    design: ExactPolynomialDesign
    """The controller adaptation is to find, all process zeros cancelled, in continuous time."""

    Q: fmpq_poly
    """Numerator of the error filter. deg Ao Am − 1 ≤ deg Q ≤ deg Ao Am: below, the relative
    degree of G exceeds one and G is never SPR; above, G is not proper."""

    P1: fmpq_poly
    """Stable, monic, deg P1 ≥ deg Q − deg P2, so that ef needs no derivative of e. Of degree 0
    no augmentation is needed."""

    P2: fmpq_poly
    """Stable, monic, deg P2 = deg R, so that R − P2 has one coefficient less than R."""

    def __post_init__(self) -> None:
        placement = self.design.specification
        if placement.process.domain != Continuous():
            raise ParameterError("time domain", placement.process.domain, "must be continuous")
        if placement.split.kept.degree() > 0:
            zeros = ", ".join(f"{zero:.6g}" for zero in roots(placement.split.kept))
            raise ParameterError("kept process zeros", zeros, "must all be cancelled")
        for name in ("P1", "P2"):
            polynomial = getattr(self, name)
            if polynomial.is_zero() or not is_stable(polynomial, Continuous()):
                raise ParameterError(name, polynomial, "must be a stable polynomial")
            object.__setattr__(self, name, polynomial / polynomial.leading_coefficient())
        if self.Q.is_zero():
            raise ParameterError("Q", 0, "must not be zero")
        self._check_degrees()

    def _check_degrees(self) -> None:
        degree_R, degree_P2 = self.design.R.degree(), self.P2.degree()
        if degree_P2 != degree_R:
            raise ParameterError("degree of P2", degree_P2, f"must equal deg R = {degree_R}")
        closed_loop = self._closed_loop.degree()
        if self.Q.degree() < closed_loop - 1:
            raise DegreeConditionError(
                "degree of Q for G of relative degree one",
                required=closed_loop - 1,
                given=self.Q.degree(),
            )
        if self.Q.degree() > closed_loop:
            raise NotCausalError(
                f"G has deg Q = {self.Q.degree()} > deg Ao Am = {closed_loop}",
                "the error model would differentiate; lower the degree of Q",
            )
        if self.P1.degree() < self.Q.degree() - degree_P2:
            raise DegreeConditionError(
                "degree of P1 for a filtered error without derivatives",
                required=self.Q.degree() - degree_P2,
                given=self.P1.degree(),
            )

    @property
    def _closed_loop(self) -> fmpq_poly:
        return self.design.specification.Ao * self.design.specification.Am

    @property
    def P(self) -> fmpq_poly:
        """P1 P2."""
        return self.P1 * self.P2

    @property
    def b0(self) -> fmpq:
        """Leading coefficient of B for monic A."""
        return self.design.specification.split.kept[0]

    @property
    def transfer(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and monic denominator of G = b0 Q/(Ao Am), common factors cancelled.

        Cancelled factors divide the stable Ao Am, so nothing unstable is hidden.
        """
        numerator, denominator = self.b0 * self.Q, self._closed_loop
        common = numerator.gcd(denominator)
        return numerator // common, denominator // common

    @property
    def disturbance_transfer(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and denominator of Q A R/(P Ao Am B⁺), what an output disturbance adds to ef.

        The stability arguments for adaptive laws leave this term out.
        """
        placement = self.design.specification
        numerator = self.Q * placement.process.A * self.design.R
        denominator = self.P * placement.closed_loop
        common = numerator.gcd(denominator)
        return numerator // common, denominator // common

    def transfer_function(self) -> control.TransferFunction:
        """G for python-control."""
        numerator, denominator = self.transfer
        return transfer_function(coefficients(numerator), coefficients(denominator))

    @property
    def relative_degree(self) -> int:
        """Pole excess of G, 0 or 1."""
        return int(self._closed_loop.degree() - self.Q.degree())

    @property
    def needs_augmentation(self) -> bool:
        """Whether (1/P1) u differs from −φᵀθ while θ moves."""
        return bool(self.P1.degree() > 0)

    @property
    def regressor(self) -> tuple[RegressorEntry, ...]:
        """Entries of φ in the order of θ: u, then y, then uc, each highest power first."""
        R, S, T = self.design.R, self.design.S, self.design.T
        groups = (
            (MeasuredSignal.CONTROL, R - self.P2, R.degree() - 1, "r{}'", 1),
            (MeasuredSignal.OUTPUT, S, S.degree(), "s{}", 0),
            (MeasuredSignal.COMMAND, T, T.degree(), "t{}", 0),
        )
        return tuple(
            RegressorEntry(
                parameter=pattern.format(first + degree - power),
                signal=signal,
                power=power,
                sign=-1 if signal is MeasuredSignal.COMMAND else 1,
                ideal=polynomial[power],
            )
            for signal, polynomial, degree, pattern, first in groups
            for power in range(degree, -1, -1)
        )

    @property
    def ideal_parameters(self) -> FloatArray:
        """θ⁰, rounded, (number of entries of φ,)."""
        return readonly([nearest_float(entry.ideal) for entry in self.regressor])

    @property
    def remainders(self) -> tuple[fmpq_poly, fmpq_poly]:
        """What Ao Am e − b0 (R u + S y − T uc) leaves of u and of uc, recomputed from the
        polynomials; both identically zero."""
        placement = self.design.specification
        B = placement.process.B
        of_u = self._closed_loop * B - self.b0 * (
            placement.process.A * self.design.R + B * self.design.S
        )
        Bm = placement.shaping * placement.split.kept
        return of_u, placement.Ao * Bm - self.b0 * self.design.T

    def _repr_latex_(self) -> str:
        numerator, denominator = (polynomial_latex(part, "p") for part in self.transfer)
        filters = ",\\quad ".join(
            f"{name} = {polynomial_latex(part, 'p')}"
            for name, part in (("Q", self.Q), ("P_1", self.P1), ("P_2", self.P2))
        )
        return (
            "$e_f = G\\left[\\tfrac{1}{P_1}u + \\varphi^T\\theta^0\\right],\\quad "
            f"G = \\dfrac{{{numerator}}}{{{denominator}}},\\quad {filters}$"
        )


def unfiltered_error_model(design: ExactPolynomialDesign) -> ErrorModel:
    """Q = Ao Am, P1 = Am, P2 = Ao B⁺: G = b0 is constant [AW Example 5.14].

    Raises ParameterError when Ao B⁺ has not the degree of R (deg Am ≠ deg A).
    """
    placement = design.specification
    return ErrorModel(
        design=design,
        Q=placement.Ao * placement.Am,
        P1=placement.Am,
        P2=placement.Ao * placement.split.cancelled,
    )


def relative_degree_two_error_model(design: ExactPolynomialDesign, *, zero: fmpq) -> ErrorModel:
    """P1 = p + c, P2 = Ao B⁺, Q = P: the error itself drives the adaptation.

    For a second-order process without zeros G = b0 (p + c)/Am, SPR iff 0 < c < 2ξω. `zero` is
    c in rad/s. Raises as `ErrorModel`; DegreeConditionError when the relative degree exceeds 2.
    """
    placement = design.specification
    P1, P2 = fmpq_poly([zero, 1]), placement.Ao * placement.split.cancelled
    return ErrorModel(design=design, Q=P1 * P2, P1=P1, P2=P2)
