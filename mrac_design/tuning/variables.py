"""What the tuner may choose: a number of the scenario, its range, and how it is searched."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.simulation.scenario import Scenario

_DIGITS = 3
"""Significant digits of a tuned value: more would feign a precision no robot has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A number of the scenario with the range it may be chosen from.

    Searched on a logarithmic scale, or on a linear one when the range begins at 0.
    """

    name: str
    """Key on the command line and in files."""
    symbol: str
    """Symbol for people."""
    unit: str
    """SI unit; empty for a pure number."""
    read: Callable[[Scenario], float]
    """The scenario's own value."""
    put: Callable[[Scenario, float], Scenario]
    """The scenario with another value."""
    low: float
    """Least value, >= 0."""
    high: float
    """Greatest value."""

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high < math.inf:
            raise ParameterError(
                f"range of {self.name}", f"{self.low:g}:{self.high:g}", "needs 0 <= low < high"
            )

    def value(self, position: float) -> float:
        """The value at a position in [0, 1], to three significant digits."""
        share = min(max(float(position), 0.0), 1.0)
        if self.low == 0:
            rounded = round(share * self.high, _DIGITS - math.floor(math.log10(self.high)))
        else:
            rounded = float(f"{self.low * (self.high / self.low) ** share:.{_DIGITS}g}")
        return min(max(rounded, self.low), self.high)

    def position(self, value: float) -> float:
        """Where a value stands in its range, 0 to 1; values outside go to the nearer end."""
        inside = min(max(value, self.low), self.high)
        if self.low == 0:
            return inside / self.high
        return math.log(inside / self.low) / math.log(self.high / self.low)


def _variable(section: str, key: str, *, low: float, high: float, **names: str) -> Variable:
    """A number that stands under `key` in a section of the scenario."""

    def put(scenario: Scenario, value: float) -> Scenario:
        changed = replace(getattr(scenario, section), **{key: value})
        return replace(scenario, **{section: changed})

    def read(scenario: Scenario) -> float:
        return float(getattr(getattr(scenario, section), key))

    return Variable(read=read, put=put, low=low, high=high, **names)


VARIABLES: Mapping[str, Variable] = {
    variable.name: variable
    for variable in (
        _variable("design", "velocity_gain", low=0.0, high=200.0,
                  name="k2", symbol="K2", unit="1/s"),
        _variable("adaptation", "gain", low=0.01, high=100.0,
                  name="gain", symbol="γ̂", unit=""),
        Variable(
            read=lambda scenario: scenario.design.observer_pole,
            put=lambda scenario, value: replace(
                scenario, design=scenario.design.with_observer_pole(value)
            ),
            low=250.0, high=2000.0, name="ao", symbol="ao", unit="rad/s",
        ),
        _variable("adaptation", "normalisation", low=1e-3, high=10.0,
                  name="alpha", symbol="α", unit="N²"),
    )
}  # fmt: skip
"""What can be tuned, by name, with the range taken when none is given."""


def read_variables(text: str) -> tuple[Variable, ...]:
    """Variables from "k2,gain,ao=250:4000": names, each with a range of its own if wanted.

    Raises ParameterError for an unknown or repeated name, or a range that is none.
    """
    chosen: list[Variable] = []
    for entry in text.split(","):
        name, equals, span = (part.strip() for part in entry.partition("="))
        if name not in VARIABLES:
            known = ", ".join(VARIABLES)
            raise ParameterError("free variables", text, f"{name!r} is none of {known}")
        if any(variable.name == name for variable in chosen):
            raise ParameterError("free variables", text, f"{name} is named twice")
        variable = VARIABLES[name]
        if equals:
            low, _, high = span.partition(":")
            try:
                variable = replace(variable, low=float(low), high=float(high))
            except ValueError:
                problem = f"the range of {name} must be written low:high"
                raise ParameterError("free variables", text, problem) from None
        chosen.append(variable)
    return tuple(chosen)


def placed(scenario: Scenario, variables: Sequence[Variable], values: Sequence[float]) -> Scenario:
    """The scenario with the variables at `values`."""
    for variable, value in zip(variables, values, strict=True):
        scenario = variable.put(scenario, float(value))
    return scenario


def values_at(variables: Sequence[Variable], position: FloatArray) -> tuple[float, ...]:
    """Values at a position in the unit cube."""
    return tuple(v.value(p) for v, p in zip(variables, position, strict=True))


def position_of(variables: Sequence[Variable], values: Sequence[float]) -> FloatArray:
    """Position of `values` in the unit cube, shape (variables,)."""
    return readonly(
        np.array([v.position(value) for v, value in zip(variables, values, strict=True)])
    )
