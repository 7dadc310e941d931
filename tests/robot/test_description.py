"""Bodies that can exist, parameter vectors, and the tables people read."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.robot import (
    Body,
    TaskDefinition,
    friction_parameters,
    inertial_parameters,
    load_robot,
    parameter_names,
    scaled_parameters,
)
from tests.robot.conftest import Case


def body(inertia: np.ndarray) -> Body:
    return Body(name="b", mass=2.0, centre_of_mass=np.zeros(3), inertia=inertia)


@given(seed=st.integers(0, 10**6), size=st.floats(1e-6, 1e6))
def test_every_cloud_of_points_is_a_body(seed: int, size: float) -> None:
    points = np.random.default_rng(seed).normal(size=(4, 3)) * size
    points -= points.mean(axis=0)
    moments = points.T @ points
    assert body(np.trace(moments) * np.eye(3) - moments).mass == 2.0


@given(seed=st.integers(0, 10**6), excess=st.floats(1e-3, 10))
def test_no_body_beyond_the_triangle_inequality(seed: int, excess: float) -> None:
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    inertia = (rotation * [1.0, 2.0, 3.0 * (1 + excess)]) @ rotation.T
    with pytest.raises(ParameterError, match="triangle inequality"):
        body((inertia + inertia.T) / 2)


def test_bodies_at_the_border_are_accepted() -> None:
    body(np.diag([0.0, 1.0, 1.0]))  # thin rod
    body(np.diag([1.0, 2.0, 3.0]))  # flat plate
    body(np.zeros((3, 3)))  # point


def test_arrays_are_read_only_copies() -> None:
    centre = np.zeros(3)
    made = Body(name="b", mass=1.0, centre_of_mass=centre, inertia=np.eye(3))
    centre[0] = 5.0
    assert made.centre_of_mass[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        made.inertia[0, 0] = 2.0


@pytest.mark.parametrize(
    ("position", "tool_axis"), [((0, 0), ()), ((3,), ()), ((), (0,)), ((0,), (0, 1, 2))]
)
def test_impossible_tasks_are_refused(position: tuple, tool_axis: tuple) -> None:
    with pytest.raises(ParameterError):
        TaskDefinition(position=position, tool_axis=tool_axis)


def test_parameters_are_named_and_hold_no_zeros(case: Case) -> None:
    values, names = inertial_parameters(case.description), parameter_names(case.description)
    assert len(values) == len(names) == len(set(names))
    assert np.all(values != 0)
    for number, (joint, link) in enumerate(
        zip(case.description.joints, case.description.bodies, strict=True), 1
    ):
        assert values[names.index(f"m{number}")] == link.mass
        assert values[names.index(f"Ia{number}")] == joint.drive_inertia
        moment = link.mass * link.centre_of_mass
        for letter, entry in zip("xyz", moment, strict=True):
            name = f"m{letter}{number}"
            assert (name in names) == (entry != 0)
            assert name not in names or values[names.index(name)] == entry


def test_inertia_parameters_are_at_the_link_origin() -> None:
    robot = load_robot("planar_2r")
    values = dict(zip(parameter_names(robot), inertial_parameters(robot), strict=True))
    assert values["Izz1"] == pytest.approx(6 * 0.35**2 / 3)  # rod about its end
    assert values["Izz2"] == pytest.approx(3 * 0.30**2 / 3)


def test_scaling_multiplies_whole_bodies(case: Case) -> None:
    nominal = inertial_parameters(case.description)
    np.testing.assert_allclose(scaled_parameters(case.description, 1.25), 1.25 * nominal)
    n = case.description.joint_count
    factors = np.linspace(0.5, 1.5, n)
    found = scaled_parameters(case.description, factors)
    owner = [int(name.lstrip("Iamxyz")) - 1 for name in parameter_names(case.description)]
    np.testing.assert_allclose(found, factors[owner] * nominal)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf, [1.0, 2.0, 3.0]])
def test_meaningless_scales_are_refused(scale: object) -> None:
    with pytest.raises(ParameterError, match="body_scale"):
        scaled_parameters(load_robot("planar_2r"), scale)


def test_friction_is_coulomb_then_viscous() -> None:
    values = friction_parameters(load_robot("d2m2_set_a"))
    np.testing.assert_array_equal(values, [15, 0.8, 0.5, 0.05, 0.03, 20, 0.2, 0.1, 0.01, 0.005])


def test_tables_show_every_joint_and_the_provenance() -> None:
    robot = load_robot("d2m2_set_a")
    text = robot._repr_markdown_()
    assert robot.provenance in text
    assert "| 1 | vertical axis | prismatic | 0 | 0 | 0 | $q_1$ | 0 m |" in text
    assert r"| 4 | wrist pitch | revolute | $\pi/2$ | 0.3 | $q_4$ | 0 | $\pi/2$ rad |" in text
    assert "| 2 | upper arm | 13 | (0.2423, 0, 0.0288) | 0.037619 | 0.3131 | 0.317887 |" in text
    assert "| 3750 N | 150 |" in text
