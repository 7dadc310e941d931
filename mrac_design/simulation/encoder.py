r"""How a sampled controller gets joint positions and velocities.

    q ─► nearest count ─► q̂ ─► (q̂ₖ − q̂ₖ₋₁)/h ─► first-order low-pass ─► q̇̂

A controller never sees a velocity: it takes differences of counted positions, and pays for less
noise with lag. With a cutoff of ωc the estimate lags by h/2 + h/(e^{ωc h} − 1), about 1/ωc.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.robot import RobotDescription


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointReading:
    """What the controller is told at a sampling instant, and what is remembered for the next."""

    position: ca.SX
    """Joint positions (rad or m), (n,)."""
    velocity: ca.SX
    """Joint velocities (rad/s or m/s), (n,)."""
    memory: Mapping[str, ca.SX]
    """The sensor's memory after the instant, by name."""


class JointSensor(Protocol):
    """Position sensors of all n joints."""

    def memory(self, joints: int) -> Layout:
        """What it holds between samples."""

    def values(self, robot: RobotDescription, period: float) -> Mapping[str, ArrayLike]:
        """Numbers that become parameters of the loop sampled every `period` s, by name."""

    def read(
        self,
        memory: Mapping[str, ca.SX],
        q: ca.SX,
        qd: ca.SX,
        parameters: Mapping[str, ca.SX],
    ) -> JointReading:
        """Reading at a sampling instant with the joints truly at q, qd."""

    def resting(self, posture: ArrayLike, robot: RobotDescription) -> Mapping[str, FloatArray]:
        """Its memory after a long rest at `posture` (rad or m), by name."""


@dataclass(frozen=True, slots=True)
class ExactJoints:
    """Positions and velocities exactly as they are at the instant."""

    def memory(self, joints: int) -> Layout:
        return Layout(())

    def values(self, robot: RobotDescription, period: float) -> Mapping[str, ArrayLike]:
        return {}

    def read(
        self,
        memory: Mapping[str, ca.SX],
        q: ca.SX,
        qd: ca.SX,
        parameters: Mapping[str, ca.SX],
    ) -> JointReading:
        return JointReading(position=q, velocity=qd, memory={})

    def resting(self, posture: ArrayLike, robot: RobotDescription) -> Mapping[str, FloatArray]:
        return {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder:
    """An encoder on every motor, with the velocity from filtered differences."""

    counts_per_turn: float
    """Counts a turn of each motor, ≥ 1 (2²⁰ for a 20-bit encoder)."""
    velocity_cutoff: float
    """ωc, cutoff of the velocity's low-pass (rad/s), > 0."""

    def __post_init__(self) -> None:
        if not 1 <= self.counts_per_turn < math.inf:
            raise ParameterError("counts_per_turn", self.counts_per_turn, "must be >= 1")
        if not 0 < self.velocity_cutoff < math.inf:
            raise ParameterError("velocity_cutoff", self.velocity_cutoff, "must be > 0 rad/s")

    def resolution(self, robot: RobotDescription) -> FloatArray:
        """Joint motion a count stands for (rad or m), shape (n,)."""
        return readonly(2 * np.pi / self.counts_per_turn * robot.transmission)

    def memory(self, joints: int) -> Layout:
        return Layout((("encoder_position", joints), ("encoder_velocity", joints)))

    def values(self, robot: RobotDescription, period: float) -> Mapping[str, ArrayLike]:
        return {
            "encoder_resolution": self.resolution(robot),
            "encoder_period": period,
            "encoder_share": -math.expm1(-self.velocity_cutoff * period),
        }

    def read(
        self,
        memory: Mapping[str, ca.SX],
        q: ca.SX,
        qd: ca.SX,
        parameters: Mapping[str, ca.SX],
    ) -> JointReading:
        resolution = parameters["encoder_resolution"]
        counted = resolution * ca.floor(q / resolution + 0.5)
        difference = (counted - memory["encoder_position"]) / parameters["encoder_period"]
        before = memory["encoder_velocity"]
        velocity = before + parameters["encoder_share"] * (difference - before)
        return JointReading(
            position=counted,
            velocity=velocity,
            memory={"encoder_position": counted, "encoder_velocity": velocity},
        )

    def resting(self, posture: ArrayLike, robot: RobotDescription) -> Mapping[str, FloatArray]:
        resolution = self.resolution(robot)
        counted = resolution * np.floor(np.ravel(posture) / resolution + 0.5)
        return {
            "encoder_position": readonly(counted),
            "encoder_velocity": readonly(np.zeros(robot.joint_count)),
        }
