"""The inertia mismatch against the task-space model and against the robot itself."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.assessment.mismatch import inertia_mismatch, posture_grid
from mrac_design.controller.linearisation import RobotModelError, build_linearisation
from mrac_design.errors import ParameterError
from mrac_design.robot import (
    build_dynamics,
    build_task_space,
    inertial_parameters,
    load_robot,
    scaled_parameters,
)


@pytest.fixture(scope="module", params=["d2m2_set_a", "d2m2_set_b"])
def dynamics(request):
    return build_dynamics(load_robot(request.param))


@pytest.fixture(scope="module")
def postures(dynamics):
    return posture_grid(dynamics.description, slide=0.05, turn=0.3, points=2)


def test_a_perfect_model_has_none(dynamics, postures):
    perfect = RobotModelError(body_scale=1.0, first_joint_scale=1.0)
    found = inertia_mismatch(dynamics, perfect, postures, condition_limit=1e3)
    assert found.largest < 1e-9  # rounding, amplified by the Jacobian's condition
    assert found.gravity.max() < 1e-8
    assert found.beyond(1e-6) == 0


def test_agrees_with_the_task_space_model(dynamics, postures):
    """Mx⁻¹ M̂x from the robot's own task-space functions, one posture at a time."""
    task = build_task_space(dynamics)
    robot = dynamics.description
    found = inertia_mismatch(
        dynamics, RobotModelError(body_scale=1.07, first_joint_scale=1.0), postures,
        condition_limit=1e3,
    )  # fmt: skip
    for q, norm in zip(found.postures[::5], found.norms[::5], strict=True):
        Mx = task.Mx(q, inertial_parameters(robot)).full()
        model = task.Mx(q, scaled_parameters(robot, 1.07)).full()
        delta = np.linalg.solve(Mx, model)[:3, :3] - np.eye(3)
        assert norm == pytest.approx(np.linalg.norm(delta, 2), rel=1e-6)


def test_is_what_the_linearised_robot_does(dynamics, postures):
    """A command on one force axis moves all by 1 + Δ: controller torque, forward dynamics."""
    robot = dynamics.description
    error = RobotModelError(body_scale=1.05, first_joint_scale=1.19)
    linearisation = build_linearisation(
        dynamics, velocity_gain=50.0, tool_axis_bandwidth=50.0, model_error=error
    )
    found = inertia_mismatch(dynamics, error, postures, condition_limit=1e3)
    still, p = np.zeros(robot.joint_count), inertial_parameters(robot)
    for q, norm in zip(found.postures[::7], found.norms[::7], strict=True):
        J = dynamics.task_jacobian(q).full()

        def acceleration(command, q=q, J=J):
            torque = linearisation.torque(
                q, still, np.zeros(3), command, linearisation.parameter_values
            )
            return (J @ dynamics.forward_dynamics(q, still, torque, p).full())[:3, 0]

        rest = acceleration(np.zeros(3))
        columns = [acceleration(unit) - rest for unit in np.eye(3)]
        delta = np.stack(columns, axis=1) - np.eye(3)
        assert norm == pytest.approx(np.linalg.norm(delta, 2), rel=1e-6)


def test_gravity_error_is_the_acceleration_at_rest():
    dynamics = build_dynamics(load_robot("d2m2_set_a"))
    error = RobotModelError(body_scale=1.05, first_joint_scale=1.0)
    home = dynamics.description.home
    found = inertia_mismatch(dynamics, error, home, condition_limit=1e3)
    # Weight and moved mass on the vertical joint: 5 % of 364 N over its 49.6 kg.
    assert found.gravity[0] == pytest.approx(0.05 * 364 / 49.6, rel=0.03)


def test_singular_postures_are_left_out():
    dynamics = build_dynamics(load_robot("d2m2_set_a"))
    robot = dynamics.description
    error = RobotModelError(body_scale=1.05, first_joint_scale=1.0)
    grid = posture_grid(robot, slide=0.0, turn=1.2, points=3)  # the elbow's grid meets 0
    found = inertia_mismatch(dynamics, error, grid, condition_limit=100.0)
    assert found.left_out > 0
    assert found.left_out + len(found.norms) == len(grid)
    assert found.worst_posture.shape == (5,)
    with pytest.raises(ParameterError, match="singular"):
        inertia_mismatch(dynamics, error, grid, condition_limit=1.0)
    with pytest.raises(ParameterError, match="posture grid"):
        posture_grid(robot, slide=0.1, turn=0.1, points=1)
