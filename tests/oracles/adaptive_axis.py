"""One force axis with moving gains, integrated in SI units from its transfer functions.

    X'' = u − K2 X'          y = Ks (X − Xh)
    u = −(R − Ao)/Ao u − S/Ao y,      R = (p + c + r1') D,      S = s0 pⁿ + … + sn

with c = α1 − d1. Gains, stiffness and d = Xh'' + K2 Xh' are constant over each step, so the matrix
exponential integrates exactly. The sampled version holds and delays the command and looks at the
force on a finer grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True)
class Axis:
    K2: float
    observer: tuple[float, ...]
    internal_model: tuple[float, ...] = (1.0,)

    @property
    def n(self):
        return len(self.observer) - 1

    def laws(self, gains):
        """(row on x_u, row on x_y, gain of y) of −u: quotients and remainders by Ao."""
        Ao, D = np.array(self.observer), np.array(self.internal_model)
        c = Ao[1] - (D[1] if self.n > 1 else 0.0)
        R, S = np.convolve([1.0, c + gains[0]], D), np.asarray(gains[1:])
        return (R - Ao)[1:], (S - S[0] * Ao)[1:], S[0]

    def filter(self):
        """(A, B) of either filter: (p^{n-1}, …, 1) v/Ao from v."""
        A = np.eye(self.n, k=-1)
        A[0] = -np.array(self.observer[1:])
        return A, np.eye(self.n)[:, :1]

    def continuous_matrix(self, gains, Ks):
        """State matrix for x = (ξ, ξ', x_u, x_y), ξ = X − Xh, (2 + 2n, 2 + 2n)."""
        n = self.n
        row_u, row_y, direct = self.laws(gains)
        u = np.concatenate([[-direct * Ks, 0.0], -row_u, -row_y])
        chain, drive = self.filter()
        A = np.zeros((2 + 2 * n, 2 + 2 * n))
        A[0, 1] = 1.0
        A[1] = u
        A[1, 1] -= self.K2
        A[2 : 2 + n, 2 : 2 + n] = A[2 + n :, 2 + n :] = chain
        A[2 : 2 + n] += drive @ u[None, :]
        A[2 + n :, 0] += Ks * drive[:, 0]
        return A

    def continuous_step(self, gains, Ks, dt):
        """(transition, effect of d) over dt for x = (ξ, ξ', x_u, x_y)."""
        N = 2 + 2 * self.n
        block = np.zeros((N + 1, N + 1))
        block[:N, :N], block[1, N] = self.continuous_matrix(gains, Ks), -1.0
        M = expm(block * dt)
        return M[:N, :N], M[:N, N]

    def plant_step(self, dt):
        """(transition, effect of (u, d)) of (ξ, ξ') over dt."""
        block = np.zeros((4, 4))
        block[0, 1], block[1, 1], block[1, 2], block[1, 3] = 1.0, -self.K2, 1.0, -1.0
        M = expm(block * dt)
        return M[:2, :2], M[:2, 2:]

    def filter_step(self, period):
        """(F, G) of x⁺ = F x + G v with v held."""
        n = self.n
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n:] = self.filter()
        M = expm(block * period)
        return M[:n, :n], M[:n, n]

    def sampled_run(self, gains, Ks, disturbance, period, delay, x0, substeps, waiting=None):
        """Force on the fine grid, (samples · substeps,), and the last state.

        gains (samples, n + 2), Ks (samples,), disturbance (samples, substeps);
        x0 = (ξ, ξ', x_u, x_y); `waiting` are the commands under way, oldest first, all zero
        without. The last state ends with them when they were given.
        """
        n = self.n
        F, G = self.plant_step(period / substeps)
        move, push = self.filter_step(period)
        plant, xu, xy = np.split(np.array(x0, float), [2, 2 + n])
        queue = [0.0] * delay if waiting is None else list(waiting)
        force = []
        for k in range(len(Ks)):
            y = Ks[k] * plant[0]
            row_u, row_y, direct = self.laws(gains[k])
            u = -row_u @ xu - row_y @ xy - direct * y
            xu, xy = move @ xu + push * u, move @ xy + push * y
            queue.append(u)
            applied = queue.pop(0)
            for d in disturbance[k]:
                plant = F @ plant + G @ np.array([applied, d])
                force.append(Ks[k] * plant[0])
        rest = [] if waiting is None else queue
        return np.array(force), np.array([*plant, *xu, *xy, *rest])
