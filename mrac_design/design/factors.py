"""Factors to prescribe in R (rejects a signal) or in S (does not react to it)."""

from __future__ import annotations

import math

from flint import fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import decimal_rational, exact_polynomial
from mrac_design.time_domain import Discrete, TimeDomain


def integrator(domain: TimeDomain) -> fmpq_poly:
    """p, or q − 1: in R it rejects constant disturbances."""
    return fmpq_poly([-domain.static_point, 1])


def resonator(frequency: float, domain: TimeDomain) -> fmpq_poly:
    """p² + ω², or q² − 2 cos(ωh) q + 1: in R it rejects a sine, in S it is a notch.

    `frequency` ω in rad/s, positive and in discrete time below π/h, else ParameterError.
    """
    nyquist = math.pi / domain.period if isinstance(domain, Discrete) else math.inf
    if not 0.0 < frequency < nyquist:
        raise ParameterError(
            "frequency", frequency, f"must be above 0 and below {nyquist:.6g} rad/s"
        )
    if isinstance(domain, Discrete):
        return exact_polynomial([1.0, -2.0 * math.cos(frequency * domain.period), 1.0])
    return fmpq_poly([decimal_rational(frequency) ** 2, 0, 1])
