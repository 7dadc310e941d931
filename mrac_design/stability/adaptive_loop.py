"""One adaptive force axis as a linear system whose gains move inside a box.

The controller R u = T uc − S y with R = (p + r1) D runs on the signals filtered by 1/Ao,

    x_u,i = pⁱ u/Ao,      x_y,i = pⁱ y/Ao,      i = n − 1 … 0,

    u = −K x_u − r1' D x_u − s0 (y − α1 x_y,n−1 − … − αn x_y,0) − s1 x_y,n−1 − … − sn x_y,0

where D is a given factor of R of degree n − 1 (the internal model; 1 for n = 1), r1' = r1 − c with
c = α1 − d1, and K = (p + c) D − Ao, of degree n − 2. For any path of the gains (r1', s0, …, sn)
the force axis is then linear in x = (penetration, its rate, x_u, x_y), and its matrix is affine in
each gain and in the stiffness. For n = 1 these are the equations of [AW 5.8] for the plant of [Z].

All is scaled by the bandwidth ω and the design stiffness b0: t̂ = ωt, ŷ = b0 ξ, Ẑ = b0 ξ'/ω,
û = b0 u/ω², x̂_u,i = b0 ω^{n−i−2} x_u,i, x̂_y,i = ω^{n−i} x_y,i and κ = Ks/b0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import Number, binary_rational, decimal_rational

ExactArray = NDArray[np.object_]
"""NumPy array of `fmpq`, so that one formula serves floats and rationals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterStep:
    """How a processor advances the filters 1/Ao over one period: x⁺ = F x + G v.

    These are the numbers it computes with, so they *are* the filter, whatever they were rounded
    from; x holds the highest power first.
    """

    period: fmpq
    """Sampling period h (s) it was made for, > 0."""
    transition: tuple[tuple[fmpq, ...], ...]
    """F, n rows of n."""
    input: tuple[fmpq, ...]
    """G, n entries (s, s², …)."""

    def __post_init__(self) -> None:
        n = len(self.input)
        if len(self.transition) != n or any(len(row) != n for row in self.transition):
            raise ParameterError("filter step", self.transition, f"needs F of {n} × {n} as its G")


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveLoop:
    """The numbers of one adaptive force axis that its stability depends on."""

    design_stiffness: fmpq
    """b0, the stiffness the controller was made for (N/m), > 0."""
    velocity_gain: fmpq
    """K2 (1/s), >= 0."""
    bandwidth: fmpq
    """ω of the reference model (rad/s), > 0; sets the scale of time."""
    observer: tuple[fmpq, ...]
    """Ao = pⁿ + α1 pⁿ⁻¹ + … + αn, highest power first, monic, n >= 1."""
    internal_model: tuple[fmpq, ...]
    """D of degree n − 1, highest power first, monic; (1,) is none."""
    gains: tuple[fmpq, ...]
    """Nominal (r1', s0, …, sn) in SI units; r1' = r1 − c."""
    gain_scale: tuple[fmpq, ...]
    """D of θ = D θ̂, one a gain, > 0: the units in which a box is stated."""
    filter_steps: tuple[FilterStep, ...]
    """The filters as a processor runs them, for each period it may run at; none when the law
    runs in continuous time."""

    def __post_init__(self) -> None:
        for name, value, strict in (
            ("design stiffness b0", self.design_stiffness, True),
            ("velocity gain K2", self.velocity_gain, False),
            ("bandwidth ω", self.bandwidth, True),
            *(("gain scale", scale, True) for scale in self.gain_scale),
        ):
            if value < 0 or (strict and value == 0):
                raise ParameterError(name, value, f"must be {'> 0' if strict else '>= 0'}")
        for name, polynomial in (("observer", self.observer), ("D", self.internal_model)):
            if not polynomial or polynomial[0] != 1:
                raise ParameterError(name, polynomial, "needs coefficients that begin with 1")
        n = self.degree
        for name, given, wanted, what in (
            ("observer", n, len(self.internal_model), "must be of one degree more than D"),
            ("gains", len(self.gains), n + 2, f"needs the {n + 2} gains r1', s0, …, s{n}"),
            ("gain scale", len(self.gain_scale), n + 2, f"needs one for each of {n + 2} gains"),
            *(
                ("filter step", len(step.input), n, f"needs the {n} states of 1/Ao")
                for step in self.filter_steps
            ),
        ):
            if given != wanted:
                raise ParameterError(name, given, what)

    @property
    def degree(self) -> int:
        """n, the degree of Ao and the number of states of each filter."""
        return len(self.observer) - 1

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Names of the scaled gains, r̂, ŝ0, …, ŝn."""
        return ("r̂", *(f"ŝ{i}" for i in range(self.degree + 1)))

    @property
    def scaled_gains(self) -> tuple[fmpq, ...]:
        """Nominal θ̂ = D⁻¹ (r1', s0, …, sn)."""
        return tuple(g / d for g, d in zip(self.gains, self.gain_scale, strict=True))

    @property
    def gain_units(self) -> tuple[fmpq, ...]:
        """What θ̂ is multiplied by in scaled time and force: D over (ω, ω²/b0, ω³/b0, …)."""
        omega, b0 = self.bandwidth, self.design_stiffness
        natural = (omega, *(omega ** (2 + i) / b0 for i in range(self.degree + 1)))
        return tuple(d / unit for d, unit in zip(self.gain_scale, natural, strict=True))

    @property
    def scaled_velocity_gain(self) -> fmpq:
        """K̂2 = K2/ω."""
        return self.velocity_gain / self.bandwidth

    @property
    def scaled_observer(self) -> tuple[fmpq, ...]:
        """(α1/ω, …, αn/ωⁿ)."""
        return self._in_scaled_time(self.observer)[1:]

    @property
    def scaled_internal_model(self) -> tuple[fmpq, ...]:
        """(1, d1/ω, …), n entries."""
        return self._in_scaled_time(self.internal_model)

    @property
    def scaled_known_part(self) -> tuple[fmpq, ...]:
        """K = (p + c) D − Ao in powers of p/ω, from the (n − 1)st down, n entries."""
        D, Ao = (*self.scaled_internal_model, fmpq(0)), (fmpq(1), *self.scaled_observer)
        c = Ao[1] - D[1]
        return tuple(D[k] + c * D[k - 1] - Ao[k] for k in range(1, self.degree + 1))

    @property
    def disturbance_scale(self) -> fmpq:
        """b0/ω²: newtons of d̂ for one m/s² of d."""
        return self.design_stiffness / self.bandwidth**2

    def filter_step(self, period: fmpq) -> FilterStep:
        """The filters' step over a period. Raises ParameterError when the loop has none for it."""
        for step in self.filter_steps:
            if step.period == period:
                return step
        raise ParameterError("sampling period", period, "the loop has no filter step for it")

    def _in_scaled_time(self, polynomial: tuple[fmpq, ...]) -> tuple[fmpq, ...]:
        return tuple(value / self.bandwidth**k for k, value in enumerate(polynomial))


def adaptive_loop(
    *,
    design_stiffness: Number,
    velocity_gain: Number,
    bandwidth: Number,
    observer: Sequence[Number],
    internal_model: Sequence[Number],
    gains: Sequence[Number],
    gain_scale: Sequence[Number],
    filter_steps: Sequence[FilterStep] = (),
) -> AdaptiveLoop:
    """An AdaptiveLoop from any numbers; a float is the binary fraction it holds.

    Raises ParameterError outside the ranges of the fields.
    """
    return AdaptiveLoop(
        design_stiffness=exact(design_stiffness, "design stiffness b0"),
        velocity_gain=exact(velocity_gain, "velocity gain K2"),
        bandwidth=exact(bandwidth, "bandwidth ω"),
        observer=_all_exact(observer, "observer"),
        internal_model=_all_exact(internal_model, "internal model"),
        gains=_all_exact(gains, "gain"),
        gain_scale=_all_exact(gain_scale, "gain scale"),
        filter_steps=tuple(filter_steps),
    )


def filter_step(
    period: Number, transition: FloatArray | ExactArray, input_column: FloatArray | ExactArray
) -> FilterStep:
    """A FilterStep from the numbers F (n, n) and G (n,) that a controller computes with.

    Raises ParameterError for shapes that do not fit.
    """
    return FilterStep(
        period=exact(period, "sampling period"),
        transition=tuple(_all_exact(row, "filter step") for row in transition.tolist()),
        input=_all_exact(input_column.tolist(), "filter step"),
    )


def exact_array(rows: Sequence[Sequence[fmpq | int]]) -> ExactArray:
    """Two-dimensional array of rationals."""
    array = np.empty((len(rows), len(rows[0])), dtype=object)
    for i, row in enumerate(rows):
        array[i] = [fmpq(value) for value in row]
    return array


def exact(value: Number, name: str) -> fmpq:
    """The rational number a value is; errors name the quantity."""
    try:
        return binary_rational(value) if isinstance(value, float) else decimal_rational(value)
    except ParameterError as error:
        raise ParameterError(name, value, error.requirement) from error


def _all_exact(values: Sequence[Number], name: str) -> tuple[fmpq, ...]:
    return tuple(exact(value, name) for value in values)
