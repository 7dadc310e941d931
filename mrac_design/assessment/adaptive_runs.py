"""The adaptive law itself, projected to its certified box, against the certified peak gain.

Unlike the paths of an adversary these are the gains' own movements: started anywhere in the box, at
any adaptation gain, on tissue of any stiffness in the range, under random hearts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from mrac_design.arrays import FloatArray
from mrac_design.assessment.advisor import axis_controller, projection_box
from mrac_design.assessment.prediction import constant
from mrac_design.assessment.worst_case import Comparison
from mrac_design.controller.adaptive import build_step
from mrac_design.design import RSTDesign
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import (
    AxisLoop,
    axis_inputs,
    build_axis_engine,
    build_axis_loop,
    build_sampled_axis_loop,
    simulate_axis,
)
from mrac_design.stability import Sampling, StabilityCertificate
from mrac_design.stability.rational_function import to_float

DURATION = 2.0
"""Length of a run (s)."""

_KNOT = 2e-3


def adaptive_runs(
    certificate: StabilityCertificate,
    scenario: Scenario,
    design: RSTDesign,
    *,
    gains: Sequence[float],
    runs: int,
    seed: int,
) -> Comparison:
    """Peak force per peak of d = Ẍh + K2 Ẋh over `runs` runs, γ̂ going round through `gains`.

    The force reference is zero, so that all force is the heart's. The certified bound holds for
    the projected gains whatever γ̂ is; the law is the scenario's own without bias and safeguards.
    """
    rng = np.random.default_rng(seed)
    box = projection_box(certificate.box)
    loop = _loop(certificate, scenario, design)
    b0 = certificate.loop.design_stiffness
    softest, stiffest = (to_float(v * b0) for v in certificate.box.stiffness_ratio)
    K2 = to_float(certificate.loop.velocity_gain)
    settings = RunSettings(duration=DURATION, step=1e-4, record_period=5e-4)
    worst, engine = 0.0, None
    for number in range(runs):
        heart = random_heart(rng)
        inputs = axis_inputs(
            loop.step, heart=heart, reference=constant(0.0, DURATION), end=DURATION
        )
        engine = engine or build_axis_engine(loop, inputs)
        trajectory = simulate_axis(
            loop,
            inputs=inputs,
            settings=settings,
            parameters=_started_at(
                loop,
                gain=gains[number % len(gains)],
                start=rng.uniform(box.lower, box.upper),
                stiffness=float(rng.uniform(softest, stiffest)),
            ),
            engine=engine,
        )
        peak = float(np.abs(trajectory["force"]).max())
        worst = max(worst, peak / peak_disturbance(heart, K2))
    return Comparison(
        name="peak force per peak of $d$, the law's own gains",
        unit="N/(m/s²)",
        bound=certificate.peak_gain,
        simulated=worst,
        trials=runs,
    )


def _started_at(loop: AxisLoop, *, gain: float, start: FloatArray, stiffness: float) -> FloatArray:
    """Parameters with another γ̂, other feedback gains at the start and another tissue."""
    layout = loop.step.parameters
    values = layout.split(np.array(loop.step.parameter_values))
    first = [*start, *values["initial_gains"][len(start) :]]
    own = layout.pack({**values, "adaptation_gain": gain, "initial_gains": first})
    parts = loop.system.parameters.split(np.array(loop.with_controller_parameters(own)))
    return loop.system.parameters.pack({**parts, "stiffness": stiffness})


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionResponse:
    """What one axis of a heart motion does to the force, proved and simulated."""

    peak_disturbance: float
    """sup |Ẍh + K2 Ẋh| (m/s²)."""
    bound: float
    """Certified bound of the force it causes (N)."""
    simulated: float
    """Largest force it causes in simulation, the law projected to its box (N)."""


def motion_responses(
    certificate: StabilityCertificate,
    scenario: Scenario,
    design: RSTDesign,
    *,
    displacement: PiecewisePolynomial,
    axes: Sequence[str],
) -> Mapping[str, MotionResponse]:
    """Force that each channel of a `displacement` (m) causes, at zero reference, by axis.

    Each run starts where that channel stands still for an instant, so that it starts from rest, as
    the certified bound asks.
    """
    loop = _loop(certificate, scenario, design)
    K2 = to_float(certificate.loop.velocity_gain)
    found = {}
    for index, axis in enumerate(axes):
        heart = _from_standstill(displacement.selected([index]))
        inputs = axis_inputs(
            loop.step, heart=heart, reference=constant(0.0, heart.end), end=heart.end
        )
        settings = RunSettings(duration=heart.end, step=1e-4, record_period=5e-4)
        trajectory = simulate_axis(loop, inputs=inputs, settings=settings)
        d = peak_disturbance(heart, K2)
        found[axis] = MotionResponse(
            peak_disturbance=d,
            bound=certificate.peak_gain * d,
            simulated=float(np.abs(trajectory["force"]).max()),
        )
    return found


def _from_standstill(channel: PiecewisePolynomial) -> PiecewisePolynomial:
    """The motion from its first standstill on, starting at time 0."""
    velocity = channel.derivative()
    time = np.linspace(channel.start, channel.end, 20 * len(channel.breakpoints))
    speeds = velocity(time)[0]
    turns = np.flatnonzero(speeds[:-1] * speeds[1:] <= 0)
    # The end is kept away from, so that a motion that never turns still leaves something to run.
    first = int(turns[0]) if turns.size else 0
    low, high = time[first], time[first + 1]
    rising = speeds[first] < speeds[first + 1]
    for _ in range(60):
        middle = (low + high) / 2
        if (velocity(middle)[0, 0] > 0) == rising:
            high = middle
        else:
            low = middle
    rest = channel.restricted(float(low), channel.end)
    return PiecewisePolynomial(
        breakpoints=rest.breakpoints - rest.breakpoints[0], coefficients=rest.coefficients
    )


def random_heart(rng: np.random.Generator) -> PiecewisePolynomial:
    """A random periodic motion (m) with harmonics of a random beat, growing smoothly from rest."""
    time = np.arange(0.0, DURATION + _KNOT / 2, _KNOT)
    beat = rng.uniform(0.8, 3.0)
    harmonics = np.arange(1, 9)
    sizes = 1e-3 * rng.standard_normal(8) / harmonics ** rng.uniform(0.0, 2.0)
    phases = rng.uniform(0, 2 * np.pi, 8)
    wave = (sizes * np.sin(2 * np.pi * beat * np.outer(time, harmonics) + phases)).sum(axis=1)
    # The third power leaves neither velocity nor acceleration at the start.
    ramp = 1 - np.exp(-((time / 0.1) ** 3))
    spline = CubicSpline(time, wave * ramp, bc_type="natural")
    return PiecewisePolynomial(breakpoints=time, coefficients=spline.c[::-1].T[None])


def peak_disturbance(heart: PiecewisePolynomial, velocity_gain: float) -> float:
    """sup |Ẍh + K2 Ẋh| (m/s²) of one channel, on a grid that meets every knot."""
    velocity = heart.derivative()
    time = np.linspace(heart.start, heart.end, 4 * (len(heart.breakpoints) - 1) + 1)
    d = velocity.derivative()(time) + velocity_gain * velocity(time)
    return float(np.abs(d).max())


def _loop(certificate: StabilityCertificate, scenario: Scenario, design: RSTDesign) -> AxisLoop:
    timing, plant = certificate.timing, design.specification.plant
    # A bias would add an acceleration of its own to d, which the ratio to d does not count.
    adaptation = replace(scenario.adaptation, bias_force=0.0, safeguards=())
    scenario = replace(scenario, adaptation=adaptation)
    period = to_float(timing.period) if isinstance(timing, Sampling) else None
    step = build_step(
        axis_controller(
            scenario,
            design,
            gain=scenario.adaptation.gain,
            sampling_period=period,
            box=projection_box(certificate.box),
        )
    )
    if isinstance(timing, Sampling):
        return build_sampled_axis_loop(
            step,
            velocity_gain=plant.velocity_gain,
            stiffness=plant.stiffness,
            period=to_float(timing.period),
            delay=timing.delay,
        )
    return build_axis_loop(step, velocity_gain=plant.velocity_gain, stiffness=plant.stiffness)
