"""Integration methods as values: explicit Runge–Kutta, and Taylor series."""

from __future__ import annotations

from dataclasses import dataclass

from mrac_design.errors import ParameterError
from mrac_design.simulation.tableau import ButcherTableau


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorControl:
    """How large the last term of the series may be, entry by entry of the state."""

    relative: float
    """Allowed share of the entry's magnitude, > 0."""
    absolute: float
    """Allowed size besides, in the entry's own SI unit, > 0."""

    def __post_init__(self) -> None:
        for name in ("relative", "absolute"):
            if not 0 < getattr(self, name) < 1:
                raise ParameterError(f"{name} tolerance", getattr(self, name), "must be in (0, 1)")


@dataclass(frozen=True, slots=True, kw_only=True)
class TaylorSeries:
    """Steps along the solution's own Taylor series, made by automatic differentiation.

    At a minimum, a maximum or another switch a step follows the branch it begins on.
    """

    order: int
    """Highest power of time kept, 2 to 20; the order of the method."""
    control: ErrorControl | None = None
    """Shortens steps where the last term is too large; None keeps steps as given."""

    def __post_init__(self) -> None:
        if not 2 <= self.order <= 20:
            raise ParameterError("order of the Taylor series", self.order, "must be 2 to 20")

    @property
    def name(self) -> str:
        """Name shown to people."""
        return f"Taylor series of order {self.order}"


Method = ButcherTableau | TaylorSeries
"""Any integration method."""


def spans_records(method: Method) -> bool:
    """Whether the method knows the solution inside its steps, so that they may be longer than
    the time between records."""
    return isinstance(method, ButcherTableau) and method.extension is not None
