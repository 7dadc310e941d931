"""Harmonic feedforward: regressors, rejection, frequency tracking."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from mrac_design.controller.adaptation import NormalisedGradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.oscillator import (
    Oscillator,
    harmonic_signals,
    oscillator_values,
)
from mrac_design.controller.reference import ModelInverse
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.errors import ParameterError
from mrac_design.motion.reference import constant_force
from mrac_design.motion.signal import quintic_hermite
from mrac_design.plant import ForcePlant
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_axis_loop,
    build_sampled_axis_loop,
    simulate_axis,
)
from mrac_design.time_domain import Continuous, Discrete

DESIGN = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=50.0),
        reference_model=ReferenceModel(bandwidth=300.0, damping=1.0),
        observer=first_order_observer(300.0),
    )
)
OSCILLATOR = Oscillator(
    frequency=1.25, lowest=0.8, highest=2.0, harmonics=2, force=1.0, tracking=0.0, floor=1e-3
)
DURATION = 24.0
SAMPLED = Discrete(1e-3)


def heart():
    """Two harmonics at 1.25 Hz, 8 mm peak to peak."""
    t = np.arange(0.0, DURATION + 1e-9, 0.005)
    value, rate, second = np.zeros((3, t.size))
    for amplitude, phase, order in ((3e-3, 0.3, 1), (1.5e-3, 1.1, 2)):
        w = 2 * np.pi * 1.25 * order
        value += amplitude * np.cos(w * t + phase)
        rate -= amplitude * w * np.sin(w * t + phase)
        second -= amplitude * w**2 * np.cos(w * t + phase)
    return quintic_hermite(t, value, rate, second)


HEART = heart()


def run(oscillator, *, gain, domain=SAMPLED, force=1.0):
    harmonics = () if oscillator is None else (0.05,) * (2 * oscillator.harmonics)
    step = build_step(
        AdaptiveRST(
            design=DESIGN,
            prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
            law=NormalisedGradientLaw(gain=(gain,) * 6 + harmonics, alpha=0.1),
            feedforward=ModelInverse(),
            bias_force=1.0,
            initial_gains=nominal_gains(DESIGN),
            time_domain=domain,
            oscillator=oscillator,
        )
    )
    plant = {"velocity_gain": 50.0, "stiffness": 800.0}
    loop = (
        build_axis_loop(step, **plant)
        if domain == Continuous()
        else build_sampled_axis_loop(step, period=1e-3, delay=1, **plant)
    )
    inputs = axis_inputs(
        step, heart=HEART, reference=constant_force(force).piecewise(DURATION), end=DURATION
    )
    settings = RunSettings(duration=DURATION, step=2e-4, record_period=1e-3)
    return simulate_axis(loop, inputs=inputs, settings=settings)


def residual(trajectory):
    error = trajectory["force"] - trajectory["desired_force"]
    return float(error[trajectory.time > 0.75 * DURATION].std())


@pytest.mark.parametrize("order", [1, 2])
def test_the_regressor_is_the_coarse_one_through_the_reference_model(order):
    model, ao, phase, frequency = ReferenceModel(bandwidth=60.0, damping=0.7), 80.0, 0.9, 12.0
    signals = harmonic_signals(
        OSCILLATOR,
        ca.SX([phase, frequency]),
        static=ca.SX(ao),
        model=ca.SX(model.polynomial[1:]),
    )
    both = ca.Function("both", [], [signals.coarse, signals.regressor])()
    coarse, regressor = (both[name].full().ravel() for name in ("o0", "o1"))
    answer = 1.0 / np.polyval(model.polynomial, 1j * order * frequency)
    turned = np.exp(1j * order * phase)
    pair = slice(2 * order - 2, 2 * order)
    np.testing.assert_allclose(coarse[pair], np.array([turned.real, turned.imag]) / ao)
    # A cosine passes as Re(G e^{jϕ}), a sine as Im(G e^{jϕ}).
    expected = np.array([(answer * turned).real, (answer * turned).imag]) / ao
    np.testing.assert_allclose(regressor[pair], expected, rtol=1e-12)


def test_regressors_have_the_force_asked_for():
    values = oscillator_values(OSCILLATOR, unit_force=300.0**3 / 800.0)
    # b0 D φ with φ ≈ 1/(ao ω²) far below the bandwidth.
    sizes = 800.0 * np.asarray(values["harmonic_scaling"]) / (300.0 * 300.0**2)
    np.testing.assert_allclose(sizes, OSCILLATOR.force)


@pytest.mark.parametrize("domain", [Continuous(), SAMPLED])
def test_a_periodic_motion_disappears(domain):
    frozen = residual(run(None, gain=0.0, domain=domain))
    alone = residual(run(OSCILLATOR, gain=0.0, domain=domain))
    assert alone < 0.02 * frozen


def test_it_adds_to_what_the_adaptive_gains_do_even_without_force():
    adaptive = residual(run(None, gain=0.3, force=0.0))
    assert residual(run(OSCILLATOR, gain=0.3, force=0.0)) < 0.2 * adaptive


def test_a_wrong_frequency_is_found():
    wrong = replace(OSCILLATOR, frequency=1.2)
    fixed, tracked = run(wrong, gain=0.0), run(replace(wrong, tracking=0.3), gain=0.0)
    late = tracked.time > 0.75 * DURATION
    frequency = tracked["heart_rate"][late, 0] / (2 * np.pi)
    np.testing.assert_allclose(frequency, 1.25, atol=0.01)
    assert residual(tracked) < 0.1 * residual(fixed)


@pytest.mark.parametrize("domain", [Continuous(), SAMPLED])
def test_the_frequency_stays_in_its_range(domain):
    narrow = replace(OSCILLATOR, frequency=1.2, highest=1.22, tracking=0.3)
    frequency = run(narrow, gain=0.0, domain=domain)["heart_rate"] / (2 * np.pi)
    # An integration step may carry the continuous state over the border by its own length.
    assert frequency.max() == pytest.approx(1.22, abs=1e-4)
    assert frequency.min() >= 0.8


def test_nonsense_is_refused():
    with pytest.raises(ParameterError, match="in order"):
        replace(OSCILLATOR, highest=1.0)
    with pytest.raises(ParameterError, match="harmonics"):
        replace(OSCILLATOR, harmonics=0)
    with pytest.raises(ParameterError, match="tracking"):
        replace(OSCILLATOR, tracking=-1.0)
