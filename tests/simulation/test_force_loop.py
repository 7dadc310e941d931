"""The closed force loop against SciPy, linear theory and its own second engine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.controller.adaptation import NormalisedGradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.linearisation import RobotModelError, build_linearisation
from mrac_design.controller.reference import ModelInverse
from mrac_design.design import (
    ReferenceModel,
    RSTSpecification,
    design_rst,
    first_order_observer,
)
from mrac_design.errors import ParameterError, SimulationError, SingularPostureError
from mrac_design.motion.signal import PiecewisePolynomial, quintic_hermite, stack
from mrac_design.plant import ForcePlant
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.closed_loop import ForceLoop, build_force_loop, resting_state
from mrac_design.simulation.contact import LinearSpring
from mrac_design.simulation.engine import InterpretedEngine, build_engine
from mrac_design.simulation.friction import Frictionless
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.system import Kinks
from mrac_design.simulation.tableau import RK4
from mrac_design.time_domain import Continuous

STIFFNESS = 800.0
DESIGN = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=STIFFNESS, velocity_gain=50.0),
        reference_model=ReferenceModel(bandwidth=500.0, damping=1.0),
        observer=first_order_observer(500.0),
    )
)


@pytest.fixture(scope="module", params=["planar_2r", "d2m2_set_a"])
def dynamics(request):
    return build_dynamics(load_robot(request.param))


def loop_of(
    dynamics, *, gain=1.0, model_error=None, stiffness=STIFFNESS, kinks=Kinks.LOCATED
) -> ForceLoop:
    linearisation = build_linearisation(
        dynamics,
        velocity_gain=50.0,
        tool_axis_bandwidth=50.0,
        model_error=model_error or RobotModelError(body_scale=1.0, first_joint_scale=1.0),
    )
    step = build_step(
        AdaptiveRST(
            design=DESIGN,
            prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
            law=NormalisedGradientLaw(gain=gain, alpha=0.1),
            feedforward=ModelInverse(),
            bias_force=0.0,
            initial_gains=nominal_gains(DESIGN),
            time_domain=Continuous(),
        )
    )
    axes = len(dynamics.description.force_axes)
    return build_force_loop(
        dynamics,
        linearisation,
        [step] * axes,
        contact=LinearSpring(stiffness),
        friction=Frictionless(),
        kinks=kinks,
    )


def inputs_of(loop: ForceLoop, *, frequency=8.0, amplitude=1e-3, end=2.0) -> PiecewisePolynomial:
    """A sinusoidal heart under every axis; the force steps from 1 N to 1.5 N at 0.3 s."""
    k = len(loop.controllers)
    t = np.arange(0, end + 5e-3, 5e-3)
    t[-1] = end
    phase = frequency * t
    heart = quintic_hermite(
        t,
        np.tile(amplitude * np.sin(phase), (k, 1)),
        np.tile(amplitude * frequency * np.cos(phase), (k, 1)),
        np.tile(-amplitude * frequency**2 * np.sin(phase), (k, 1)),
    )
    tip = loop.dynamics.task_position(loop.dynamics.description.home).full().ravel()[:k]
    reference = PiecewisePolynomial(
        breakpoints=np.array([0, 0.3, end]),
        coefficients=np.tile(np.array([1.0, 1.5])[None, :, None], (k, 1, 1)),
    )
    return stack(heart.shifted(tip - 1.0 / STIFFNESS), reference)


def start_of(loop: ForceLoop):
    return resting_state(
        loop,
        posture=loop.dynamics.description.home,
        force=[1.0] * len(loop.controllers),
        condition_limit=100.0,
    )


def record(loop, inputs, *, engine=None, step=1e-4, duration=2.0):
    engine = engine or build_engine(loop.system, RK4, input_powers=inputs.degree + 1)
    recording = run(
        engine,
        loop.system,
        inputs=inputs,
        parameters=loop.parameter_values,
        initial_state=start_of(loop),
        settings=RunSettings(duration=duration, step=step, record_period=5e-3),
    )
    return recording, loop.system.outputs.split(recording.outputs)


def test_force_agrees_with_dop853_at_1e_12(dynamics):
    """Same right-hand side, SciPy's eighth-order method restarted at the reference's jump."""
    loop = loop_of(dynamics, model_error=RobotModelError(body_scale=1.05, first_joint_scale=1.2))
    # The small robot's run is short: the point is the second structure, not a second wait.
    end = 2.0 if dynamics.description.joint_count == 5 else 0.5
    inputs = inputs_of(loop, end=end)
    recording, ours = record(loop, inputs, duration=end)
    rate = loop.system.rate
    within = np.ones(loop.system.held.size)  # no effort reaches its limit here

    def rhs(t, x, left, right):
        t = np.clip(t, left, np.nextafter(right, left))  # the input of this side of the jump
        return rate(x, within, inputs(t)[:, 0], loop.parameter_values).full().ravel()

    state, times, states = start_of(loop), [], []
    for left, right in ((0.0, 0.3), (0.3, end)):
        inside = recording.time[(recording.time >= left - 1e-9) & (recording.time < right - 1e-9)]
        solution = solve_ivp(
            rhs, (left, right), state, args=(left, right), method="DOP853",
            t_eval=np.append(inside[::10], right), rtol=1e-12, atol=1e-12,
        )  # fmt: skip
        times.extend(inside[::10])
        states.extend(solution.y.T[:-1])
        state = solution.y[:, -1]
    exact = np.array(
        [
            loop.system.outputs.split(
                loop.system.output(x, [], inputs(t)[:, 0], loop.parameter_values).full().ravel()
            )["force"]
            for t, x in zip(times, states, strict=True)
        ]
    )
    index = np.searchsorted(recording.time, np.array(times) - 1e-9)
    assert np.abs(ours["force"][index] - exact).max() < 1e-6


def test_compiled_and_interpreted_runs_agree(dynamics):
    loop = loop_of(dynamics)
    inputs = inputs_of(loop)
    interpreter = InterpretedEngine(loop.system, RK4, input_powers=inputs.degree + 1)
    compiled = record(loop, inputs, duration=0.1)[0]
    interpreted = record(loop, inputs, engine=interpreter, duration=0.1)[0]
    # Compiled code fuses products with sums; the loop's gains make 1e-16 m into 1e-10 N·m.
    np.testing.assert_allclose(compiled.outputs, interpreted.outputs, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("true_stiffness", [800.0, 1200.0])
def test_frozen_force_error_is_the_disturbance_sensitivity(dynamics, true_stiffness):
    """With exact linearisation each axis is S_d(jω) Ks A, and S_d hardly knows the true Ks."""
    frequency, amplitude = 8.0, 1e-3
    s = 1j * frequency
    loop = loop_of(dynamics, gain=0.0, stiffness=true_stiffness)
    _, outputs = record(loop, inputs_of(loop, frequency=frequency, amplitude=amplitude))
    late = slice(200, None)
    error = (outputs["force"] - outputs["model_force"])[late]
    open_loop = s * (s + 50) * (s + DESIGN.r1)
    closed = open_loop + true_stiffness * (DESIGN.S[0] * s + DESIGN.S[1])
    sensitivity = open_loop / closed
    expected = abs(sensitivity) * true_stiffness * amplitude
    # Samples every 5 ms see the peak of an 8 rad/s sine to (ω h)²/8 = 2e-4.
    np.testing.assert_allclose(np.abs(error).max(axis=0), expected, rtol=2e-3)


def test_an_unstable_loop_is_reported_with_its_instant(dynamics):
    # Steps that end where an effort meets its limit are short enough to calm it again.
    loop = loop_of(dynamics, kinks=Kinks.CROSSED)
    with pytest.raises(SimulationError, match="t = "):
        record(loop, inputs_of(loop), step=2e-2)


def test_a_singular_start_is_refused_with_the_number():
    loop = loop_of(build_dynamics(load_robot("d2m2_set_a")))
    straight = loop.dynamics.description.home.copy()
    straight[2] = 0.0
    with pytest.raises(SingularPostureError, match="condition number"):
        resting_state(loop, posture=straight, force=[1.0] * 3, condition_limit=100.0)


@pytest.mark.parametrize("stiffness", [0.0, -800.0, float("nan")])
def test_a_bad_stiffness_is_refused(stiffness):
    dynamics = build_dynamics(load_robot("planar_2r"))
    with pytest.raises(ParameterError, match="stiffness"):
        loop_of(dynamics, stiffness=stiffness)
