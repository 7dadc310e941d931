"""One adaptive force axis as a linear system whose gains move inside a box.

With u = −θᵀ(P1φ) + reference terms, the force axis is linear in x = (penetration, its rate, xu, xy)
for any path of the gains θ(t) = (r1', s0, s1), and its matrix is affine in each gain and in the
stiffness. Scaled by the bandwidth ω and the design stiffness b0 (t̂ = ωt, ŷ = b0 ξ,
Ẑ = b0 ξ'/ω, x̂u = b0 xu/ω, x̂y = ω xy, û = b0 u/ω², κ = Ks/b0):

    ŷ' = Ẑ          Ẑ' = û − K̂2 Ẑ − d̂          x̂u' = −âo x̂u + û          x̂y' = −âo x̂y + κ ŷ
    û = −r̂ x̂u − ŝ0 (κ ŷ − âo x̂y) − ŝ1 x̂y          force = κ ŷ

ξ = X − Xh is the penetration, so the heart enters as one acceleration d = Ẍh + K2 Ẋh, with
d̂ = b0 d/ω² in newtons. Source: the error model of [AW 5.8] for the plant of [Z].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number, binary_rational, decimal_rational
from mrac_design.stability.rational_function import to_float

ExactArray = NDArray[np.object_]
"""NumPy array of `fmpq`, so that one formula serves floats and rationals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveLoop:
    """The numbers of one adaptive force axis that its stability depends on."""

    design_stiffness: fmpq
    """b0, the stiffness the controller was made for (N/m), > 0."""
    velocity_gain: fmpq
    """K2 (1/s), >= 0."""
    bandwidth: fmpq
    """ω of the reference model (rad/s), > 0; sets the scale of time."""
    observer_pole: fmpq
    """ao of the observer polynomial p + ao (1/s), > 0."""
    gains: tuple[fmpq, fmpq, fmpq]
    """Nominal (r1', s0, s1): 1/s, 1/(kg) … in SI units; r1' = r1 − ao."""

    def __post_init__(self) -> None:
        for name, value, strict in (
            ("design stiffness b0", self.design_stiffness, True),
            ("velocity gain K2", self.velocity_gain, False),
            ("bandwidth ω", self.bandwidth, True),
            ("observer pole ao", self.observer_pole, True),
        ):
            if value < 0 or (strict and value == 0):
                raise ParameterError(name, value, f"must be {'> 0' if strict else '>= 0'}")
        if len(self.gains) != 3:
            raise ParameterError("gains", len(self.gains), "needs the three r1', s0, s1")

    @property
    def gain_scale(self) -> tuple[fmpq, fmpq, fmpq]:
        """D of θ = D θ̂: (ω, ω²/b0, ω³/b0)."""
        omega, b0 = self.bandwidth, self.design_stiffness
        return omega, omega**2 / b0, omega**3 / b0

    @property
    def scaled_gains(self) -> tuple[fmpq, fmpq, fmpq]:
        """Nominal θ̂ = (r̂, ŝ0, ŝ1)."""
        r, s0, s1 = (g / d for g, d in zip(self.gains, self.gain_scale, strict=True))
        return r, s0, s1

    @property
    def scaled_velocity_gain(self) -> fmpq:
        """K̂2 = K2/ω."""
        return self.velocity_gain / self.bandwidth

    @property
    def scaled_observer_pole(self) -> fmpq:
        """âo = ao/ω."""
        return self.observer_pole / self.bandwidth

    @property
    def disturbance_scale(self) -> fmpq:
        """b0/ω²: newtons of d̂ for one m/s² of d."""
        return self.design_stiffness / self.bandwidth**2


