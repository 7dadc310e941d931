"""Cases drawn at random around a nominal run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.lanes import Case


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UniformSpread:
    """Parameters scaled by random factors, one a block, and a motion picked at random.

    A sampler for `Ensemble`: `spread(run, generator)` is the case of one run.
    """

    layout: Layout
    """Names of the parameters' blocks."""
    parameters: FloatArray
    """Nominal parameters, shape (layout.size,)."""
    factors: Mapping[str, tuple[float, float]]
    """Smallest and largest factor of every block that varies, 0 < low <= high."""
    initial_state: FloatArray
    """State at time 0, shape (states,); the same for all."""
    inputs: tuple[PiecewisePolynomial, ...]
    """Inputs to pick from, all over the whole run; runs share vectors where breakpoints agree."""
    held: FloatArray | None = None
    """Memory before the first update; None is zero."""
    _slices: tuple[tuple[slice, float, float], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", readonly(self.parameters, (self.layout.size,)))
        object.__setattr__(self, "initial_state", readonly(self.initial_state, (-1,)))
        object.__setattr__(self, "factors", dict(self.factors))
        if not self.inputs:
            raise ParameterError("inputs", (), "needs at least one motion")
        known = self.layout.slices
        for name, (low, high) in self.factors.items():
            if name not in known:
                raise ParameterError("factors", name, f"must be one of {', '.join(known)}")
            if not 0 < low <= high < float("inf"):
                raise ParameterError(f"factors of {name}", (low, high), "needs 0 < low <= high")
        ordered = sorted(self.factors.items())
        slices = tuple((known[name], low, high) for name, (low, high) in ordered)
        object.__setattr__(self, "_slices", slices)

    def __call__(self, run: int, generator: np.random.Generator) -> Case:
        """The case of a run; its number does not matter, only its generator does."""
        parameters = np.array(self.parameters)
        for place, low, high in self._slices:
            parameters[place] *= generator.uniform(low, high)
        chosen = int(generator.integers(len(self.inputs)))
        return Case(
            parameters=parameters,
            initial_state=self.initial_state,
            inputs=self.inputs[chosen],
            held=self.held,
        )
