"""The sampled loop against a plain Python loop around SciPy, and against the continuous loop."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial, quintic_hermite, stack
from mrac_design.robot import inertial_parameters
from mrac_design.simulation.closed_loop import build_force_loop, resting_state
from mrac_design.simulation.contact import LinearSpring
from mrac_design.simulation.encoder import ExactJoints
from mrac_design.simulation.engine import InterpretedEngine, build_engine
from mrac_design.simulation.friction import Frictionless
from mrac_design.simulation.run import Recording, RunSettings, run
from mrac_design.simulation.sampled_loop import (
    ComputationalDelay,
    SampledForceLoop,
    build_sampled_loop,
    resting_start,
    sampled_trajectory,
)
from mrac_design.simulation.sensor import (
    PERFECT_SENSOR,
    FineReading,
    ForceSensor,
    UniformQuantiser,
    gaussian_noise,
    no_noise,
)
from mrac_design.simulation.tableau import RK4
from mrac_design.time_domain import Continuous
from tests.robot_steps import STIFFNESS, controller_of, dynamics_of, linearisation_of, robot_step

ROBOT = "planar_2r"


def motion_and_reference(end: float, *, amplitude: float = 1e-3) -> PiecewisePolynomial:
    """A heart at 1.2 Hz under both axes; the force steps from 1 N to 1.5 N at 0.0305 s."""
    dynamics = dynamics_of(ROBOT)
    t = np.linspace(0.0, end, max(2, round(end / 5e-3)) + 1)
    w = 2 * np.pi * 1.2
    heart = quintic_hermite(
        t,
        np.tile(amplitude * np.sin(w * t), (2, 1)),
        np.tile(amplitude * w * np.cos(w * t), (2, 1)),
        np.tile(-amplitude * w**2 * np.sin(w * t), (2, 1)),
    )
    tip = dynamics.task_position(dynamics.description.home).full().ravel()[:2]
    reference = PiecewisePolynomial(
        breakpoints=np.array([0.0, 0.0305, end]),
        coefficients=np.tile(np.array([1.0, 1.5])[None, :, None], (2, 1, 1)),
    )
    return stack(heart.shifted(tip - 1.0 / STIFFNESS), reference)


def sampled_loop(
    *, period: float = 1e-3, delay: int = 0, sensor: ForceSensor = PERFECT_SENSOR
) -> SampledForceLoop:
    return build_sampled_loop(
        dynamics_of(ROBOT),
        robot_step(ROBOT, period=period),
        contact=LinearSpring(STIFFNESS),
        friction=Frictionless(),
        delay=ComputationalDelay(delay),
        sensor=sensor,
        joints=ExactJoints(),
    )


def record(
    sampled: SampledForceLoop,
    inputs: PiecewisePolynomial,
    *,
    duration: float,
    record_period: float = 1e-3,
    engine=None,
) -> Recording:
    loop = sampled.loop
    start = resting_start(
        sampled, posture=loop.dynamics.description.home, force=[1.0, 1.0], condition_limit=100.0
    )
    return run(
        engine or build_engine(loop.system, RK4, input_powers=inputs.degree + 1),
        loop.system,
        inputs=inputs,
        parameters=loop.parameter_values,
        initial_state=start.state,
        initial_held=start.held,
        settings=RunSettings(duration=duration, step=1e-4, record_period=record_period),
    )


def outputs_of(sampled: SampledForceLoop, recording: Recording) -> dict[str, np.ndarray]:
    return sampled.loop.system.outputs.split(np.asarray(recording.outputs))


def plain_loop(inputs: PiecewisePolynomial, *, count, period, delay, decimation, resolution):
    """Forces and acting torques at sampling instants, from a queue, a counter and DOP853."""
    dynamics, step = dynamics_of(ROBOT), robot_step(ROBOT, period=period)
    robot, inertia = dynamics.description, inertial_parameters(dynamics.description)

    def contact(q, t):
        tip = dynamics.task_position(q).full().ravel()[:2]
        return STIFFNESS * (tip - inputs(t)[:2, 0])

    def rate(t, x, torque):
        q, qd = x[:2], x[2:]
        J = dynamics.task_jacobian(q).full()[:2]
        effort = torque - J.T @ contact(q, t)
        return np.concatenate(
            [qd, dynamics.forward_dynamics(q, qd, effort, inertia).full().ravel()]
        )

    x = np.concatenate([robot.home, np.zeros(2)])
    memory = step.resting_state([1.0, 1.0])
    _, rest, _ = step.step(memory, robot.home, np.zeros(2), [1, 1], [1, 1], step.parameter_values)
    queue = deque([rest.full().ravel()] * delay)
    forces, torques, reading = [], [], None
    for sample in range(count):
        t = sample * period
        force = contact(x[:2], t)
        if sample % decimation == 0:
            reading = force + inputs(t)[4:, 0]
            if resolution is not None:
                reading = resolution * np.floor(reading / resolution + 0.5)
        memory, torque, _ = step.step(
            memory, x[:2], x[2:], reading, inputs(t)[2:4, 0], step.parameter_values
        )
        queue.append(torque.full().ravel())
        acting = queue.popleft()
        forces.append(force)
        torques.append(acting)
        # The reference may jump inside the period, but only the controller sees it.
        x = solve_ivp(
            rate, (t, t + period), x, method="DOP853", rtol=1e-11, atol=1e-13, args=(acting,)
        ).y[:, -1]
    return np.array(forces), np.array(torques)


@pytest.mark.parametrize(
    ("delay", "decimation", "resolution"), [(0, 1, None), (1, 1, None), (2, 3, 5e-3)]
)
def test_agrees_with_a_plain_loop(delay, decimation, resolution):
    count, period = 60, 1e-3
    noise = gaussian_noise(deviation=[2e-3, 2e-3], period=period, duration=0.06, seed=4)
    inputs = stack(motion_and_reference(0.06), noise)
    quantiser = FineReading() if resolution is None else UniformQuantiser(resolution=resolution)
    sampled = sampled_loop(
        delay=delay, sensor=ForceSensor(decimation=decimation, quantiser=quantiser)
    )
    recorded = outputs_of(sampled, record(sampled, inputs, duration=0.06))
    forces, torques = plain_loop(
        inputs,
        count=count,
        period=period,
        delay=delay,
        decimation=decimation,
        resolution=resolution,
    )
    # RK4 at 0.1 ms is wrong by about 1e-10 N here; torques follow by a factor of 1e3.
    np.testing.assert_allclose(recorded["force"], forces, atol=1e-8)
    np.testing.assert_allclose(recorded["effort"], torques, atol=1e-5)


def test_converges_to_the_continuous_loop():
    """The hold costs a delay of half a period, so the difference is of first order."""
    end = 0.4
    inputs = motion_and_reference(end, amplitude=3e-3)
    loop = build_force_loop(
        dynamics_of(ROBOT), linearisation_of(ROBOT), [controller_of(Continuous())] * 2,
        contact=LinearSpring(STIFFNESS), friction=Frictionless(),
    )  # fmt: skip
    start = resting_state(
        loop, posture=loop.dynamics.description.home, force=[1.0, 1.0], condition_limit=100.0
    )
    continuous = run(
        build_engine(loop.system, RK4, input_powers=inputs.degree + 1),
        loop.system,
        inputs=inputs,
        parameters=loop.parameter_values,
        initial_state=start,
        settings=RunSettings(duration=end, step=5e-5, record_period=1e-3),
    )
    force = loop.system.outputs.split(np.asarray(continuous.outputs))["force"]
    differences = []
    quiet = stack(inputs, no_noise(axes=2, duration=end))
    for period in (5e-4, 2.5e-4, 1.25e-4):
        sampled = sampled_loop(period=period)
        recorded = outputs_of(sampled, record(sampled, quiet, duration=end))
        differences.append(np.max(np.abs(recorded["force"] - force)))
    ratios = np.array(differences[:-1]) / np.array(differences[1:])
    # First order halves the difference; second-order terms and the jump's instant disturb it.
    assert np.all((ratios > 1.6) & (ratios < 2.6)), (differences, ratios)


@pytest.mark.parametrize("delay", [0, 2])
def test_stays_at_rest_on_a_still_heart(delay):
    dynamics = dynamics_of(ROBOT)
    tip = dynamics.task_position(dynamics.description.home).full().ravel()[:2]
    still = PiecewisePolynomial(
        breakpoints=np.array([0.0, 0.2]),
        coefficients=np.concatenate([tip - 1.0 / STIFFNESS, [1.0, 1.0, 0.0, 0.0]])[:, None, None],
    )
    sampled = sampled_loop(delay=delay)
    recorded = outputs_of(sampled, record(sampled, still, duration=0.2))
    # Rounding of the tip's position, 1e-16 m, times the gains of the loop.
    np.testing.assert_allclose(recorded["force"], 1.0, atol=1e-9)


def test_slow_sensor_holds_its_reading():
    noise = gaussian_noise(deviation=[0.01, 0.01], period=1e-3, duration=0.05, seed=1)
    sampled = sampled_loop(
        sensor=ForceSensor(decimation=4, quantiser=UniformQuantiser(resolution=0.01))
    )
    recording = record(sampled, stack(motion_and_reference(0.05), noise), duration=0.05)
    outputs = outputs_of(sampled, recording)
    reading, force = outputs["measured_force"], outputs["force"]
    taken = np.arange(50) % 4 == 0
    held = np.repeat(reading[taken], 4, axis=0)[:50]
    np.testing.assert_array_equal(reading, held)
    steps = reading / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    middle = recording.time[taken] + 5e-4  # inside the interval the noise is constant on
    heard = force[taken] + noise(middle).T
    # Reading the nearest multiple is off by half a step at most; rounding decides ties.
    assert np.max(np.abs(reading[taken] - heard)) <= 0.005 + 1e-12


def test_both_engines_agree():
    inputs = stack(motion_and_reference(0.04), no_noise(axes=2, duration=0.04))
    sampled = sampled_loop(delay=1)
    compiled = record(sampled, inputs, duration=0.04)
    interpreter = InterpretedEngine(sampled.loop.system, RK4, input_powers=inputs.degree + 1)
    interpreted = record(sampled, inputs, duration=0.04, engine=interpreter)
    # The plant's sines may come from two libraries; commands are 1e3 times the force.
    np.testing.assert_allclose(compiled.outputs, interpreted.outputs, rtol=1e-7, atol=1e-8)


def test_trajectory_names_what_sampling_adds():
    inputs = stack(motion_and_reference(0.04), no_noise(axes=2, duration=0.04))
    sampled = sampled_loop()
    trajectory = sampled_trajectory(
        sampled, record(sampled, inputs, duration=0.04), engine="some engine"
    )
    assert trajectory.signals["measured_force"].unit == "N"
    np.testing.assert_allclose(trajectory["measured_force"], trajectory["force"], atol=1e-12)
    np.testing.assert_array_equal(trajectory["applied_command"], trajectory["command"])
    assert trajectory["adapted_gains"].shape == (40, 12)


def test_noise_is_a_function_of_its_seed():
    drawn = [
        gaussian_noise(deviation=[0.01, 0.0], period=1e-3, duration=2.0, seed=seed).coefficients
        for seed in (7, 7, 8)
    ]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert np.any(drawn[0] != drawn[2])
    assert np.all(drawn[0][1] == 0.0)
    # 2000 samples: the deviation's own standard error is 1.6 %, five of them allowed.
    assert np.std(drawn[0][0]) == pytest.approx(0.01, rel=0.08)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ComputationalDelay(-1), "whole number of samples"),
        (lambda: ComputationalDelay(0.5), "whole number of samples"),
        (lambda: ForceSensor(decimation=0, quantiser=FineReading()), "decimation"),
        (lambda: UniformQuantiser(resolution=0.0), "resolution"),
        (lambda: gaussian_noise(deviation=-1.0, period=1e-3, duration=1.0, seed=1), "deviation"),
        (lambda: gaussian_noise(deviation=1.0, period=0.0, duration=1.0, seed=1), "period"),
        (
            lambda: build_sampled_loop(
                dynamics_of("d2m2_set_a"), robot_step(ROBOT),
                contact=LinearSpring(STIFFNESS), friction=Frictionless(),
                delay=ComputationalDelay(0), sensor=PERFECT_SENSOR, joints=ExactJoints(),
            ),
            "other joints or force axes",
        ),
    ],
)  # fmt: skip
def test_bad_choices_are_named(make, words):
    with pytest.raises(ParameterError, match=words):
        make()
