"""The time domain as a type: a polynomial in p means nothing until one knows what p is."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from mrac_design.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class Continuous:
    """Polynomials in the differential operator p; stable means Re < 0."""

    @property
    def variable(self) -> str:
        """Letter of the operator."""
        return "p"

    @property
    def static_point(self) -> int:
        """Value of the operator at which a transfer function equals its static gain."""
        return 0

    @property
    def dt(self) -> float:
        """Sampling period as python-control counts it (0 for continuous time)."""
        return 0.0

    def equivalent_pole(self, root: complex) -> complex:
        """Pole of the continuous mode exp(s t) that `root` stands for, rad/s."""
        return complex(root)

    def is_stable(self, root: complex) -> bool:
        """Whether a mode at `root` dies out."""
        return complex(root).real < 0.0


@dataclass(frozen=True, slots=True)
class Discrete:
    """Polynomials in the forward shift operator q; stable means |q| < 1."""

    period: float
    """Sampling period h, s, positive."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period) and self.period > 0.0):
            raise ParameterError("sampling period", self.period, "must be a positive time in s")

    @property
    def variable(self) -> str:
        """Letter of the operator."""
        return "q"

    @property
    def static_point(self) -> int:
        """Value of the operator at which a transfer function equals its static gain."""
        return 1

    @property
    def dt(self) -> float:
        """Sampling period as python-control counts it."""
        return self.period

    def equivalent_pole(self, root: complex) -> complex:
        """Pole s of the continuous mode with exp(s h) = `root`, rad/s; −inf for a root at 0."""
        if root == 0:
            return complex(-math.inf, 0.0)
        return cmath.log(complex(root)) / self.period

    def is_stable(self, root: complex) -> bool:
        """Whether a mode at `root` dies out."""
        return abs(root) < 1.0


TimeDomain = Continuous | Discrete


def time_domain_of(dt: float | bool | None) -> TimeDomain:
    """Time domain of a python-control system with time base `dt`.

    Raises ParameterError for the time bases that name no period (`None`, `True`): a
    design needs to know it.
    """
    if dt is None or dt is True:
        raise ParameterError("dt", dt, "a design needs dt = 0 (continuous) or a period in s")
    return Continuous() if dt == 0 else Discrete(float(dt))
