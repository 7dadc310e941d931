"""Advice on the adaptation gain γ̂: how fast may it be, where must the gains stay, what if not.

Each bound comes from the loop linearised about a constant force, where adaptation is one mode of
speed λ = γ̂ω|φ̂₀|²: the dead time it leaves room for, the integration step it can be computed with,
the sensor noise it lets through, and, for a sampled controller, the poles of the code as it runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.assessment.adaptation_loop import (
    AdaptationLoop,
    adaptation_speed,
    gain_for_speed,
    noise_drift,
)
from mrac_design.assessment.linearisation import linearise_axis
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.reference import DirectReference
from mrac_design.controller.robust import GainBox, WithProjection
from mrac_design.design import RSTDesign
from mrac_design.errors import ParameterError
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import build_sampled_axis_loop
from mrac_design.stability import ParameterBox, Sampling
from mrac_design.stability.rational_function import to_float
from mrac_design.time_domain import Continuous, Discrete

RK4_REAL_LIMIT = 2.785
"""Largest λΔt at which the classical Runge-Kutta method damps exp(−λt)."""

SPEEDS = np.geomspace(1.0, 1e6, 61)
"""λ (1/s) scanned for the first one that breaks a requirement."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirements:
    """What the gain has to respect."""

    largest_force: float
    """Greatest force pressed with (N); adaptation is fastest there."""
    dead_time: float
    """Dead time to be tolerated (s): computation, hold, sensor and actuator together."""
    integration_step: float
    """Step Δt (s) with which the continuous law is integrated."""
    noise_rms: float
    """Noise of the force sensor (N rms)."""
    noise_period: float
    """Time between independent noise samples (s)."""
    noise_growth: float
    """Accepted force noise over that of the frozen controller, >= 1."""

    def __post_init__(self) -> None:
        for name in ("largest_force", "integration_step", "noise_period"):
            if not 0 < getattr(self, name) < math.inf:
                raise ParameterError(name, getattr(self, name), "must be a finite number > 0")
        for name, least in (("dead_time", 0.0), ("noise_rms", 0.0), ("noise_growth", 1.0)):
            if not least <= getattr(self, name) < math.inf:
                raise ParameterError(name, getattr(self, name), f"must be finite and >= {least:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class GainBound:
    """An upper bound of γ̂ and where it comes from."""

    source: str
    """What limits the gain."""
    limit: float
    """Largest γ̂; inf when this does not limit it, 0 when not even the frozen loop meets it."""
    evidence: str
    """A plain sentence with the numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainAdvice:
    """Bounds on γ̂, the box to project to, and what noise does in the long run."""

    law: str
    """The adaptation law advised on."""
    chosen: float
    """γ̂ of the scenario."""
    speed: float
    """λ (1/s) of that γ̂ at the largest force."""
    bounds: tuple[GainBound, ...]
    """Every bound."""
    drift: FloatArray
    """Rates (1/s) at which noise alone moves (r1', s0 … sn) at zero force with the chosen γ̂."""
    time_to_border: float
    """Time (s) until that drift takes a gain out of the certified box; inf without a drift,
    nan without a box."""
    box: GainBox | None
    """Box to project the gains to, None without a certificate."""

    @property
    def largest_gain(self) -> float:
        """The least of all bounds."""
        return min(bound.limit for bound in self.bounds)

    @property
    def binding(self) -> GainBound:
        """The bound that decides."""
        return min(self.bounds, key=lambda bound: bound.limit)

    def _repr_markdown_(self) -> str:
        lines = ["| bound from | largest $\\hat\\gamma$ | evidence |", "|---|---|---|"]
        lines += [f"| {b.source} | {_shown(b.limit)} | {b.evidence} |" for b in self.bounds]
        return "\n".join(lines)


def advise_gain(
    scenario: Scenario,
    design: RSTDesign,
    requirements: Requirements,
    *,
    sampled: Sampling | None,
    box: ParameterBox | None,
) -> GainAdvice:
    """Bounds of γ̂ for the scenario's law around `design`, continuous or sampled.

    `box` is the certified one. The chosen law and its normalisation come from the scenario.
    """
    # What a processor integrates by Euler steps is bounded by its poles, not by a step size.
    step = (
        [_sampled_bound(scenario, design, requirements, sampled)]
        if sampled is not None
        else [_step_bound(scenario, design, requirements)]
    )
    drift = _drift(scenario, design, requirements)
    gain_box = None if box is None else projection_box(box)
    return GainAdvice(
        law=scenario.adaptation.law,
        chosen=scenario.adaptation.gain,
        speed=adaptation_speed(
            design,
            scenario.adaptation,
            gain=scenario.adaptation.gain,
            force=requirements.largest_force,
        ),
        bounds=(
            _delay_bound(scenario, design, requirements),
            *step,
            _noise_bound(scenario, design, requirements),
        ),
        drift=drift,
        time_to_border=_time_to_border(design, drift, gain_box),
        box=gain_box,
    )


def projection_box(box: ParameterBox) -> GainBox:
    """The certified box for a projection of (r1', s0 … sn), scaled; t0 … tn stay free.

    Rounded inward, so that every float in it is inside what was proved.
    """
    # Two roundings in the controller (scaling, product) cost less than 1e-15 of a gain.
    margin = 1e-14
    lower = [to_float(v) for v in box.lower]
    upper = [to_float(v) for v in box.upper]
    return GainBox(
        lower=tuple(v + margin * abs(v) for v in lower),
        upper=tuple(v - margin * abs(v) for v in upper),
    )


def largest_stable_speed(accepted: Callable[[float], bool]) -> float:
    """Largest λ (1/s) such that every smaller one is `accepted`, to 0.1 %; 0 and inf possible.

    λ beyond 1e6 1/s counts as infinite: no loop here tells them apart.
    """
    if not accepted(0.0):
        return 0.0
    low = 0.0
    for high in SPEEDS.tolist():
        if not accepted(high):
            break
        low = high
    else:
        return math.inf
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if accepted(middle) else (low, middle)
    return float(low)


def _delay_bound(scenario: Scenario, design: RSTDesign, needs: Requirements) -> GainBound:
    margins = {
        name: AdaptationLoop(design=design, speed=speed).margins().delay_margin
        for name, speed in (("frozen", 0.0), ("fast", math.inf))
    }
    speed = largest_stable_speed(
        lambda rate: (
            AdaptationLoop(design=design, speed=rate).margins().delay_margin >= needs.dead_time
        )
    )
    return GainBound(
        source="delay margin",
        limit=_limit(scenario, design, needs, speed),
        evidence=(
            f"dead time of {1e3 * needs.dead_time:.3g} ms asked for; the margin is "
            f"{1e3 * margins['frozen']:.3g} ms frozen and {1e3 * margins['fast']:.3g} ms with "
            f"infinitely fast adaptation{_up_to(speed)}"
        ),
    )


def _step_bound(scenario: Scenario, design: RSTDesign, needs: Requirements) -> GainBound:
    speed = RK4_REAL_LIMIT / needs.integration_step
    return GainBound(
        source="integration step",
        limit=_limit(scenario, design, needs, speed),
        evidence=(
            f"λΔt < {RK4_REAL_LIMIT:g} with steps of {1e6 * needs.integration_step:g} µs by the "
            f"classical Runge-Kutta method{_up_to(speed)}"
        ),
    )


def _noise_bound(scenario: Scenario, design: RSTDesign, needs: Requirements) -> GainBound:
    frozen = AdaptationLoop(design=design, speed=0.0).noise_gain()
    fast = AdaptationLoop(design=design, speed=math.inf).noise_gain()
    density = math.sqrt(2 * needs.noise_period) * needs.noise_rms
    speed = largest_stable_speed(
        lambda rate: (
            AdaptationLoop(design=design, speed=rate).noise_gain() <= needs.noise_growth * frozen
        )
    )
    return GainBound(
        source="sensor noise",
        limit=_limit(scenario, design, needs, speed),
        evidence=(
            f"{1e3 * needs.noise_rms:.3g} mN rms in the sensor give {1e3 * frozen * density:.3g} mN"
            f" of force frozen and {1e3 * fast * density:.3g} mN with fast adaptation; "
            f"{needs.noise_growth:g} times the frozen value accepted{_up_to(speed)}"
        ),
    )


def _sampled_bound(
    scenario: Scenario, design: RSTDesign, needs: Requirements, timing: Sampling
) -> GainBound:
    speed = largest_sampled_speed(scenario, design, timing, force=needs.largest_force)
    rate = 1 / to_float(timing.period)
    return GainBound(
        source="sampled loop",
        limit=_limit(scenario, design, needs, speed),
        evidence=(
            f"poles of the controller's code at {rate:g} Hz, delay {timing.delay} in samples, "
            f"adaptation by Euler steps{_up_to(speed)}"
        ),
    )


def largest_sampled_speed(
    scenario: Scenario, design: RSTDesign, timing: Sampling, *, force: float
) -> float:
    """Largest λ (1/s) up to which all poles of the sampled controller's loop are stable.

    At a constant `force` (N); the poles come from the derivatives of the code that runs.
    """
    period = to_float(timing.period)
    plant = design.specification.plant
    step = build_step(axis_controller(scenario, design, gain=1.0, sampling_period=period))
    loop = build_sampled_axis_loop(
        step,
        velocity_gain=plant.velocity_gain,
        stiffness=plant.stiffness,
        period=period,
        delay=timing.delay,
    )
    values = step.parameters.split(np.array(step.parameter_values))

    def stable(speed: float) -> bool:
        gain = gain_for_speed(design, scenario.adaptation, speed=speed, force=force)
        own = step.parameters.pack({**values, "adaptation_gain": gain})
        parameters = loop.with_controller_parameters(own)
        return linearise_axis(loop, force=force, parameters=parameters).growth < 0

    return largest_stable_speed(stable)


def axis_controller(
    scenario: Scenario,
    design: RSTDesign,
    *,
    gain: float,
    sampling_period: float | None,
    box: GainBox | None = None,
) -> AdaptiveRST:
    """The scenario's controller around `design`, sampled or not, projected to `box` if given."""
    nominal = nominal_gains(design)
    law = scenario.adaptation.build(gain, nominal=nominal)
    return AdaptiveRST(
        design=design,
        prefilter=scenario.prefilter,
        law=law if box is None else WithProjection(law=law, box=box),
        feedforward=DirectReference(),
        bias_force=scenario.adaptation.bias_force,
        initial_gains=nominal,
        time_domain=Continuous() if sampling_period is None else Discrete(sampling_period),
    )


def with_bandwidth(scenario: Scenario, *, bandwidth: float) -> Scenario:
    """The scenario with its design moved to another bandwidth (rad/s), ao = ω, K2 kept."""
    design = replace(scenario.design, bandwidth=bandwidth).with_observer_pole(bandwidth)
    return replace(scenario, design=design)


def _drift(scenario: Scenario, design: RSTDesign, needs: Requirements) -> FloatArray:
    adaptation = scenario.adaptation
    rate = adaptation.gain * design.specification.reference_model.bandwidth
    if adaptation.law == "normalised":
        rate /= adaptation.normalisation + adaptation.bias_force**2
    return rate * noise_drift(design, rms=needs.noise_rms, period=needs.noise_period)


def _time_to_border(design: RSTDesign, drift: FloatArray, box: GainBox | None) -> float:
    if box is None:
        return math.nan
    nominal = design.scaled_parameters[: len(drift)]
    room = np.where(drift > 0, np.array(box.upper) - nominal, nominal - np.array(box.lower))
    with np.errstate(divide="ignore"):
        return float(np.min(np.where(drift != 0, room / np.abs(drift), math.inf)))


def _limit(scenario: Scenario, design: RSTDesign, needs: Requirements, speed: float) -> float:
    if math.isinf(speed):
        return math.inf
    return gain_for_speed(design, scenario.adaptation, speed=speed, force=needs.largest_force)


def _up_to(speed: float) -> str:
    if math.isinf(speed):
        return ": no limit"
    return f": λ up to {speed:.4g} 1/s" if speed > 0 else ": not met even without adaptation"


def _shown(value: float) -> str:
    return "no limit" if math.isinf(value) else f"{value:.3g}"
