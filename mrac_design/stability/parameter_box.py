"""The box in which gains and stiffness may move, and move at will."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from flint import fmpq

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number, binary_rational
from mrac_design.stability.adaptive_loop import AdaptiveLoop, exact
from mrac_design.stability.rational_function import to_float


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterBox:
    """The gains (scaled) and the stiffness ratio between bounds."""

    lower: tuple[fmpq, ...]
    """Least scaled gains (r̂, ŝ0, …, ŝn)."""
    upper: tuple[fmpq, ...]
    """Greatest scaled gains."""
    stiffness_ratio: tuple[fmpq, fmpq]
    """Least and greatest κ = Ks/b0, > 0."""

    def __post_init__(self) -> None:
        if any(a > b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ParameterError("gain box", self.lower, "each lower bound must be <= the upper")
        low, high = self.stiffness_ratio
        if not 0 < low <= high:
            raise ParameterError("stiffness range", (low, high), "needs 0 < lowest <= highest")

    def corners(self) -> Iterator[tuple[fmpq, ...]]:
        """Every distinct corner (r̂, ŝ0, …, ŝn, κ)."""
        ranges = [*zip(self.lower, self.upper, strict=True), self.stiffness_ratio]
        return product(*(dict.fromkeys(pair) for pair in ranges))


def relative_box(
    loop: AdaptiveLoop,
    fraction: Number | tuple[Number, ...],
    stiffness_range: tuple[Number, Number],
) -> ParameterBox:
    """Every feedback gain within ± a fraction of nominal, the stiffness in a range (N/m).

    One `fraction` for all gains, or one for each of (r1', s0, …, sn). Raises ParameterError for a
    negative or missing fraction or an unordered range.
    """
    nominal = loop.scaled_gains
    given = fraction if isinstance(fraction, tuple) else (fraction,) * len(nominal)
    if len(given) != len(nominal):
        raise ParameterError("box fraction", given, f"needs one for each of {len(nominal)} gains")
    shares = [exact(value, "box fraction") for value in given]
    if any(share < 0 for share in shares):
        raise ParameterError("box fraction", fraction, "must be >= 0")
    ends = [
        sorted((g * (1 - share), g * (1 + share))) for g, share in zip(nominal, shares, strict=True)
    ]
    low, high = (exact(value, "stiffness") / loop.design_stiffness for value in stiffness_range)
    return ParameterBox(
        lower=tuple(low for low, _ in ends),
        upper=tuple(high for _, high in ends),
        stiffness_ratio=(low, high),
    )


def projection_bounds(loop: AdaptiveLoop, box: ParameterBox) -> tuple[FloatArray, FloatArray]:
    """Least and greatest (r1', s0, …, sn) in SI units, (n + 2,) each, for a projection to the box.

    Rounded inward, so that every float between them is inside the proved box.
    """
    lower = [_rounded(v * d, 1) for v, d in zip(box.lower, loop.gain_scale, strict=True)]
    upper = [_rounded(v * d, -1) for v, d in zip(box.upper, loop.gain_scale, strict=True)]
    return readonly(lower), readonly(upper)


def corner_label(loop: AdaptiveLoop, corner: Sequence[fmpq]) -> str:
    """A corner's values with four digits."""
    names = (*loop.gain_names, "κ")
    return ", ".join(f"{n} = {to_float(v):.4g}" for n, v in zip(names, corner, strict=True))


def _rounded(value: fmpq, direction: int) -> float:
    """The float next to a rational on its side of +∞ (1) or −∞ (−1), or the rational itself."""
    nearest = to_float(value)
    error = binary_rational(nearest) - value
    return float(np.nextafter(nearest, direction * np.inf)) if error * direction < 0 else nearest
