"""The single-axis loop against linear theory, continuous and sampled."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from mrac_design.controller.adaptation import GradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.reference import DirectReference
from mrac_design.controller.rivals.active_observer import active_observer
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.errors import ParameterError
from mrac_design.motion.reference import constant_force
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.plant import ForcePlant
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_axis_loop,
    build_sampled_axis_loop,
    simulate_axis,
    white_noise,
)
from mrac_design.time_domain import Continuous
from tests.controller.rivals.cases import OBSERVER
from tests.oracles import sampled_force_loop as oracle

STIFFNESS, VELOCITY_GAIN = 800.0, 50.0
DESIGN = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=STIFFNESS, velocity_gain=VELOCITY_GAIN),
        reference_model=ReferenceModel(bandwidth=300.0, damping=1.0),
        observer=first_order_observer(400.0),
    )
)


def frozen_step():
    return build_step(
        AdaptiveRST(
            design=DESIGN,
            prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
            law=GradientLaw(gain=0.0),
            feedforward=DirectReference(),
            bias_force=0.0,
            initial_gains=nominal_gains(DESIGN),
            time_domain=Continuous(),
        )
    )


def parabola(end, *, velocity, acceleration):
    """Heart motion from rest position with constant acceleration, one polynomial."""
    return PiecewisePolynomial(
        breakpoints=np.array([0.0, end]),
        coefficients=np.array([[[0.0, velocity, 0.5 * acceleration]]]),
    )


def test_a_frozen_controller_answers_the_heart_with_its_disturbance_sensitivity():
    end = 0.2
    step = frozen_step()
    loop = build_axis_loop(step, velocity_gain=VELOCITY_GAIN, stiffness=STIFFNESS)
    inputs = axis_inputs(
        step,
        heart=parabola(end, velocity=0.02, acceleration=0.5),
        reference=constant_force(1.0).piecewise(end),
        end=end,
    )
    run = simulate_axis(
        loop, inputs=inputs, settings=RunSettings(duration=end, step=1e-4, record_period=1e-3)
    )
    # d = −Ks Xh through S_d: 1/p² and 1/p³ cancel into a step response of proper functions.
    p = control.TransferFunction([1.0, 0.0], [1.0])
    answer = control.minreal(
        DESIGN.disturbance_sensitivity() * (0.02 / p + 0.5 / p**2), verbose=False
    )
    _, expected = control.step_response(-STIFFNESS * answer, run.time)
    # RK4 at 0.1 ms on poles up to 400 rad/s: (0.04)⁵/120 a step.
    np.testing.assert_allclose(run["force"][:, 0] - 1.0, expected, atol=1e-7)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_sampled_loop_is_the_exact_recursion(delay):
    controller = active_observer(replace(OBSERVER, delay=delay))
    step = build_linear_step(controller)
    loop = build_sampled_axis_loop(
        step, velocity_gain=VELOCITY_GAIN, stiffness=STIFFNESS, period=1e-3, delay=delay
    )
    end = 0.3
    inputs = axis_inputs(
        step,
        heart=parabola(end, velocity=0.0, acceleration=0.0),
        reference=constant_force(1.0).piecewise(end),
        noise=white_noise(rms=0.05, period=1e-3, duration=end, seed=1),
        end=end,
    )
    run = simulate_axis(
        loop, inputs=inputs, settings=RunSettings(duration=end, step=1e-4, record_period=1e-3)
    )
    rows, command = controller.matrices()
    phi, gamma = oracle.plant(STIFFNESS, VELOCITY_GAIN, 1e-3)
    state = step.equilibrium(1.0, step.parameter_values).full().ravel()
    noise = inputs(run.time)[2]
    x, waiting, expected = np.array([1.0, 0.0]), [0.0] * delay, []
    for sample in noise:
        expected.append(x[0])
        columns = np.concatenate([state, [x[0] + sample, 1.0, 0.0]])
        columns[-1] = command @ columns
        waiting = [columns[-1], *waiting]
        state, x = rows @ columns, phi @ x + gamma * waiting.pop()
    # RK4 over 0.1 ms against the exact exponential: (K2 h)⁵/120 a step.
    np.testing.assert_allclose(run["force"][:, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(run["measured_force"][:, 0], expected + noise, rtol=1e-9)


def test_a_limited_command_reaches_plant_and_controller_limited():
    step = frozen_step()
    loop = build_axis_loop(
        step, velocity_gain=VELOCITY_GAIN, stiffness=STIFFNESS, command_limit=0.5
    )
    inputs = axis_inputs(
        step,
        heart=parabola(0.1, velocity=0.02, acceleration=0.0),
        reference=constant_force(1.0).piecewise(0.1),
        end=0.1,
    )
    run = simulate_axis(
        loop, inputs=inputs, settings=RunSettings(duration=0.1, step=1e-4, record_period=1e-3)
    )
    assert np.abs(run["command"]).max() == 0.5
    assert run.events[0].change == "reached"
    # The event stands between the last record within the limit and the first at it.
    first = int(np.argmax(np.abs(run["command"][:, 0]) == 0.5))
    assert run.time[first - 1] <= run.events[0].time <= run.time[first]


def test_noise_is_white_and_reproducible():
    noise = white_noise(rms=0.02, period=1e-3, duration=20.0, seed=9)
    samples = noise.coefficients[0, :, 0]
    assert samples.std() == pytest.approx(0.02, rel=0.02)
    # Of 20 000 independent samples the correlation scatters by 0.7 %.
    assert abs(np.corrcoef(samples[:-1], samples[1:])[0, 1]) < 0.03
    again = white_noise(rms=0.02, period=1e-3, duration=20.0, seed=9)
    np.testing.assert_array_equal(again.coefficients, noise.coefficients)


def test_misuse_is_refused():
    step = frozen_step()
    with pytest.raises(ParameterError, match="stiffness"):
        build_axis_loop(step, velocity_gain=50.0, stiffness=0.0)
    with pytest.raises(ParameterError, match="delay"):
        build_sampled_axis_loop(step, velocity_gain=50.0, stiffness=800.0, period=1e-3, delay=-1)
    with pytest.raises(ParameterError, match="sampling period"):
        build_sampled_axis_loop(step, velocity_gain=50.0, stiffness=800.0, period=0.0, delay=0)
    with pytest.raises(ParameterError, match="command limit"):
        build_axis_loop(step, velocity_gain=50.0, stiffness=800.0, command_limit=0.0)
    with pytest.raises(ParameterError, match=r"continuous time.*sampled every 0\.001 s"):
        build_sampled_axis_loop(step, velocity_gain=50.0, stiffness=800.0, period=1e-3, delay=0)
