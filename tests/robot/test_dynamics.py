"""Rigid-body terms against Pinocchio and closed forms, and the laws they must obey."""

from __future__ import annotations

import tomllib
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.resources import models_directory
from mrac_design.robot import build_dynamics, inertial_parameters, load_robot
from tests.oracles.rigid_body_pinocchio import PinocchioRobot
from tests.oracles.rigid_body_two_link import TwoRods
from tests.robot.conftest import ROBOTS, Case, array, case_of

# Two correct programs differ by rounding, some hundred operations deep; forward dynamics by
# rounding times the condition number of M, below 1e5 here.
ORACLE = 1e-10


def assert_close(value: np.ndarray, expected: np.ndarray, tolerance: float = ORACLE) -> None:
    assert value.shape == expected.shape
    assert np.abs(value - expected).max() <= tolerance * max(np.abs(expected).max(), 1e-3)


def compare_with_pinocchio(case: Case, oracle: PinocchioRobot, count: int) -> None:
    d, p, task = case.dynamics, case.parameters, case.description.task
    positions, axes = list(task.position), list(task.tool_axis)
    for q, qd, qdd, torque in case.states(count):
        tip, axis, J = oracle.tip_position(q), oracle.tool_axis(q), oracle.jacobian(q)
        bias_tip, bias_axis = oracle.bias_accelerations(q, qd)
        rest = np.zeros_like(q)
        rotation, found_tip, found_axis = (array(value) for value in d.forward_kinematics(q))
        assert_close(rotation @ rotation.T, np.eye(3))
        assert_close(found_tip, tip)
        assert_close(found_axis, axis)
        assert_close(array(d.task_position(q)), np.hstack((tip[positions], axis[axes])))
        assert_close(array(d.jacobian(q)), J)
        turning = np.cross(J[3:], axis, axis=0)
        task_jacobian = np.vstack((J[positions], turning[axes]))
        assert_close(array(d.task_jacobian(q)), task_jacobian)
        task_bias = np.hstack((bias_tip[positions], bias_axis[axes]))
        assert_close(array(d.task_bias_acceleration(q, qd)), task_bias)
        matrix = oracle.mass_matrix(q)
        bias, gravity = oracle.inverse_dynamics(q, qd, rest), oracle.gravity_torque(q)
        qdd_free = oracle.forward_dynamics(q, qd, torque)
        assert_close(array(d.mass_matrix(q, p)), matrix)
        assert_close(array(d.bias_torque(q, qd, p)), bias)
        assert_close(array(d.gravity_torque(q, p)), gravity)
        assert_close(array(d.velocity_torque(q, qd, p)) + gravity, bias)
        assert_close(array(d.coriolis_matrix(q, qd, p)) @ qd + gravity, bias)
        assert_close(array(d.inverse_dynamics(q, qd, qdd, p)), oracle.inverse_dynamics(q, qd, qdd))
        assert_close(array(d.forward_dynamics(q, qd, torque, p)), qdd_free)
        together = d.rigid_body_terms(q, qd, torque, p)
        for value, expected in zip(
            together, (matrix, bias, task_jacobian, task_bias, qdd_free), strict=True
        ):
            assert_close(array(value), expected)
        energies = [float(value) for value in d.energy(q, qd, p)]
        assert_close(np.array(energies), np.array(oracle.energies(q, qd)))


@pytest.mark.parametrize("name", ROBOTS)
def test_packaged_robots_agree_with_pinocchio_over_100_postures(name: str) -> None:
    file = tomllib.loads((models_directory() / "robots" / f"{name}.toml").read_text("utf-8"))
    compare_with_pinocchio(case_of(name), PinocchioRobot(file), 100)


def random_file(kinds: list[str], seed: int) -> dict[str, object]:
    """A robot nobody would build: skew axes, offsets, off-axis tool, dense inertias."""
    rng = np.random.default_rng(seed)
    file = tomllib.loads((models_directory() / "robots" / "d2m2_set_a.toml").read_text("utf-8"))
    joints = []
    for number, kind in enumerate(kinds):
        spread = rng.normal(size=(3, 3)) * 0.1
        second_moments = spread @ spread.T
        joints.append(
            {
                "name": f"joint {number}",
                "type": kind,
                "alpha": float(rng.choice([0.0, np.pi / 2, -np.pi / 2, np.pi, 0.7, -2.1])),
                "d": float(rng.choice([0.0, 0.3, -0.2])),
                "theta": float(rng.choice([0.0, np.pi / 2, 0.4])),
                "r": float(rng.choice([0.0, 0.25])),
                "home": 0.1,
                "drive_inertia": float(rng.choice([0.0, 0.05])),
                "coulomb_friction": 0.0,
                "viscous_friction": 0.0,
                "effort_limit": 10.0,
                "transmission": 1.0,
                "body": {
                    "name": f"body {number}",
                    "mass": float(rng.uniform(0.5, 5)),
                    "centre_of_mass": rng.normal(size=3).tolist(),
                    "inertia": (np.trace(second_moments) * np.eye(3) - second_moments).tolist(),
                },
            }
        )
    axis = rng.normal(size=3)
    return file | {
        "gravity": rng.normal(size=3).tolist(),
        "tool": {
            "tip": rng.normal(size=3).tolist(),
            "axis": (axis / np.linalg.norm(axis)).tolist(),
        },
        "task": {"position": ["X", "Y", "Z"], "tool_axis": ["Z", "X"][: len(kinds) - 3]},
        "joint": joints,
    }


@settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    kinds=st.lists(st.sampled_from(["revolute", "prismatic"]), min_size=3, max_size=5).filter(
        lambda kinds: kinds.count("revolute") >= len(kinds) - 3
    ),
    seed=st.integers(0, 10_000),
)
def test_any_robot_agrees_with_pinocchio(tmp_path: Path, kinds: list[str], seed: int) -> None:
    file = random_file(kinds, seed)
    path = tmp_path / "random.toml"
    path.write_bytes(tomli_w.dumps(file).encode())
    description = load_robot(path)
    try:
        dynamics = build_dynamics(description)
    except ParameterError:  # parallel axes: nothing moves one of the components
        reject()
    case = Case("random", description, dynamics, inertial_parameters(description))
    compare_with_pinocchio(case, PinocchioRobot(file), 3)


def test_planar_arm_agrees_with_its_closed_form() -> None:
    case = case_of("planar_2r")
    oracle = TwoRods(masses=(6.0, 3.0), lengths=(0.35, 0.30), drives=(0.02, 0.01), gravity=9.81)
    d, p = case.dynamics, case.parameters
    for q, qd, _, torque in case.states(50):
        matrix, V, G = (
            oracle.mass_matrix(q),
            oracle.coriolis_torque(q, qd),
            oracle.gravity_torque(q),
        )
        assert_close(array(d.mass_matrix(q, p)), matrix)
        assert_close(array(d.velocity_torque(q, qd, p)), V)
        assert_close(array(d.gravity_torque(q, p)), G)
        assert_close(array(d.task_jacobian(q)), oracle.jacobian(q))
        assert_close(array(d.task_bias_acceleration(q, qd)), oracle.bias_acceleration(q, qd))
        expected = np.linalg.solve(matrix, torque - V - G)
        assert_close(array(d.forward_dynamics(q, qd, torque, p)), expected)


def rate(function: ca.Function, q: ca.SX, qd: ca.SX, *rest: ca.SX) -> ca.SX:
    """Time derivative of a function of q along qd, by automatic differentiation."""
    value = function(q, *rest)
    return ca.reshape(ca.jtimes(ca.vec(value), q, qd), value.shape)


def symbols(case: Case) -> tuple[ca.SX, ca.SX, ca.SX]:
    n = case.description.joint_count
    return ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("p", len(case.parameters))


def test_jacobian_and_bias_are_derivatives_of_the_task_position(case: Case) -> None:
    q, qd, _ = symbols(case)
    d = case.dynamics
    function = ca.Function(
        "differentiated",
        [q, qd],
        [ca.jacobian(d.task_position(q), q), rate(d.task_jacobian, q, qd) @ qd],
    )
    for posture, velocity, _, _ in case.states(20):
        jacobian, bias = (array(value) for value in function(posture, velocity))
        assert_close(array(d.task_jacobian(posture)), jacobian, 1e-13)  # rounding
        assert_close(array(d.task_bias_acceleration(posture, velocity)), bias, 1e-13)


def test_coriolis_matrix_makes_mass_rate_minus_2c_skew(case: Case) -> None:
    q, qd, p = symbols(case)
    d = case.dynamics
    matrix = rate(d.mass_matrix, q, qd, p) - 2 * d.coriolis_matrix(q, qd, p)
    function = ca.Function("mass_rate_minus_2c", [q, qd, p], [matrix])
    rng = np.random.default_rng(7)
    for posture, velocity, _, _ in case.states(100):
        N = array(function(posture, velocity, case.parameters))
        C = array(d.coriolis_matrix(posture, velocity, case.parameters))
        scale = np.abs(C).max() + 1e-3
        assert np.abs(N + N.T).max() <= 1e-13 * scale  # rounding
        x = rng.normal(size=len(posture))
        assert abs(x @ N @ x) <= 1e-12 * scale * (x @ x)


