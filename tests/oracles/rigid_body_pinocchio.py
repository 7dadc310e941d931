"""Rigid-body terms of a robot file by Pinocchio, built from the file's tables alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin


class PinocchioRobot:
    """A serial robot in modified Denavit-Hartenberg notation; `file` is the parsed TOML."""

    def __init__(self, file: Mapping[str, Any]) -> None:
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.array(file["gravity"], dtype=float), np.zeros(3))
        parent = 0
        for joint in file["joint"]:
            prismatic = joint["type"] == "prismatic"
            kind = pin.JointModelPZ() if prismatic else pin.JointModelRZ()
            body = joint["body"]
            inertia = pin.Inertia(
                body["mass"], np.array(body["centre_of_mass"]), np.array(body["inertia"])
            )
            parent = self.model.addJoint(parent, kind, _placement(joint), joint["name"])
            self.model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        self.model.armature = np.array([joint["drive_inertia"] for joint in file["joint"]])
        tip = pin.SE3(np.eye(3), np.array(file["tool"]["tip"], dtype=float))
        self.tip = self.model.addFrame(pin.Frame("tip", parent, 0, tip, pin.FrameType.OP_FRAME))
        self.axis = np.array(file["tool"]["axis"], dtype=float)
        self.data = self.model.createData()

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        upper = np.triu(pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T

    def inverse_dynamics(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        return pin.rnea(self.model, self.data, q, qd, qdd)

    def gravity_torque(self, q: np.ndarray) -> np.ndarray:
        return pin.computeGeneralizedGravity(self.model, self.data, q)

    def forward_dynamics(self, q: np.ndarray, qd: np.ndarray, torque: np.ndarray) -> np.ndarray:
        return pin.aba(self.model, self.data, q, qd, torque)

    def tip_position(self, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.tip].translation.copy()

    def tool_axis(self, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.tip].rotation @ self.axis

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Geometric Jacobian at the tip in base-frame components, linear part first."""
        return pin.computeFrameJacobian(self.model, self.data, q, self.tip, pin.LOCAL_WORLD_ALIGNED)

    def bias_accelerations(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Second derivatives of tip and tool axis at zero joint acceleration."""
        pin.forwardKinematics(self.model, self.data, q, qd, np.zeros_like(q))
        frame = (self.model, self.data, self.tip, pin.LOCAL_WORLD_ALIGNED)
        acceleration = pin.getFrameClassicalAcceleration(*frame)
        omega = pin.getFrameVelocity(*frame).angular
        axis = self.tool_axis(q)
        turning = np.cross(acceleration.angular, axis) + np.cross(omega, np.cross(omega, axis))
        return acceleration.linear.copy(), turning

    def energies(self, q: np.ndarray, qd: np.ndarray) -> tuple[float, float]:
        """Kinetic energy, drives included, and potential energy (J)."""
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, qd)
        return kinetic, pin.computePotentialEnergy(self.model, self.data, q)


def _placement(joint: Mapping[str, Any]) -> pin.SE3:
    """Rot_x(alpha) Trans_x(d) Rot_z(theta) Trans_z(r); the joint moves along or about z after."""
    turn = pin.SE3(pin.utils.rotate("x", joint["alpha"]), np.zeros(3))
    shift = pin.SE3(np.eye(3), np.array([joint["d"], 0.0, 0.0]))
    spin = pin.SE3(pin.utils.rotate("z", joint["theta"]), np.zeros(3))
    rise = pin.SE3(np.eye(3), np.array([0.0, 0.0, joint["r"]]))
    return turn * shift * spin * rise
