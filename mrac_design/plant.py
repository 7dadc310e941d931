"""What the controller sees: a process A y = B u, and the force plant left by linearisation."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import NotCausalError, ParameterError
from mrac_design.polynomials.rationals import (
    Number,
    coefficients,
    exact_polynomial,
    polynomial_latex,
)
from mrac_design.time_domain import Continuous, TimeDomain, time_domain_of
from mrac_design.transfer import transfer_function

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True, kw_only=True)
class Process:
    """A scalar process A y = B u over the rationals [AW 5.64].

    Raises ParameterError when A is constant or B zero, NotCausalError when deg B > deg A.
    """

    A: fmpq_poly
    """Denominator, degree at least 1."""

    B: fmpq_poly
    """Numerator, gain included, deg B ≤ deg A."""

    domain: TimeDomain
    """What the operator of A and B is."""

    def __post_init__(self) -> None:
        if self.A.degree() < 1:
            raise ParameterError("degree of A", self.A.degree(), "must be at least 1")
        if self.B.is_zero():
            raise ParameterError("B", 0, "a process without input cannot be controlled")
        if self.relative_degree < 0:
            raise NotCausalError(
                f"the process has deg B = {self.B.degree()} > deg A = {self.A.degree()}",
                "it needs the future of its input; coefficients go from the highest power down",
            )

    @staticmethod
    def of(
        *,
        A: fmpq_poly | Iterable[Number],
        B: fmpq_poly | Number | Iterable[Number],
        domain: TimeDomain,
    ) -> Process:
        """Process from coefficients, highest power first; floats are read as decimals."""
        return Process(A=exact_polynomial(A), B=exact_polynomial(B), domain=domain)

    @staticmethod
    def from_transfer_function(system: control.TransferFunction) -> Process:
        """Process of a scalar python-control transfer function with a stated time base."""
        numerator, denominator = _scalar_polynomials(system)
        return Process.of(A=denominator, B=numerator, domain=time_domain_of(system.dt))

    @property
    def relative_degree(self) -> int:
        """Pole excess deg A − deg B; in discrete time the delay in samples."""
        return int(self.A.degree() - self.B.degree())

    def transfer_function(self) -> control.TransferFunction:
        """B/A for python-control."""
        return transfer_function(coefficients(self.B), coefficients(self.A), dt=self.domain.dt)

    def _repr_latex_(self) -> str:
        variable = self.domain.variable
        A, B = (polynomial_latex(part, variable) for part in (self.A, self.B))
        return f"$y = \\dfrac{{{B}}}{{{A}}}\\,u$"


@dataclass(frozen=True, slots=True, kw_only=True)
class ForcePlant:
    """Contact force of one linearised axis, G(p) = Ks/(p(p + K2)).

    Exact linearisation leaves Ẍ = f* with f* = u − K2 Ẋ [Z 3, Z Fig. 3]; the contact spring
    turns position into force. ([Z] prints the plant without Ks.)

         u ──►(+)── f* ──► 1/p ── Ẋ ─┬─► 1/p ── X ──►(+)── Ks ──► y
               └──────── −K2 ────────┘        −Xh ────┘

    Raises ParameterError when Ks ≤ 0, K2 < 0 or either is not finite.
    """

    stiffness: float
    """Contact stiffness Ks, N/m, positive."""

    velocity_gain: float
    """Gain K2 of the inner velocity loop, 1/s, not negative."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.stiffness) and self.stiffness > 0.0):
            raise ParameterError("stiffness Ks", self.stiffness, "must be positive, in N/m")
        if not (math.isfinite(self.velocity_gain) and self.velocity_gain >= 0.0):
            raise ParameterError("velocity gain K2", self.velocity_gain, "must be ≥ 0, in 1/s")

    @staticmethod
    def from_transfer_function(system: control.TransferFunction) -> ForcePlant:
        """The force plant a python-control transfer function is.

        Raises ParameterError when it is not a continuous Ks/(p(p + K2)).
        """
        numerator, denominator = _scalar_polynomials(system)
        shape = "must be a continuous Ks/(p(p + K2))"
        if time_domain_of(system.dt) != Continuous() or len(numerator) != 1:
            raise ParameterError("transfer function", system, shape)
        if len(denominator) != 3 or denominator[2] != 0.0:
            raise ParameterError("transfer function", system, shape)
        leading = denominator[0]
        return ForcePlant(
            stiffness=float(numerator[0] / leading), velocity_gain=float(denominator[1] / leading)
        )

    @property
    def A(self) -> FloatArray:
        """Monic denominator p² + K2 p, highest power first, (3,)."""
        return readonly([1.0, self.velocity_gain, 0.0])

    @property
    def B(self) -> FloatArray:
        """Monic numerator 1, (1,)."""
        return readonly([1.0])

    @property
    def b0(self) -> float:
        """High-frequency gain Ks, N/m."""
        return self.stiffness

    @property
    def process(self) -> Process:
        """The plant over the rationals, its gain in B."""
        return Process.of(A=self.A, B=self.b0, domain=Continuous())

    def transfer_function(self) -> control.TransferFunction:
        """Ks/(p(p + K2)) for python-control, from the command u (m/s²) to the force (N)."""
        return transfer_function([self.b0], self.A)

    def _repr_latex_(self) -> str:
        return f"$G(p) = \\dfrac{{{self.b0:.6g}}}{{p\\,(p + {self.velocity_gain:.6g})}}$"


def _scalar_polynomials(system: control.TransferFunction) -> tuple[FloatArray, FloatArray]:
    if system.ninputs != 1 or system.noutputs != 1:
        raise ParameterError(
            "transfer function",
            f"{system.noutputs} outputs, {system.ninputs} inputs",
            "must have one of each",
        )
    numerator, denominator = system.num[0][0], system.den[0][0]
    return np.trim_zeros(numerator, "f"), np.trim_zeros(denominator, "f")
