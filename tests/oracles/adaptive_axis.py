"""One force axis with moving gains, integrated in SI units from its differential equations.

    X'' = u − K2 X'          y = Ks (X − Xh)
    xu' = −ao xu + u         xy' = −ao xy + y
    u = −r xu − s0 (y − ao xy) − s1 xy

Gains, stiffness and d = Xh'' + K2 Xh' are constant over each step, so the matrix exponential
integrates exactly. The sampled version holds and delays the command and looks at the force on a
finer grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True)
class Axis:
    K2: float
    ao: float

    def continuous_step(self, gains, Ks, dt):
        """(transition, effect of d) over dt for x = (ξ, ξ', xu, xy), ξ = X − Xh."""
        r, s0, s1 = gains
        u = np.array([-s0 * Ks, 0.0, -r, s0 * self.ao - s1])
        A = np.zeros((4, 4))
        A[0, 1] = 1.0
        A[1] = u
        A[1, 1] -= self.K2
        A[2] = u
        A[2, 2] -= self.ao
        A[3, 0], A[3, 3] = Ks, -self.ao
        block = np.zeros((5, 5))
        block[:4, :4], block[1, 4] = A, -1.0
        M = expm(block * dt)
        return M[:4, :4], M[:4, 4]

    def plant_step(self, dt):
        """(transition, effect of (u, d)) of (ξ, ξ') over dt."""
        block = np.zeros((4, 4))
        block[0, 1], block[1, 1], block[1, 2], block[1, 3] = 1.0, -self.K2, 1.0, -1.0
        M = expm(block * dt)
        return M[:2, :2], M[:2, 2:]

    def sampled_run(self, gains, Ks, disturbance, period, delay, x0, substeps):
        """Force on the fine grid, (samples · substeps,), and the last state.

        gains (samples, 3), Ks (samples,), disturbance (samples, substeps); x0 = (ξ, ξ', xu, xy).
        """
        F, G = self.plant_step(period / substeps)
        b = np.exp(-self.ao * period)
        f = (1 - b) / self.ao
        plant, xu, xy = np.array(x0[:2], float), float(x0[2]), float(x0[3])
        waiting = [0.0] * delay
        force = []
        for k in range(len(Ks)):
            y = Ks[k] * plant[0]
            r, s0, s1 = gains[k]
            u = -r * xu - s0 * (y - self.ao * xy) - s1 * xy
            xu, xy = b * xu + f * u, b * xy + f * y
            waiting.append(u)
            applied = waiting.pop(0)
            for d in disturbance[k]:
                plant = F @ plant + G @ np.array([applied, d])
                force.append(Ks[k] * plant[0])
        return np.array(force), np.array([*plant, xu, xy])
