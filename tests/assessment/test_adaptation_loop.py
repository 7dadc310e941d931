"""The linearised adaptation against its closed form, the controller's derivatives, simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq, fmpq_poly

from mrac_design.assessment.adaptation_loop import (
    AdaptationLoop,
    adaptation_speed,
    gain_for_speed,
    noise_drift,
)
from mrac_design.assessment.advisor import axis_controller
from mrac_design.assessment.linearisation import linearise_axis
from mrac_design.assessment.prediction import constant
from mrac_design.controller.adaptive import build_step
from mrac_design.errors import ParameterError
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_axis_loop,
    simulate_axis,
    white_noise,
)


def continuous_loop(scenario, design, gain):
    plant = design.specification.plant
    return build_axis_loop(
        build_step(axis_controller(scenario, design, gain=gain, sampling_period=None)),
        velocity_gain=plant.velocity_gain,
        stiffness=plant.stiffness,
    )


def test_closed_loop_poles_are_those_of_the_frozen_loop_and_the_adaptation(design):
    """Exactly: numerator + denominator of L is Ao Am · Am (p + λ)."""
    numerator, denominator = AdaptationLoop(design=design, speed=750.0).loop_gain
    Am = fmpq_poly([250_000, 1000, 1])
    Ao = fmpq_poly([500, 1])
    assert numerator + denominator == Ao * Am * Am * fmpq_poly([fmpq(750), 1])


def test_delay_margins_of_frozen_and_fast_adaptation(design):
    margins = [
        AdaptationLoop(design=design, speed=v).margins().delay_margin for v in (0.0, 5e3, math.inf)
    ]
    # 2.1 ms frozen and 1.26 ms fast, known to these digits from simulation.
    assert margins[0] == pytest.approx(2.1e-3, abs=0.05e-3)
    assert margins[1] == pytest.approx(1.26e-3, abs=0.005e-3)
    assert margins[2] == pytest.approx(margins[1], rel=0.01)
    assert margins[0] == pytest.approx(design.margins().delay_margin, rel=1e-12)


@pytest.mark.parametrize("law", ["normalised", "gradient"])
@pytest.mark.parametrize("force", [0.5, 2.0])
def test_adaptation_is_one_mode_of_the_controllers_own_derivatives(scenario, design, law, force):
    """CasADi's Jacobian of the code has an eigenvalue −λ; 123 1/s is far from all other poles."""
    changed = replace(scenario, adaptation=replace(scenario.adaptation, law=law, bias_force=0.3))
    gain = gain_for_speed(design, changed.adaptation, speed=123.0, force=force)
    found = linearise_axis(continuous_loop(changed, design, gain), force=force)
    nearest = found.adapting[np.argmin(np.abs(found.adapting + 123.0))]
    # The other poles are nearly multiple, so rounding moves them, not this one.
    assert nearest == pytest.approx(-123.0, rel=1e-6)
    assert adaptation_speed(design, changed.adaptation, gain=gain, force=force) == pytest.approx(
        123.0
    )


def test_adaptation_is_one_mode_with_an_internal_model_too(resonant):
    """In continuous time; 60 1/s is apart from the observer's and the model's poles."""
    scenario = replace(
        resonant.scenario, adaptation=replace(resonant.scenario.adaptation, bias_force=0.3)
    )
    gain = gain_for_speed(resonant.design, scenario.adaptation, speed=60.0, force=1.0)
    found = linearise_axis(continuous_loop(scenario, resonant.design, gain), force=1.0)
    nearest = found.adapting[np.argmin(np.abs(found.adapting + 60.0))]
    assert nearest == pytest.approx(-60.0, rel=1e-6)
    loop = AdaptationLoop(design=resonant.design, speed=60.0)
    numerator, denominator = loop.loop_gain
    poles = np.array([complex(root) for root, _ in (numerator + denominator).complex_roots()])
    assert np.abs(poles + 60.0).min() < 1e-6


def test_normalised_law_has_a_ceiling_and_zero_force_no_adaptation(scenario, design):
    speeds = [
        adaptation_speed(design, scenario.adaptation, gain=1.0, force=force)
        for force in (0.0, 1.0, 100.0)
    ]
    assert speeds[0] == 0.0
    assert speeds[1] < speeds[2] < 500.0
    assert gain_for_speed(design, scenario.adaptation, speed=10.0, force=0.0) == math.inf
    with pytest.raises(ParameterError, match="λ"):
        AdaptationLoop(design=design, speed=-1.0)


def test_noise_drift_is_what_a_run_shows(scenario, design):
    """Twenty seconds of noise at zero force; the drift slows as the gains leave nominal."""
    duration, rms, period = 20.0, 0.02, 1e-3
    changed = replace(scenario, adaptation=replace(scenario.adaptation, law="gradient"))
    loop = continuous_loop(changed, design, 1.0)
    inputs = axis_inputs(
        loop.step,
        heart=constant(0.0, duration),
        reference=constant(0.0, duration),
        noise=white_noise(rms=rms, period=period, duration=duration, seed=1),
        end=duration,
    )
    settings = RunSettings(duration=duration, step=2e-4, record_period=0.1)
    gains = simulate_axis(loop, inputs=inputs, settings=settings)["adapted_gains"]
    measured = (gains[-1] - gains[0])[:3] / duration
    predicted = 500.0 * noise_drift(design, rms=rms, period=period)
    # One noise record, and s0's drift is a small difference: a fifth of the largest for all.
    np.testing.assert_allclose(measured, predicted, atol=0.2 * np.abs(predicted).max())
    assert np.all(np.sign(measured) == np.sign(predicted))
