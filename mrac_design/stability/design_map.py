"""Bandwidth × sampling × delay → the largest certified box: a guide for choosing all three."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number
from mrac_design.stability.adaptive_loop import AdaptiveLoop, exact
from mrac_design.stability.certification import largest_box
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.sampled_loop import Sampling


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignMap:
    """The largest certified relative box over loops and samplings."""

    bandwidths: FloatArray
    """ω of every loop (rad/s), (loops,)."""
    samplings: tuple[Sampling, ...]
    """Sampling period and delay of every column."""
    fractions: FloatArray
    """Largest proved box, (loops, samplings): gains within ± this share of nominal; NaN where
    not even the nominal gains are proved."""
    stiffness_range: tuple[float, float]
    """Stiffness (N/m) covered everywhere."""
    resolution: float
    """Width of the bisection's last step."""

    def _repr_markdown_(self) -> str:
        columns = [f"{1 / to_float(s.period):.4g} Hz, delay {s.delay}" for s in self.samplings]
        lines = [
            "| ω (rad/s) | " + " | ".join(columns) + " |",
            "|---" * (1 + len(columns)) + "|",
        ]
        for bandwidth, row in zip(self.bandwidths, self.fractions, strict=True):
            cells = ["–" if np.isnan(v) else f"±{100 * v:.0f} %" for v in row]
            lines.append(f"| {bandwidth:.4g} | " + " | ".join(cells) + " |")
        return "\n".join(lines)


def design_map(
    loops: Sequence[AdaptiveLoop],
    samplings: Sequence[Sampling],
    stiffness_range: tuple[Number, Number],
    *,
    resolution: Number,
    progress: Callable[[int, int], None] | None = None,
) -> DesignMap:
    """The largest certified box of every loop under every sampling.

    `progress(done, total)` is called after each. Raises ParameterError for empty sequences.
    Each entry costs a bisection of semidefinite programs, about 0.3 s for the smallest loops.
    """
    if not loops or not samplings:
        raise ParameterError(
            "design map", (len(loops), len(samplings)), "needs loops and samplings"
        )
    fractions = np.empty((len(loops), len(samplings)))
    for i, loop in enumerate(loops):
        for j, timing in enumerate(samplings):
            found = largest_box(loop, stiffness_range, timing, resolution=resolution)
            fractions[i, j] = to_float(found.fraction) if found.proved else np.nan
            if progress is not None:
                progress(i * len(samplings) + j + 1, fractions.size)
    low, high = (to_float(exact(value, "stiffness")) for value in stiffness_range)
    return DesignMap(
        bandwidths=readonly([to_float(loop.bandwidth) for loop in loops]),
        samplings=tuple(samplings),
        fractions=readonly(fractions),
        stiffness_range=(low, high),
        resolution=to_float(exact(resolution, "resolution")),
    )
