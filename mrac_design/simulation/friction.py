r"""Friction of the robot's joints, which no controller here knows of.

    Γf = Fc tanh(q̇/w) + Fv q̇

The hyperbolic tangent rounds Coulomb's jump over a stated speed w: within ± w the joint creeps
where a real one would stick, beyond 2 w the two agree to 4 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.errors import ParameterError
from mrac_design.robot import JointType, RobotDescription, friction_parameters


class Friction(Protocol):
    """What the joints lose."""

    def values(self, robot: RobotDescription) -> Mapping[str, ArrayLike]:
        """Numbers that become parameters of the loop, by name."""

    def remaining(self, effort: ca.SX, qd: ca.SX, parameters: Mapping[str, ca.SX]) -> ca.SX:
        """Joint efforts (n,) left of `effort` at joint velocities qd, N·m or N."""


@dataclass(frozen=True, slots=True)
class Frictionless:
    """Nothing is lost, as in the paper."""

    def values(self, robot: RobotDescription) -> Mapping[str, ArrayLike]:
        return {}

    def remaining(self, effort: ca.SX, qd: ca.SX, parameters: Mapping[str, ca.SX]) -> ca.SX:
        return effort


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothFriction:
    """Coulomb and viscous friction of the robot's description, Coulomb's part smoothed."""

    scale: float
    """Factor on all friction of the description, ≥ 0; 1 is the description's own."""
    slide_width: float
    """w of prismatic joints (m/s), > 0."""
    turn_width: float
    """w of revolute joints (rad/s), > 0."""

    def __post_init__(self) -> None:
        if not 0 <= self.scale < math.inf:
            raise ParameterError("scale", self.scale, "must be a finite factor >= 0")
        for name in ("slide_width", "turn_width"):
            if not 0 < getattr(self, name) < math.inf:
                raise ParameterError(name, getattr(self, name), "must be a finite speed > 0")

    def values(self, robot: RobotDescription) -> Mapping[str, ArrayLike]:
        coulomb, viscous = np.split(self.scale * friction_parameters(robot), 2)
        width = [
            self.slide_width if joint.type is JointType.PRISMATIC else self.turn_width
            for joint in robot.joints
        ]
        return {"coulomb_friction": coulomb, "viscous_friction": viscous, "friction_width": width}

    def remaining(self, effort: ca.SX, qd: ca.SX, parameters: Mapping[str, ca.SX]) -> ca.SX:
        coulomb = parameters["coulomb_friction"] * ca.tanh(qd / parameters["friction_width"])
        return effort - coulomb - parameters["viscous_friction"] * qd