def test_power_balance(case: Case) -> None:
    """d/dt (kinetic + potential) = q̇ᵀΓ along the motion that forward dynamics gives."""
    q, qd, p = symbols(case)
    torque = ca.SX.sym("torque", q.size1())
    d = case.dynamics
    energy = sum(d.energy(q, qd, p))
    qdd = d.forward_dynamics(q, qd, torque, p)
    change = ca.jtimes(energy, ca.vertcat(q, qd), ca.vertcat(qd, qdd))
    function = ca.Function("power", [q, qd, torque, p], [change])
    for posture, velocity, _, effort in case.states(50):
        power = velocity @ effort
        found = float(function(posture, velocity, effort, case.parameters))
        # Rounding; the terms that cancel are up to 400 N times 3 m/s.
        assert abs(found - power) <= 1e-10 * (1e3 + abs(power))


def test_mass_matrix_is_symmetric_positive_definite_over_200_postures(case: Case) -> None:
    for q, *_ in case.states(200, seed=3):
        matrix = array(case.dynamics.mass_matrix(q, case.parameters))
        assert np.array_equal(matrix, matrix.T)
        # No motion of unit size has less inertia than the smallest drive gives it.
        smallest = min(joint.drive_inertia for joint in case.description.joints)
        assert np.linalg.eigvalsh(matrix).min() >= smallest * (1 - 1e-9)


def test_dynamics_are_linear_in_the_parameters(case: Case) -> None:
    n, p = case.description.joint_count, case.parameters
    rng = np.random.default_rng(5)
    other = p * rng.uniform(0.5, 1.5, p.shape)
    d = case.dynamics
    q, qd, qdd, _ = next(case.states(1))
    both = array(d.inverse_dynamics(q, qd, qdd, p + 2 * other))
    apart = [array(d.inverse_dynamics(q, qd, qdd, values)) for values in (p, other)]
    assert_close(both, apart[0] + 2 * apart[1], 1e-13)  # rounding
    assert both.shape == (n,)


def test_set_a_at_home() -> None:
    """Figures published with the parameters, to the digits printed."""
    case = case_of("d2m2_set_a")
    d, p, home = case.dynamics, case.parameters, case.description.home
    _, tip, axis = (array(value) for value in d.forward_kinematics(home))
    np.testing.assert_allclose(tip, [0.5365, -0.0282, -0.3], atol=5e-5)
    np.testing.assert_allclose(axis, [0, 0, -1], atol=1e-15)
    diagonal = np.diag(array(d.mass_matrix(home, p)))
    np.testing.assert_allclose(diagonal, [49.6, 2.45, 0.323, 0.0073, 0.0050], rtol=5e-3)
    gravity = array(d.gravity_torque(home, p))
    np.testing.assert_allclose(gravity, [364, 0, 0, 0, 0], atol=0.5)


def test_set_b_at_home() -> None:
    case = case_of("d2m2_set_b")
    gravity = array(case.dynamics.gravity_torque(case.description.home, case.parameters))
    np.testing.assert_allclose(gravity, [0, 27.0, 7.3, 0, 0], atol=0.05)


def test_a_task_the_joints_cannot_serve_is_refused(tmp_path: Path) -> None:
    """The planar arm asked to move along Z, out of its plane."""
    text = (models_directory() / "robots" / "planar_2r.toml").read_text("utf-8")
    path = tmp_path / "robot.toml"
    path.write_text(text.replace('position = ["X", "Y"]', 'position = ["X", "Z"]'), "utf-8")
    with pytest.raises(ParameterError, match="cannot move all of them independently"):
        build_dynamics(load_robot(path))


def test_functions_have_names(case: Case) -> None:
    d = case.dynamics
    assert d.forward_kinematics.name_out() == ["rotation", "tip", "tool_axis"]
    assert d.inverse_dynamics.name_in() == ["q", "qd", "qdd", "parameters"]
    assert d.forward_dynamics.name_in() == ["q", "qd", "torque", "parameters"]
    assert d.task_bias_acceleration.name_out() == ["bias"]


def test_geometry_known_to_vanish_is_not_computed() -> None:
    """α = π/2 in a file has a cosine of 6e-17; it must not reach the expressions."""
    case = case_of("d2m2_set_a")
    terms = case.dynamics.rigid_body_terms
    constants = [
        terms.instruction_constant(k)
        for k in range(terms.n_instructions())
        if terms.instruction_id(k) == ca.OP_CONST
    ]
    assert all(value == 0 or abs(value) > 1e-6 for value in constants)
    jacobian = case.dynamics.task_jacobian(ca.SX.sym("q", 5))
    zeros = {(i, j) for i in range(5) for j in range(5) if jacobian[i, j].is_zero()}
    # The vertical slide moves z alone; the vertical axes 2 and 3 do not move z.
    assert zeros >= {(0, 0), (1, 0), (3, 0), (4, 0), (2, 1), (2, 2)}
