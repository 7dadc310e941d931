"""The sampled loop with every effect at once against a plain loop around SciPy."""

from __future__ import annotations

import warnings
from collections import deque

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.motion import StepSequence
from mrac_design.motion.signal import PiecewisePolynomial, quintic_hermite, stack
from mrac_design.robot import friction_parameters, inertial_parameters
from mrac_design.simulation.contact import (
    LinearSpring,
    OneSided,
    ScheduledTissue,
    WithDamper,
)
from mrac_design.simulation.encoder import Encoder
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.friction import SmoothFriction
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.sampled_loop import (
    ComputationalDelay,
    build_sampled_loop,
    resting_start,
)
from mrac_design.simulation.sensor import (
    FineReading,
    ForceSensor,
    WithFlexibleMode,
    gaussian_noise,
)
from mrac_design.simulation.tableau import RK4
from tests.robot_steps import STIFFNESS, dynamics_of, robot_step

ROBOT, PERIOD, COUNT = "planar_2r", 1e-3, 40
DAMPING, FACTOR = 0.5, StepSequence(times=(0.0, 0.02), levels=(1.0, 1.2))
COUNTS, CUTOFF, WIDTH, MODE, RINGING = 2.0**18, 2000.0, 0.05, 400.0, 0.3


def heart_and_reference() -> tuple[PiecewisePolynomial, PiecewisePolynomial]:
    end = PERIOD * COUNT
    t, w = np.linspace(0.0, end, 13), 2 * np.pi * 1.2
    heart = quintic_hermite(
        t,
        np.tile(3e-3 * np.sin(w * t), (2, 1)),
        np.tile(3e-3 * w * np.cos(w * t), (2, 1)),
        np.tile(-3e-3 * w**2 * np.sin(w * t), (2, 1)),
    )
    dynamics = dynamics_of(ROBOT)
    tip = dynamics.task_position(dynamics.description.home).full().ravel()[:2]
    reference = PiecewisePolynomial(
        breakpoints=np.array([0.0, end]), coefficients=np.ones((2, 1, 1))
    )
    return heart.shifted(tip - 1.0 / STIFFNESS), reference


def plain_loop(heart: PiecewisePolynomial, noise: PiecewisePolynomial, *, delay: int):
    """Forces and acting efforts at the samples: queues, a counter, tanh and DOP853."""
    dynamics, step = dynamics_of(ROBOT), robot_step(ROBOT, period=PERIOD)
    robot, inertia = dynamics.description, inertial_parameters(dynamics.description)
    coulomb, viscous = np.split(friction_parameters(robot), 2)
    resolution = 2 * np.pi / COUNTS * robot.transmission
    share = 1 - np.exp(-CUTOFF * PERIOD)
    heart_rate = heart.derivative()

    def contact(q, qd, t, factor):
        J = dynamics.task_jacobian(q).full()[:2]
        depth = dynamics.task_position(q).full().ravel()[:2] - heart(t)[:, 0]
        force = factor * (STIFFNESS * depth + DAMPING * (J @ qd - heart_rate(t)[:, 0]))
        return np.where(depth > 0, np.maximum(force, 0), 0), J

    def rate(t, x, torque, factor):
        q, qd, felt, felt_rate = x[:2], x[2:4], x[4:6], x[6:]
        force, J = contact(q, qd, t, factor)
        friction = coulomb * np.tanh(qd / WIDTH) + viscous * qd
        effort = torque - friction - J.T @ force
        qdd = dynamics.forward_dynamics(q, qd, effort, inertia).full().ravel()
        w = 2 * np.pi * MODE
        return np.concatenate(
            [qd, qdd, felt_rate, w**2 * (force - felt) - 2 * RINGING * w * felt_rate]
        )

    x = np.concatenate([robot.home, np.zeros(2), np.ones(2), np.zeros(2)])
    memory = step.resting_state([1.0, 1.0])
    _, rest, _ = step.step(memory, robot.home, np.zeros(2), [1, 1], [1, 1], step.parameter_values)
    queue = deque([rest.full().ravel()] * delay)
    counted, speed = resolution * np.floor(robot.home / resolution + 0.5), np.zeros(2)
    forces, torques = [], []
    for sample in range(COUNT):
        t = sample * PERIOD
        factor = FACTOR.levels[sum(t >= start - 1e-9 for start in FACTOR.times) - 1]
        forces.append(contact(x[:2], x[2:4], t, factor)[0])
        before, counted = counted, resolution * np.floor(x[:2] / resolution + 0.5)
        speed = speed + share * ((counted - before) / PERIOD - speed)
        memory, torque, _ = step.step(
            memory, counted, speed, x[4:6] + noise(t)[:, 0], [1, 1], step.parameter_values
        )
        queue.append(torque.full().ravel())
        torques.append(queue.popleft())
        x = solve_ivp(
            rate, (t, t + PERIOD), x, method="DOP853", rtol=1e-10, atol=1e-12,
            args=(torques[-1], factor),
        ).y[:, -1]  # fmt: skip
    return np.array(forces), np.array(torques)


@pytest.mark.parametrize("delay", [0, 1])
def test_every_effect_agrees_with_a_plain_loop(delay):
    heart, reference = heart_and_reference()
    end = PERIOD * COUNT
    noise = gaussian_noise(deviation=[5e-3] * 2, period=PERIOD, duration=end, seed=9).shifted(0.02)
    tissue = WithDamper(tissue=LinearSpring(STIFFNESS), damping=DAMPING)
    contact = OneSided(tissue=ScheduledTissue(tissue=tissue, factor=FACTOR))
    plain = ForceSensor(decimation=1, quantiser=FineReading())
    sampled = build_sampled_loop(
        dynamics_of(ROBOT),
        robot_step(ROBOT, period=PERIOD),
        contact=contact,
        friction=SmoothFriction(scale=1.0, slide_width=1.0, turn_width=WIDTH),
        delay=ComputationalDelay(delay),
        sensor=WithFlexibleMode(sensor=plain, frequency=MODE, damping=RINGING),
        joints=Encoder(counts_per_turn=COUNTS, velocity_cutoff=CUTOFF),
    )
    start = resting_start(
        sampled, posture=dynamics_of(ROBOT).description.home, force=[1.0, 1.0], condition_limit=100
    )
    system = sampled.loop.system
    inputs = stack(heart, reference, noise, *contact.exogenous(heart))
    recording = run(
        build_engine(system, RK4, input_powers=inputs.degree + 1),
        system,
        inputs=inputs,
        parameters=sampled.loop.parameter_values,
        initial_state=start.state,
        initial_held=start.held,
        settings=RunSettings(duration=end, step=2e-5, record_period=PERIOD),
    )
    outputs = system.outputs.split(np.asarray(recording.outputs))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        forces, torques = plain_loop(heart, noise, delay=delay)
    assert forces.min() > 0.1  # contact is kept: its kinks have their own test
    # RK4 at 20 µs is wrong by 1e-8 of the friction's and the mode's swing; efforts follow ×1e3.
    np.testing.assert_allclose(outputs["force"], forces, atol=1e-6)
    np.testing.assert_allclose(outputs["effort"], torques, atol=1e-3)