def adaptive_loop(
    *,
    design_stiffness: Number,
    velocity_gain: Number,
    bandwidth: Number,
    observer_pole: Number,
    gains: Sequence[Number],
) -> AdaptiveLoop:
    """An AdaptiveLoop from any numbers; a float is the binary fraction it holds.

    Raises ParameterError outside the ranges of the fields.
    """
    r, s0, s1 = (exact(value, "gain") for value in _three(gains))
    return AdaptiveLoop(
        design_stiffness=exact(design_stiffness, "design stiffness b0"),
        velocity_gain=exact(velocity_gain, "velocity gain K2"),
        bandwidth=exact(bandwidth, "bandwidth ω"),
        observer_pole=exact(observer_pole, "observer pole ao"),
        gains=(r, s0, s1),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterBox:
    """The gains (scaled) and the stiffness ratio between bounds."""

    lower: tuple[fmpq, fmpq, fmpq]
    """Least scaled gains (r̂, ŝ0, ŝ1)."""
    upper: tuple[fmpq, fmpq, fmpq]
    """Greatest scaled gains."""
    stiffness_ratio: tuple[fmpq, fmpq]
    """Least and greatest κ = Ks/b0, > 0."""

    def __post_init__(self) -> None:
        if any(a > b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ParameterError("gain box", self.lower, "each lower bound must be <= the upper")
        low, high = self.stiffness_ratio
        if not 0 < low <= high:
            raise ParameterError("stiffness range", (low, high), "needs 0 < lowest <= highest")

    def corners(self) -> Iterator[tuple[fmpq, fmpq, fmpq, fmpq]]:
        """Every distinct corner (r̂, ŝ0, ŝ1, κ)."""
        ranges = [*zip(self.lower, self.upper, strict=True), self.stiffness_ratio]
        for corner in product(*(_distinct(pair) for pair in ranges)):
            r, s0, s1, ratio = corner
            yield r, s0, s1, ratio


def relative_box(
    loop: AdaptiveLoop, fraction: Number, stiffness_range: tuple[Number, Number]
) -> ParameterBox:
    """Every feedback gain within ±`fraction` of nominal, the stiffness in a range (N/m).

    Raises ParameterError for a negative fraction or an unordered range.
    """
    share = exact(fraction, "box fraction")
    if share < 0:
        raise ParameterError("box fraction", fraction, "must be >= 0")
    ends = [tuple(sorted((g * (1 - share), g * (1 + share)))) for g in loop.scaled_gains]
    low, high = (exact(value, "stiffness") / loop.design_stiffness for value in stiffness_range)
    return ParameterBox(
        lower=(ends[0][0], ends[1][0], ends[2][0]),
        upper=(ends[0][1], ends[1][1], ends[2][1]),
        stiffness_ratio=(low, high),
    )


def projection_bounds(loop: AdaptiveLoop, box: ParameterBox) -> tuple[FloatArray, FloatArray]:
    """Least and greatest (r1', s0, s1) in SI units, (3,) each, for a projection to the box.

    Rounded inward, so that every float between them is inside the proved box.
    """
    lower = [_rounded(v * d, 1) for v, d in zip(box.lower, loop.gain_scale, strict=True)]
    upper = [_rounded(v * d, -1) for v, d in zip(box.upper, loop.gain_scale, strict=True)]
    return readonly(lower), readonly(upper)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vertex:
    """The loop's matrices at one corner of the polytope, over the rationals."""

    A: ExactArray
    """State matrix, (n, n)."""
    disturbances: tuple[ExactArray, ...]
    """Columns (n, 1); their convex hull with both signs holds every effect of |d̂| <= 1."""
    energy_input: ExactArray
    """Input matrix (n, m) through which a disturbance of energy one acts."""
    force: tuple[ExactArray, ...]
    """Rows (1, n); the force at any instant is in their convex hull."""
    linearised_command: ExactArray
    """Row (1, n) of f* = û − K̂2 Ẑ."""
    label: str
    """The corner, for messages."""


def continuous_vertices(loop: AdaptiveLoop, box: ParameterBox) -> tuple[Vertex, ...]:
    """Matrices of the continuous loop at every corner of the box."""
    return tuple(_continuous_vertex(loop, corner) for corner in box.corners())


def _continuous_vertex(loop: AdaptiveLoop, corner: tuple[fmpq, fmpq, fmpq, fmpq]) -> Vertex:
    ratio = corner[3]
    K2, ao = loop.scaled_velocity_gain, loop.scaled_observer_pole
    u = feedback_row(ao, corner)
    A = exact_array(
        [
            [0, 1, 0, 0],
            [u[0], u[1] - K2, u[2], u[3]],
            [u[0], u[1], u[2] - ao, u[3]],
            [ratio, 0, 0, -ao],
        ]
    )
    column = exact_array([[0], [-1], [0], [0]])
    return Vertex(
        A=A,
        disturbances=(column,),
        energy_input=column,
        force=(exact_array([[ratio, 0, 0, 0]]),),
        linearised_command=exact_array([[u[0], u[1] - K2, u[2], u[3]]]),
        label=corner_label(corner),
    )


def feedback_row(
    observer_pole: fmpq, corner: tuple[fmpq, fmpq, fmpq, fmpq]
) -> tuple[fmpq, fmpq, fmpq, fmpq]:
    """û as a row on (ŷ, Ẑ, x̂u, x̂y) for gains and stiffness ratio of a corner."""
    r, s0, s1, ratio = corner
    return -s0 * ratio, fmpq(0), -r, s0 * observer_pole - s1


def exact_array(rows: Sequence[Sequence[fmpq | int]]) -> ExactArray:
    """Two-dimensional array of rationals."""
    array = np.empty((len(rows), len(rows[0])), dtype=object)
    for i, row in enumerate(rows):
        array[i] = [fmpq(value) for value in row]
    return array


def corner_label(corner: Sequence[fmpq]) -> str:
    """A corner's values with four digits."""
    names = ("r̂", "ŝ0", "ŝ1", "κ")
    return ", ".join(f"{n} = {to_float(v):.4g}" for n, v in zip(names, corner, strict=True))


def exact(value: Number, name: str) -> fmpq:
    """The rational number a value is; errors name the quantity."""
    try:
        return binary_rational(value) if isinstance(value, float) else decimal_rational(value)
    except ParameterError as error:
        raise ParameterError(name, value, error.requirement) from error


def _three(gains: Sequence[Number]) -> Sequence[Number]:
    if len(gains) != 3:
        raise ParameterError("gains", len(gains), "needs the three feedback gains r1', s0, s1")
    return gains


def _rounded(value: fmpq, direction: int) -> float:
    """The float next to a rational on its side of +∞ (1) or −∞ (−1), or the rational itself."""
    nearest = to_float(value)
    error = binary_rational(nearest) - value
    return float(np.nextafter(nearest, direction * np.inf)) if error * direction < 0 else nearest


def _distinct(pair: tuple[fmpq, fmpq]) -> tuple[fmpq, ...]:
    return pair if pair[0] != pair[1] else pair[:1]
