"""Closed-form equations of a planar arm of two thin uniform rods in a vertical plane.

Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 7.3 (planar elbow
manipulator), with drive inertias added at the joints; angles relative, y upwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TwoRods:
    """Masses (kg), lengths (m), drive inertias (kg·m²) and gravity (m/s², downwards)."""

    masses: tuple[float, float]
    lengths: tuple[float, float]
    drives: tuple[float, float]
    gravity: float

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        (m1, m2), (l1, l2), (a1, a2) = self.masses, self.lengths, self.drives
        i1, i2 = m1 * l1**2 / 12, m2 * l2**2 / 12
        c2 = np.cos(q[1])
        far = m2 * l2**2 / 4 + i2
        d11 = m1 * l1**2 / 4 + i1 + m2 * (l1**2 + l1 * l2 * c2) + far
        d12 = far + m2 * l1 * l2 / 2 * c2
        return np.array([[d11 + a1, d12], [d12, far + a2]])

    def coriolis_torque(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        h = -self.masses[1] * self.lengths[0] * self.lengths[1] / 2 * np.sin(q[1])
        return np.array([h * (2 * qd[0] * qd[1] + qd[1] ** 2), -h * qd[0] ** 2])

    def gravity_torque(self, q: np.ndarray) -> np.ndarray:
        (m1, m2), (l1, l2), g = self.masses, self.lengths, self.gravity
        second = m2 * l2 / 2 * g * np.cos(q[0] + q[1])
        return np.array([(m1 * l1 / 2 + m2 * l1) * g * np.cos(q[0]) + second, second])

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        l1, l2 = self.lengths
        s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
        return np.array([[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]])

    def bias_acceleration(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        l1, l2 = self.lengths
        a, b = q[0], q.sum()
        return -l1 * qd[0] ** 2 * np.array([np.cos(a), np.sin(a)]) - l2 * qd.sum() ** 2 * np.array(
            [np.cos(b), np.sin(b)]
        )
