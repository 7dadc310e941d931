"""The whole robot controller against its parts and against the robot it drives."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mrac_design.controller.linearisation import RobotModelError
from mrac_design.controller.robot_step import RobotStep, build_robot_step
from mrac_design.errors import ParameterError
from mrac_design.robot import inertial_parameters
from mrac_design.time_domain import Continuous, Discrete
from tests.robot_steps import (
    VELOCITY_GAIN,
    controller_of,
    dynamics_of,
    linearisation_of,
    robot_step,
)

CALM = 1e-3
ROBOTS = ("planar_2r", "d2m2_set_a", "d2m2_set_b")


class Situation:
    """A controller in the middle of its work: `violence` 1 saturates, `CALM` does not."""

    def __init__(self, step: RobotStep, seed: int, *, violence: float) -> None:
        random = np.random.default_rng(seed)
        n, k = step.robot.joint_count, len(step.robot.force_axes)
        self.q = step.robot.home + 0.1 * violence * random.normal(size=n)
        self.qd = 0.2 * violence * random.normal(size=n)
        self.force = 1.0 + 5.0 * violence * random.normal(size=k)
        self.reference = 1.0 + 0.01 * violence * random.normal(size=k)
        rest = step.resting_state(np.ones(k))
        self.state = rest * (1.0 + 0.01 * violence * random.normal(size=rest.size))
        self.next_state, self.torque, signals = (
            part.full().ravel()
            for part in step.step(
                self.state, self.q, self.qd, self.force, self.reference, step.parameter_values
            )
        )
        self.signals = step.signals.split(signals)


def axis_parts(step: RobotStep, vector: np.ndarray) -> list[np.ndarray]:
    sizes = [controller.state.size for controller in step.controllers]
    return np.split(vector, np.cumsum(sizes)[:-1])


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("violence", [CALM, 1.0])
def test_is_the_sum_of_its_parts(robot, violence):
    step, linearisation = robot_step(robot), linearisation_of(robot)
    now = Situation(step, 5, violence=violence)
    controller = step.controllers[0]
    p = controller.parameter_values
    axes = list(zip(axis_parts(step, now.state), now.force, now.reference, strict=True))
    command = np.array([float(controller.command(*axis, p)) for axis in axes])
    wanted, held = (
        linearisation.torque(now.q, now.qd, now.force, u, linearisation.parameter_values)
        .full()
        .ravel()
        for u in (command, np.zeros_like(command))
    )
    limit, commanded = step.robot.effort_limits, wanted - held
    outward = (np.abs(wanted) > limit) & (np.sign(wanted) == np.sign(commanded))
    excess = np.abs(wanted) - limit
    cut = min(1.0, max((excess / np.abs(commanded))[outward], default=0.0))
    expected = np.clip(wanted - cut * commanded, -limit, limit)
    # Sines differ in their last bits, and commands of 1e3 m/s² cancel against the rest.
    np.testing.assert_allclose(now.torque, expected, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(now.signals["command"], command, rtol=1e-13)
    applied = now.signals["applied_command"]
    following = [
        controller.advance(*axis, value, p)[0].full().ravel()
        for axis, value in zip(axes, applied, strict=True)
    ]
    np.testing.assert_allclose(now.next_state, np.concatenate(following), rtol=1e-13, atol=1e-15)
    saturated = bool(np.any(np.abs(wanted) > limit))
    assert saturated == (violence == 1.0), "the two cases are meant to differ in this"


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_robot_that_can_hold_itself_keeps_the_direction_of_the_command(robot):
    step, linearisation = robot_step(robot), linearisation_of(robot)
    found = 0
    for seed in range(20):
        now = Situation(step, seed, violence=0.1)
        command = now.signals["command"]
        held = linearisation.torque(
            now.q, now.qd, now.force, np.zeros_like(command), linearisation.parameter_values
        )
        able = bool(np.all(np.abs(held.full().ravel()) < step.robot.effort_limits))
        limited = bool(np.any(np.abs(now.torque) >= step.robot.effort_limits * (1 - 1e-12)))
        if able and limited:
            found += 1
            share = now.signals["applied_command"] / command
            # One number for all axes, to the rounding of an inverted mass matrix.
            np.testing.assert_allclose(share, share.mean(), rtol=1e-7)
            assert 0.0 <= share.mean() < 1.0
    assert found, "the situations are meant to saturate"


@given(seed=st.integers(0, 2**32 - 1), robot=st.sampled_from(ROBOTS))
@settings(max_examples=60, deadline=None)
def test_unsaturated_command_is_applied_bit_for_bit(seed, robot):
    step = robot_step(robot)
    now = Situation(step, seed, violence=CALM)
    assume(bool(np.all(np.abs(now.torque) < step.robot.effort_limits)))
    np.testing.assert_array_equal(now.signals["applied_command"], now.signals["command"])


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("seed", range(5))
def test_applied_command_is_what_the_robot_does(robot, seed):
    """The true robot under the limited torque accelerates as the applied command says [Z 3]."""
    step, dynamics = robot_step(robot), dynamics_of(robot)
    now = Situation(step, seed, violence=1.0)
    k = len(now.force)
    assert np.any(np.abs(now.torque) == step.robot.effort_limits), "nothing saturates"
    J = dynamics.task_jacobian(now.q).full()
    qdd = dynamics.forward_dynamics(
        now.q, now.qd, now.torque - J[:k].T @ now.force, inertial_parameters(step.robot)
    )
    bias = dynamics.task_bias_acceleration(now.q, now.qd).full().ravel()
    acceleration = (J @ qdd.full().ravel() + bias)[:k]
    wanted = now.signals["applied_command"] - VELOCITY_GAIN * (J @ now.qd)[:k]
    # Accelerations of 1e3 m/s² through an inverted Jacobian of condition number up to 20.
    np.testing.assert_allclose(acceleration, wanted, rtol=1e-9, atol=1e-7)
    assert np.max(np.abs(wanted - now.signals["command"])) > 1.0


def test_model_error_enters_the_feedback_as_it_enters_the_torque():
    error = RobotModelError(body_scale=1.05, first_joint_scale=1.25)
    step, dynamics = robot_step("d2m2_set_a", model_error=error), dynamics_of("d2m2_set_a")
    linearisation = linearisation_of("d2m2_set_a", error)
    now = Situation(step, 3, violence=1.0)
    model = linearisation.parameters.split(np.array(linearisation.parameter_values))
    mass = np.diag(model["torque_scale"]) @ dynamics.mass_matrix(now.q, model["inertia"]).full()
    wanted = (
        linearisation.torque(
            now.q, now.qd, now.force, now.signals["command"], linearisation.parameter_values
        )
        .full()
        .ravel()
    )
    lost = np.linalg.solve(mass, now.torque - wanted)
    J = dynamics.task_jacobian(now.q).full()[:3]
    np.testing.assert_allclose(
        now.signals["applied_command"] - now.signals["command"], J @ lost, rtol=1e-9
    )


def test_stays_at_rest():
    step = robot_step("d2m2_set_a")
    state = step.resting_state([1.0, 0.5, 2.0])
    following, torque, _ = step.step(
        state, step.robot.home, np.zeros(5), [1.0, 0.5, 2.0], [1.0, 0.5, 2.0], step.parameter_values
    )
    # One step of the filters from their fixed point: rounding only.
    np.testing.assert_allclose(following.full().ravel(), state, rtol=1e-14, atol=1e-15)
    gravity = dynamics_of("d2m2_set_a").gravity_torque(
        step.robot.home, inertial_parameters(step.robot)
    )
    J = dynamics_of("d2m2_set_a").task_jacobian(step.robot.home).full()[:3]
    held = gravity.full().ravel() + J.T @ [1.0, 0.5, 2.0]
    np.testing.assert_allclose(torque.full().ravel(), held, atol=1e-9)


def test_uses_no_function_of_the_c_library_but_floor():
    step = robot_step("d2m2_set_b").step
    operations = {step.instruction_id(k) for k in range(step.n_instructions())}
    assert not operations & {ca.OP_SIN, ca.OP_COS, ca.OP_TAN, ca.OP_POW, ca.OP_EXP, ca.OP_SQRT}


def test_parts_that_do_not_fit_are_refused():
    dynamics, linearisation = dynamics_of("planar_2r"), linearisation_of("planar_2r")
    domain = Discrete(1e-3)
    with pytest.raises(ParameterError, match="one per force axis: X, Y"):
        build_robot_step(dynamics, linearisation, [controller_of(domain)], time_domain=domain)
    with pytest.raises(ParameterError, match=r"sampled every 0\.002 s.*every 0\.001 s"):
        build_robot_step(
            dynamics, linearisation, [controller_of(Discrete(2e-3))] * 2, time_domain=domain
        )
    with pytest.raises(ParameterError, match=r"axis X.*is continuous"):
        build_robot_step(
            dynamics, linearisation, [controller_of(Continuous())] * 2, time_domain=domain
        )
