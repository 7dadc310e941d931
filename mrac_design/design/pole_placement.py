"""Pole placement for any scalar process: data, equation, controller [AW §3.2, §5.8].

The controller R u = T uc − S y makes the closed-loop polynomial A R + B S = Ao Am B⁺ and the
response y = (Bm/Am) uc. With B = B⁺ B⁻ and prescribed factors Rf of R and Sf of S that leaves

    A Rf X + B⁻ Sf Y = Ao Am,      R = B⁺ Rf X,   S = Sf Y,   T = Ao Bm',   Bm = B⁻ Bm'.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from flint import fmpq_poly

from mrac_design.design.region import is_stable
from mrac_design.design.zeros import ZeroSplit, ZeroTreatment
from mrac_design.errors import (
    DegreeConditionError,
    ModelFollowingError,
    NotCausalError,
    NotCoprimeError,
    ParameterError,
)
from mrac_design.plant import Process
from mrac_design.polynomials.diophantine import DiophantineEquation
from mrac_design.polynomials.rationals import roots


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitStaticGain:
    """T = β Ao: kept zeros stay in the response, whose static gain is one."""

    def shaping(self, Am: fmpq_poly, kept: fmpq_poly, static_point: int) -> fmpq_poly:
        """Bm' for the monic Am and the kept zeros B⁻.

        Raises ModelFollowingError when B⁻ has a zero that makes every static gain zero.
        """
        static_gain = kept(static_point)
        if static_gain == 0:
            raise ModelFollowingError([complex(static_point)])
        return fmpq_poly([Am(static_point) / static_gain])


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowModel:
    """y = (Bm/Am) uc exactly, for the Am of the placement."""

    Bm: fmpq_poly
    """Wanted numerator for a monic Am; it must contain the kept zeros."""

    def shaping(self, Am: fmpq_poly, kept: fmpq_poly, static_point: int) -> fmpq_poly:
        """Bm' = Bm/B⁻.

        Raises ModelFollowingError with the zeros Bm lacks, ParameterError when Bm is zero.
        """
        if self.Bm.is_zero():
            raise ParameterError("Bm", 0, "must not be zero")
        shaping, remainder = divmod(self.Bm, kept)
        if not remainder.is_zero():
            missing = kept // kept.gcd(self.Bm)
            raise ModelFollowingError([complex(zero) for zero in roots(missing)])
        return shaping


Tracking = UnitStaticGain | FollowModel


@dataclass(frozen=True, slots=True, kw_only=True)
class PolePlacement:
    """Everything that determines R, S and T; a value of this type has a solution.

    Raises ParameterError for an unstable Am or Ao or a zero factor, NotCoprimeError,
    CancellationError, NotCausalError, DegreeConditionError and ModelFollowingError.
    """

    process: Process
    """A and B."""

    Am: fmpq_poly
    """Poles of the response to the reference; made monic."""

    Ao: fmpq_poly
    """Observer polynomial: the poles the reference does not excite; made monic."""

    zeros: ZeroTreatment
    """Which zeros of the process are cancelled."""

    tracking: Tracking
    """What T is to achieve."""

    fixed_R: fmpq_poly = field(default_factory=lambda: fmpq_poly([1]))
    """Prescribed factor Rf of R, for instance an integrator; made monic."""

    fixed_S: fmpq_poly = field(default_factory=lambda: fmpq_poly([1]))
    """Prescribed factor Sf of S, for instance a notch; made monic."""

    pole_excess: int = 0
    """Least deg R − deg S and deg R − deg T: 0 is a proper controller, 1 in discrete time one
    that has a whole period to compute."""

    split: ZeroSplit = field(init=False)
    """B⁺ and B⁻ of the process with monic A."""

    shaping: fmpq_poly = field(init=False)
    """Bm' = Bm/B⁻."""

    equation: DiophantineEquation = field(init=False)
    """A Rf X + B⁻ Sf Y = Ao Am."""

    def __post_init__(self) -> None:
        if self.pole_excess < 0:
            raise ParameterError("controller pole excess", self.pole_excess, "must be ≥ 0")
        for name in ("Am", "Ao", "fixed_R", "fixed_S"):
            polynomial = getattr(self, name)
            if polynomial.is_zero():
                raise ParameterError(name, 0, "must not be the zero polynomial")
            object.__setattr__(self, name, polynomial / polynomial.leading_coefficient())
        for name in ("Am", "Ao"):
            _require_stable(name, getattr(self, name), self.process)
        leading = self.process.A.leading_coefficient()
        normal = Process(
            A=self.process.A / leading, B=self.process.B / leading, domain=self.process.domain
        )
        object.__setattr__(self, "process", normal)
        common = normal.A.gcd(normal.B)
        if common.degree() > 0:
            raise NotCoprimeError([complex(root) for root in roots(common)])
        object.__setattr__(self, "split", self.zeros.split(normal.B, normal.domain))
        shaping = self.tracking.shaping(self.Am, self.split.kept, normal.domain.static_point)
        object.__setattr__(self, "shaping", shaping)
        self._check_degrees()
        # A prescribed factor that meets a pole or zero of the process is refused here.
        equation = DiophantineEquation(
            A=normal.A * self.fixed_R, B=self.split.kept * self.fixed_S, C=self.Ao * self.Am
        )
        object.__setattr__(self, "equation", equation)

    def _check_degrees(self) -> None:
        excess = self.pole_excess
        if self.process.relative_degree + excess < 1:
            raise NotCausalError(
                "process and controller would both pass their input straight through",
                "an algebraic loop; ask for a controller with pole excess 1",
            )
        required = self.required_observer_degree
        if self.Ao.degree() < required:
            raise DegreeConditionError(
                "degree of the observer polynomial Ao",
                required=required,
                given=self.Ao.degree(),
            )
        model_excess = self.Am.degree() - self.shaping.degree() - self.split.kept.degree()
        if model_excess < self.process.relative_degree + excess:
            raise NotCausalError(
                f"the model has pole excess {model_excess}, process and controller together "
                f"{self.process.relative_degree + excess}",
                "T would need derivatives or future values of the reference; raise the degree "
                "of Am or lower that of Bm",
            )

    @property
    def required_observer_degree(self) -> int:
        """Least deg Ao with deg S ≤ deg R − pole excess, whatever the coefficients."""
        added = self.fixed_R.degree() + self.fixed_S.degree() + self.pole_excess
        cancelled = self.split.cancelled.degree()
        free = 2 * self.process.A.degree() - 1 + added - self.Am.degree() - cancelled
        return max(int(free), 0)

    @property
    def closed_loop(self) -> fmpq_poly:
        """The wanted A R + B S = Ao Am B⁺, monic."""
        return self.Ao * self.Am * self.split.cancelled

    def controller(self, X: fmpq_poly, Y: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly, fmpq_poly]:
        """R, S and T for a solution of the equation."""
        return self.split.cancelled * self.fixed_R * X, self.fixed_S * Y, self.Ao * self.shaping


def _require_stable(name: str, polynomial: fmpq_poly, process: Process) -> None:
    if not is_stable(polynomial, process.domain):
        listed = ", ".join(f"{root:.6g}" for root in np.asarray(roots(polynomial)))
        raise ParameterError(f"roots of {name}", listed, "must all be stable")
