"""The RST controller with integrator: what fixed gains can do against a constant disturbance.

R = p(p + r1) makes the disturbance sensitivity one order steeper at low frequency than the
controller of degree one, for an observer polynomial of degree two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.design.factors import integrator
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
from mrac_design.polynomials.diophantine import RESIDUAL_LIMIT
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.time_domain import Continuous


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegralRSTSpecification:
    """Force plant, reference model and Ao = p² + 2ξo ωo p + ωo².

    Raises ParameterError when ωo or ξo is not positive and finite.
    """

    plant: ForcePlant
    """Process with b0 = Ks, as the designer believes it to be."""

    reference_model: ReferenceModel
    """Wanted response ω²/Am from uc to the force."""

    observer_bandwidth: float
    """ωo, rad/s, positive."""

    observer_damping: float
    """ξo, dimensionless, positive."""

    def __post_init__(self) -> None:
        for name, value in (
            ("observer bandwidth ωo", self.observer_bandwidth),
            ("observer damping ξo", self.observer_damping),
        ):
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(name, value, "must be positive")

    @property
    def placement(self) -> PolePlacement:
        """The same problem among those for any process, with p prescribed in R."""
        Am = self.reference_model.exact_polynomial
        omega = decimal_rational(self.observer_bandwidth)
        xi = decimal_rational(self.observer_damping)
        return PolePlacement(
            process=self.plant.process,
            Am=Am,
            Ao=fmpq_poly([omega**2, 2 * xi * omega, 1]),
            zeros=KeepZeros(),
            tracking=FollowModel(Bm=fmpq_poly([Am[0]])),
            fixed_R=integrator(Continuous()),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IntegralRSTDesign(PlacedController):
    """R u = T uc − S y with R = p(p + r1), S = s0 p² + s1 p + s2, T = (ω²/b0) Ao."""

    specification: IntegralRSTSpecification
    """What was asked for."""


def design_integral_rst(
    specification: IntegralRSTSpecification, *, residual_limit: float = RESIDUAL_LIMIT
) -> IntegralRSTDesign:
    """RST controller with integrator in float64.

    Raises IllConditionedError when the residual exceeds `residual_limit`.
    """
    solved = place_poles(specification.placement, residual_limit=residual_limit)
    return IntegralRSTDesign(specification=specification, solved=solved)


def design_integral_rst_exact(specification: IntegralRSTSpecification) -> ExactPolynomialDesign:
    """The same controller over the rationals."""
    return place_poles_exact(specification.placement)
