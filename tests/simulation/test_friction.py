"""Joint friction against closed forms and against the energy it takes."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.robot import friction_parameters, inertial_parameters
from mrac_design.simulation.closed_loop import Plant
from mrac_design.simulation.contact import LinearSpring
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.friction import Friction, Frictionless, SmoothFriction
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem
from mrac_design.simulation.tableau import RK4
from tests.robot_steps import dynamics_of

FRICTION = SmoothFriction(scale=1.0, slide_width=1e-2, turn_width=5e-2)


def efforts(friction: SmoothFriction, robot: str, velocity: np.ndarray) -> np.ndarray:
    """Friction efforts as the model has them, evaluated."""
    description = dynamics_of(robot).description
    values = {name: ca.SX(ca.DM(v)) for name, v in friction.values(description).items()}
    zero = ca.SX.zeros(description.joint_count)
    left = friction.remaining(zero, ca.SX(ca.DM(velocity)), values)
    return -np.array(ca.evalf(left)).ravel()


def free_robot(friction: Friction, *, velocity: list[float], duration: float) -> dict:
    """The planar robot swinging freely, without motors and contact."""
    dynamics = dynamics_of("planar_2r")
    robot, n = dynamics.description, 2
    plant = Plant(dynamics=dynamics, contact=LinearSpring(1.0), friction=friction)
    values = {"inertia": inertial_parameters(robot), **friction.values(robot)}
    state, parameters = (
        Layout((("joint_position", n), ("joint_velocity", n))),
        Layout(tuple((name, int(np.size(v))) for name, v in values.items())),
    )
    inputs, held = Layout((("nothing", 1),)), Layout(())
    arguments = [
        layout.symbols(name)
        for layout, name in zip((state, held, inputs, parameters), "xzvp", strict=True)
    ]
    x, p = state.split(arguments[0]), parameters.split(arguments[3])
    q, qd = x["joint_position"], x["joint_velocity"]
    qdd = plant.acceleration(x, ca.SX.zeros(n), ca.SX.zeros(2), p)
    kinetic, potential = dynamics.energy(q, qd, p["inertia"])
    energy = kinetic + potential

    def function(name: str, result: ca.SX) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [name])

    system = HybridSystem(
        state=state, held=held, inputs=inputs, parameters=parameters,
        outputs=Layout((("velocity", n), ("energy", 1))),
        rate=function("rate", ca.vertcat(qd, qdd)),
        output=function("output", ca.vertcat(qd, energy)),
    )  # fmt: skip
    nothing = PiecewisePolynomial(
        breakpoints=np.array([0.0, duration]), coefficients=np.zeros((1, 1, 1))
    )
    recording = run(
        build_engine(system, RK4, input_powers=1),
        system,
        inputs=nothing,
        parameters=parameters.pack(values),
        initial_state=np.concatenate([robot.home, velocity]),
        settings=RunSettings(duration=duration, step=5e-5, record_period=5e-4),
    )
    return {"time": recording.time, **system.outputs.split(np.asarray(recording.outputs))}


def test_the_robot_loses_exactly_what_friction_takes():
    swing = free_robot(FRICTION, velocity=[1.0, -2.0], duration=0.6)
    robot = dynamics_of("planar_2r").description
    coulomb, viscous = np.split(friction_parameters(robot), 2)
    qd = swing["velocity"]
    power = np.sum(qd * (coulomb * np.tanh(qd / 5e-2) + viscous * qd), axis=1)
    assert np.all(power >= 0.0)
    lost = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * 5e-4)])
    energy = swing["energy"][:, 0]
    # The trapezoidal rule at 0.5 ms: where a joint turns round, tanh bends within 10 ms.
    np.testing.assert_allclose(energy[0] - energy, lost, atol=2e-3 * lost[-1])
    assert lost[-1] > 0.05  # J: there was something to lose


def test_without_friction_nothing_is_lost():
    swing = free_robot(Frictionless(), velocity=[1.0, -2.0], duration=0.3)
    energy = swing["energy"][:, 0]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8, atol=1e-8)  # RK4 at 50 µs


@pytest.mark.parametrize("speed", [0.5, -0.5, 0.01])
def test_a_sliding_mass_stops_as_the_closed_form_says(speed):
    """m v' = −Fc tanh(v/w) has sinh(v/w) = sinh(v0/w) exp(−Fc t/(m w))."""
    from scipy.integrate import solve_ivp

    robot = dynamics_of("d2m2_set_a").description
    friction, mass = SmoothFriction(scale=1.0, slide_width=0.1, turn_width=1.0), 50.0
    coulomb = robot.joints[0].coulomb_friction
    viscous = robot.joints[0].viscous_friction

    def slope(t, v):
        velocity = np.zeros(5)
        velocity[0] = v[0]
        return [-(efforts(friction, "d2m2_set_a", velocity)[0] - viscous * v[0]) / mass]

    t = np.linspace(0.0, 1.0, 11)
    run_ = solve_ivp(slope, (0, 1), [speed], t_eval=t, rtol=1e-10, atol=1e-12)
    expected = 0.1 * np.arcsinh(np.sinh(speed / 0.1) * np.exp(-coulomb * t / (mass * 0.1)))
    np.testing.assert_allclose(run_.y[0], expected, rtol=1e-7, atol=1e-10)


def test_efforts_are_the_robot_files_own():
    robot = dynamics_of("d2m2_set_a").description
    velocity = np.array([0.3, -1.0, 2.0, -2.0, 1.5])  # far beyond the smoothing
    coulomb, viscous = np.split(friction_parameters(robot), 2)
    for scale in (1.0, 0.5):
        friction = SmoothFriction(scale=scale, slide_width=1e-3, turn_width=5e-3)
        np.testing.assert_allclose(
            efforts(friction, "d2m2_set_a", velocity),
            scale * (coulomb * np.sign(velocity) + viscous * velocity),
            rtol=1e-12,
        )


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"scale": -1.0}, "scale"), ({"slide_width": 0.0}, "slide"), ({"turn_width": 0.0}, "turn")],
)
def test_bad_choices_are_named(changes, word):
    with pytest.raises(ParameterError, match=word):
        SmoothFriction(**{"scale": 1.0, "slide_width": 1e-3, "turn_width": 1e-3} | changes)
