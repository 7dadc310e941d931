"""Integration methods as values: explicit Runge–Kutta."""

from __future__ import annotations

from mrac_design.simulation.tableau import ButcherTableau

Method = ButcherTableau
"""Any integration method."""


def spans_records(method: Method) -> bool:
    """Whether the method knows the solution inside its steps, so that they may be longer than
    the time between records."""
    return method.extension is not None
