"""Whether a polynomial is stable in the time domain it belongs to."""

from __future__ import annotations

from flint import fmpq_poly

from mrac_design.polynomials.stable import is_hurwitz, is_schur
from mrac_design.time_domain import Discrete, TimeDomain


def is_stable(polynomial: fmpq_poly, domain: TimeDomain) -> bool:
    """Whether every root lies strictly inside the stability region, decided exactly.

    Raises ParameterError for the zero polynomial.
    """
    return is_schur(polynomial) if isinstance(domain, Discrete) else is_hurwitz(polynomial)
