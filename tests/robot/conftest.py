"""The packaged robots, their functions and random postures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from mrac_design.robot import (
    JointType,
    RobotDescription,
    RobotDynamics,
    build_dynamics,
    inertial_parameters,
    load_robot,
)

ROBOTS = ("d2m2_set_a", "d2m2_set_b", "planar_2r")


@dataclass(frozen=True)
class Case:
    """A robot with its functions and its own parameters."""

    name: str
    description: RobotDescription
    dynamics: RobotDynamics
    parameters: np.ndarray

    def states(self, count: int, seed: int = 1) -> Iterator[tuple[np.ndarray, ...]]:
        """Random (q, qd, qdd, torque), the joints anywhere on their circle."""
        rng = np.random.default_rng(seed)
        n = self.description.joint_count
        prismatic = np.array(
            [joint.type is JointType.PRISMATIC for joint in self.description.joints]
        )
        for _ in range(count):
            q = np.where(prismatic, 0.3, np.pi) * rng.uniform(-1, 1, n)
            yield q, rng.uniform(-3, 3, n), rng.uniform(-9, 9, n), rng.uniform(-20, 20, n)


_cases: dict[str, Case] = {}


def case_of(name: str) -> Case:
    if name not in _cases:
        description = load_robot(name)
        _cases[name] = Case(
            name, description, build_dynamics(description), inertial_parameters(description)
        )
    return _cases[name]


@pytest.fixture(params=ROBOTS)
def case(request: pytest.FixtureRequest) -> Case:
    return case_of(request.param)


@pytest.fixture(params=ROBOTS[:2])
def arm(request: pytest.FixtureRequest) -> Case:
    """The two five-joint robots."""
    return case_of(request.param)


def array(value: object) -> np.ndarray:
    """A CasADi result as an array; a column becomes a vector."""
    full = value.full()
    return full.ravel() if full.shape[1] == 1 else full
