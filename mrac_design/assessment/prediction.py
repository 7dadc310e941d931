"""The advisor's predictions beside simulation: calm just inside a limit, growing just outside.

Every limit predicted from the linearised loop is tried in the nonlinear simulation on both sides.
A kick of a micrometre starts it; its growth is measured between two windows of the run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.assessment.adaptation_loop import AdaptationLoop, gain_for_speed
from mrac_design.assessment.advisor import (
    RK4_REAL_LIMIT,
    Requirements,
    axis_controller,
    largest_sampled_speed,
)
from mrac_design.controller.adaptive import build_step
from mrac_design.design import RSTDesign
from mrac_design.errors import SimulationError
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import (
    AxisLoop,
    axis_inputs,
    build_axis_loop,
    build_sampled_axis_loop,
    simulate_axis,
    white_noise,
)
from mrac_design.stability import Sampling
from mrac_design.stability.rational_function import to_float

FAST = 5000.0
"""λ (1/s) that counts as fast adaptation where the limit of infinity is to be simulated."""

FINE_PERIOD = 5e-5
"""Sampling period (s) of a loop that stands for a continuous one with dead time."""

_KICK, _DURATION = 1e-6, 1.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """A limit, and what the simulation does just inside and just outside of it."""

    name: str
    """What is limited."""
    unit: str
    """Unit of the limit."""
    speed: float
    """Adaptation speed λ (1/s) at the limit; 0 for the frozen controller."""
    predicted: float
    """The limit from the linearised loop."""
    inside: float
    """Value simulated inside the limit."""
    inside_growth: float
    """Growth measured there (1/s); negative when the kick dies out."""
    outside: float
    """Value simulated outside the limit."""
    outside_growth: float
    """Growth measured there (1/s), inf when the run left the finite numbers."""

    @property
    def confirmed(self) -> bool:
        """Whether the limit lies between the two."""
        return self.inside_growth < 0 < self.outside_growth


def delay_prediction(
    scenario: Scenario, design: RSTDesign, *, speed: float, force: float, name: str
) -> Prediction:
    """Delay margin of the loop with adaptation speed λ = `speed` (1/s) at `force` (N)."""
    predicted = AdaptationLoop(design=design, speed=speed).margins().delay_margin
    gradient = _with_gradient_law(scenario)
    gain = gain_for_speed(design, gradient.adaptation, speed=speed, force=force) if speed else 0.0
    # The hold adds half a period to the whole periods of the pipeline.
    whole = predicted / FINE_PERIOD - 0.5
    delays = math.floor(0.96 * whole), math.ceil(1.04 * whole)
    growths = [
        measured_growth(
            _sampled_loop(gradient, design, gain=gain, period=FINE_PERIOD, delay=delay), force
        )
        for delay in delays
    ]
    inside, outside = (FINE_PERIOD * (delay + 0.5) for delay in delays)
    return Prediction(
        name=name,
        unit="s",
        speed=speed,
        predicted=predicted,
        inside=inside,
        inside_growth=growths[0],
        outside=outside,
        outside_growth=growths[1],
    )


def step_prediction(scenario: Scenario, design: RSTDesign, needs: Requirements) -> Prediction:
    """Largest γ̂ of the plain gradient law that the integration step can follow."""
    gradient, force = _with_gradient_law(scenario), needs.largest_force
    predicted = gain_for_speed(
        design,
        gradient.adaptation,
        speed=RK4_REAL_LIMIT / needs.integration_step,
        force=force,
    )

    def loop(gain: float) -> AxisLoop:
        plant = design.specification.plant
        return build_axis_loop(
            build_step(axis_controller(gradient, design, gain=gain, sampling_period=None)),
            velocity_gain=plant.velocity_gain,
            stiffness=plant.stiffness,
        )

    return _gain_prediction(
        "γ̂ with this integration step",
        RK4_REAL_LIMIT / needs.integration_step,
        predicted,
        loop,
        force,
        needs.integration_step,
    )


def sampled_prediction(
    scenario: Scenario, design: RSTDesign, needs: Requirements, timing: Sampling
) -> Prediction:
    """Largest γ̂ of the plain gradient law in the sampled controller's own code."""
    gradient, force = _with_gradient_law(scenario), needs.largest_force

    speed = largest_sampled_speed(gradient, design, timing, force=force)
    period = to_float(timing.period)
    return _gain_prediction(
        f"γ̂ at {1 / period:g} Hz, delay {timing.delay}",
        speed,
        gain_for_speed(design, gradient.adaptation, speed=speed, force=force),
        lambda value: _sampled_loop(
            gradient, design, gain=value, period=period, delay=timing.delay
        ),
        force,
        FINE_PERIOD,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class NoisePrediction:
    """Force noise (N rms) predicted and simulated at one adaptation speed."""

    speed: float
    """λ (1/s)."""
    predicted: float
    """From the linearised loop."""
    simulated: float
    """From a run of the nonlinear loop."""


def noise_prediction(
    scenario: Scenario, design: RSTDesign, needs: Requirements, *, speed: float
) -> NoisePrediction:
    """Force noise at adaptation speed λ = `speed` (1/s) and the largest force, over 20 s."""
    gradient, force, duration = _with_gradient_law(scenario), needs.largest_force, 20.0
    gain = gain_for_speed(design, gradient.adaptation, speed=speed, force=force)
    plant = design.specification.plant
    step = build_step(axis_controller(gradient, design, gain=gain, sampling_period=None))
    loop = build_axis_loop(step, velocity_gain=plant.velocity_gain, stiffness=plant.stiffness)
    inputs = axis_inputs(
        step,
        heart=constant(0.0, duration),
        reference=constant(force, duration),
        noise=white_noise(
            rms=needs.noise_rms, period=needs.noise_period, duration=duration, seed=1
        ),
        end=duration,
    )
    trajectory = simulate_axis(
        loop,
        inputs=inputs,
        settings=RunSettings(duration=duration, step=1e-4, record_period=needs.noise_period / 4),
    )
    kept = trajectory.time > 1.0
    density = math.sqrt(2 * needs.noise_period) * needs.noise_rms
    return NoisePrediction(
        speed=speed,
        predicted=density * AdaptationLoop(design=design, speed=speed).noise_gain(),
        simulated=float(np.std(trajectory["force"][kept])),
    )


def measured_growth(loop: AxisLoop, force: float, *, step: float = FINE_PERIOD) -> float:
    """Growth (1/s) of the force error after a kick of the heart by a micrometre.

    At rest at a constant `force` (N); between the rms of an early and a late window.
    """
    inputs = axis_inputs(
        loop.step, heart=_kick(), reference=constant(force, _DURATION), end=_DURATION
    )
    settings = RunSettings(duration=_DURATION, step=step, record_period=1e-3)
    try:
        trajectory = simulate_axis(loop, inputs=inputs, settings=settings)
    except SimulationError:
        return math.inf
    error = trajectory["force"][:, 0] - force
    early, late = (_rms(error, trajectory.time, start) for start in (0.1, 0.5))
    if late < 1e-9 * np.abs(error).max():  # down at rounding, where no growth can be read
        return -math.inf
    return math.log(late / early) / 0.4


def constant(value: float, end: float) -> PiecewisePolynomial:
    """One channel that stays at `value` over [0, end] s."""
    return PiecewisePolynomial(
        breakpoints=np.array([0.0, end]), coefficients=np.full((1, 1, 1), float(value))
    )


def _gain_prediction(
    name: str,
    speed: float,
    predicted: float,
    loop: Callable[[float], AxisLoop],
    force: float,
    step: float,
) -> Prediction:
    inside, outside = 0.95 * predicted, 1.05 * predicted
    return Prediction(
        name=name,
        unit="1/N²",
        speed=speed,
        predicted=predicted,
        inside=inside,
        inside_growth=measured_growth(loop(inside), force, step=step),
        outside=outside,
        outside_growth=measured_growth(loop(outside), force, step=step),
    )


def _sampled_loop(
    scenario: Scenario, design: RSTDesign, *, gain: float, period: float, delay: int
) -> AxisLoop:
    plant = design.specification.plant
    return build_sampled_axis_loop(
        build_step(axis_controller(scenario, design, gain=gain, sampling_period=period)),
        velocity_gain=plant.velocity_gain,
        stiffness=plant.stiffness,
        period=period,
        delay=delay,
    )


def _with_gradient_law(scenario: Scenario) -> Scenario:
    """The plain law: its speed has no ceiling, so that every limit can be reached."""
    return replace(scenario, adaptation=replace(scenario.adaptation, law="gradient", safeguards=()))


def _kick() -> PiecewisePolynomial:
    """The heart's surface moving smoothly by a micrometre in 20 ms, then at rest."""
    rise = 0.02
    return PiecewisePolynomial(
        breakpoints=np.array([0.0, rise, _DURATION]),
        coefficients=np.array(
            [[[0.0, 0.0, 3 * _KICK / rise**2, -2 * _KICK / rise**3], [_KICK, 0.0, 0.0, 0.0]]]
        ),
    )


def _rms(error: FloatArray, time: FloatArray, start: float) -> float:
    part = error[(time >= start) & (time < start + 0.1)]
    return float(np.sqrt(np.mean(part**2)))
