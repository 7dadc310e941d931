"""The robot at its tool [Z 2], exact cancellation and singular postures."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.errors import ParameterError, SingularPostureError
from mrac_design.robot import (
    build_task_space,
    check_posture,
    condition_number,
    condition_numbers,
    scaled_parameters,
)
from tests.robot.conftest import Case, array, case_of


def regular_states(case: Case, count: int) -> list[tuple[np.ndarray, ...]]:
    """States around home, where the task Jacobian is well conditioned."""
    rng = np.random.default_rng(11)
    n, m = case.description.joint_count, case.description.task.size
    states = []
    while len(states) < count:
        q = case.description.home + rng.uniform(-0.4, 0.4, n)
        if condition_number(case.dynamics, q) < 100:
            states.append((q, rng.uniform(-1, 1, n), rng.uniform(-10, 10, m)))
    return states


def test_task_space_terms_are_those_of_the_definition(case: Case) -> None:
    model, d, p = build_task_space(case.dynamics), case.dynamics, case.parameters
    for q, qd, _ in regular_states(case, 20):
        J = array(d.task_jacobian(q))
        inverse = np.linalg.inv(J)
        Mx = inverse.T @ array(d.mass_matrix(q, p)) @ inverse
        bias = Mx @ array(d.task_bias_acceleration(q, qd))
        Vx = inverse.T @ array(d.velocity_torque(q, qd, p)) - bias
        Gx = inverse.T @ array(d.gravity_torque(q, p))
        # Rounding times the condition number of J, below 100, squared in Mx.
        for value, expected in ((model.Mx(q, p), Mx), (model.Gx(q, p), Gx)):
            np.testing.assert_allclose(array(value), expected, atol=1e-10 * np.abs(expected).max())
        scale = np.abs(Vx).max() + np.abs(bias).max()
        np.testing.assert_allclose(array(model.Vx(q, qd, p)), Vx, atol=1e-10 * scale)


def test_task_space_equation_is_the_joint_space_one(case: Case) -> None:
    """Mx Ẍ + Vx + Gx = J⁻ᵀ Γ for the motion Γ causes."""
    model, d, p = build_task_space(case.dynamics), case.dynamics, case.parameters
    rng = np.random.default_rng(2)
    for q, qd, _ in regular_states(case, 10):
        torque = rng.uniform(-5, 5, len(q))
        J = array(d.task_jacobian(q))
        qdd = array(d.forward_dynamics(q, qd, torque, p))
        acceleration = J @ qdd + array(d.task_bias_acceleration(q, qd))
        left = array(model.Mx(q, p)) @ acceleration
        left += array(model.Vx(q, qd, p)) + array(model.Gx(q, p))
        right = np.linalg.solve(J.T, torque)
        size = np.abs(array(model.Mx(q, p))).max() * np.abs(acceleration).max()
        np.testing.assert_allclose(left, right, atol=1e-11 * size)


def test_true_model_cancels_exactly(case: Case) -> None:
    """Inverse dynamics at q̈ = J⁻¹(f* − J̇q̇) makes the tool accelerate with f*."""
    d, p = case.dynamics, case.parameters
    for q, qd, wanted in regular_states(case, 100):
        qdd = d.joint_acceleration(q, qd, wanted)
        torque = d.inverse_dynamics(q, qd, qdd, p)
        found = array(d.forward_dynamics(q, qd, torque, p))
        acceleration = array(d.task_jacobian(q)) @ found + array(d.task_bias_acceleration(q, qd))
        assert np.abs(acceleration - wanted).max() <= 1e-9


def test_wrong_model_does_not_cancel() -> None:
    case = case_of("d2m2_set_a")
    d, p = case.dynamics, case.parameters
    wrong = scaled_parameters(case.description, 1.05)
    q, qd, wanted = regular_states(case, 1)[0]
    torque = d.inverse_dynamics(q, qd, d.joint_acceleration(q, qd, wanted), wrong)
    found = array(d.forward_dynamics(q, qd, torque, p))
    acceleration = array(d.task_jacobian(q)) @ found + array(d.task_bias_acceleration(q, qd))
    # All of M, V and G are 5 % too large, so M(q̈ − q̈*) = 0.05 (M q̈* + V + G): vertical 5 % of g.
    assert 0.2 < np.abs(acceleration - wanted).max() < 5


def test_joint_acceleration_inverts_the_task_jacobian_near_singular_postures(case: Case) -> None:
    """Backward stable: the residual stays at rounding while the condition number grows."""
    d, n = case.dynamics, case.description.joint_count
    rng = np.random.default_rng(4)
    for q, qd, _, _ in case.states(200):
        qdd = rng.normal(size=n)
        J, bias = array(d.task_jacobian(q)), array(d.task_bias_acceleration(q, qd))
        found = array(d.joint_acceleration(q, qd, J @ qdd + bias))
        error = np.abs(found - qdd).max() / (np.abs(qdd).max() + np.abs(bias).max())
        assert error <= 1e-14 * condition_number(d, q)


def test_condition_number_at_home() -> None:
    case = case_of("d2m2_set_a")
    assert condition_number(case.dynamics, case.description.home) == pytest.approx(6.7, abs=0.05)


def test_condition_numbers_agree_with_numpy(case: Case) -> None:
    postures = np.array([q for q, *_ in case.states(30)])
    found = condition_numbers(case.dynamics, postures)
    expected = [np.linalg.cond(array(case.dynamics.task_jacobian(q))) for q in postures]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert condition_numbers(case.dynamics, postures[:0]).shape == (0,)


def test_singular_posture_is_refused_with_its_number() -> None:
    case = case_of("d2m2_set_a")
    home = case.description.home
    assert check_posture(case.dynamics, home, 50.0) == condition_number(case.dynamics, home)
    stretched = home.copy()
    stretched[2] = 0.0  # arm straight
    with pytest.raises(SingularPostureError, match="condition number inf"):
        check_posture(case.dynamics, stretched, 50.0)
    stretched[2] = 1e-3
    with pytest.raises(SingularPostureError) as caught:
        check_posture(case.dynamics, stretched, 50.0)
    assert 50 < caught.value.condition_number < 1e5
    folded = home.copy()
    folded[3] = 0.0  # tool level: two components no longer describe its direction
    with pytest.raises(SingularPostureError):
        check_posture(case.dynamics, folded, 50.0)


@pytest.mark.parametrize("q", [[0.0, 1.0], [[0.0] * 5] * 2, [0.0, 0.0, np.nan, 0.0, 0.0]])
def test_a_posture_of_wrong_size_or_not_finite_is_refused(q: list[float]) -> None:
    with pytest.raises(ParameterError, match="posture"):
        condition_number(case_of("d2m2_set_a").dynamics, q)
