"""The adaptive RST loop of one axis, written out plainly in SI units with NumPy.

Plant y'' = −K2 y' + b0 u − disturbance terms; filters, gradient law and augmented error exactly as
in Åström and Wittenmark, *Adaptive Control*, section 5.8, with Q = Ao Am, P1 = Am, P2 = Ao.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class AxisLoop:
    """States: y, y', xu, zu1, zu2, xy, zy1, zy2, xc, zc1, zc2, ym', ym, θ (5)."""

    b0: float
    k2: float
    omega: float
    xi: float
    ao: float
    gamma: np.ndarray
    alpha: float | None
    """None: plain gradient law; else Γ φ ε / (α + φ̂ᵀφ̂) with φ̂ = b0 D φ."""

    def scaling(self) -> np.ndarray:
        w, b0 = self.omega, self.b0
        return np.array([w, w**2 / b0, w**3 / b0, w**2 / b0, w**3 / b0])

    def derivative(self, state: np.ndarray, uc: float, d_acc: float) -> np.ndarray:
        y, dy, xu, zu1, zu2, xy, zy1, zy2, xc, zc1, zc2, dym, ym = state[:13]
        theta = state[13:]
        a1, a0 = 2 * self.xi * self.omega, self.omega**2
        p1_phi = np.array([xu, y - self.ao * xy, xy, -(uc - self.ao * xc), -xc])
        phi = np.array([zu2, zy1, zy2, -zc1, -zc2])
        u = -theta @ p1_phi
        eta = -((zu1 + self.ao * zu2) + phi @ theta)
        epsilon = (y - ym) + self.b0 * eta
        rate = self.gamma * phi * epsilon
        if self.alpha is not None:
            scaled = self.b0 * self.scaling() * phi
            rate = rate / (self.alpha + scaled @ scaled)
        return np.concatenate(
            [
                [dy, -self.k2 * dy + self.b0 * u + d_acc],
                [-self.ao * xu + u, -a1 * zu1 - a0 * zu2 + xu, zu1],
                [-self.ao * xy + y, -a1 * zy1 - a0 * zy2 + xy, zy1],
                [-self.ao * xc + uc, -a1 * zc1 - a0 * zc2 + xc, zc1],
                [-a1 * dym - a0 * ym + a0 * uc, dym],
                rate,
            ]
        )

    def run(
        self,
        *,
        theta: np.ndarray,
        uc: Callable[[float], float],
        times: np.ndarray,
        tolerance: float,
    ) -> np.ndarray:
        """States at `times` from rest with gains `theta`; `uc` constant between the times given."""
        state = np.concatenate([np.zeros(13), theta])
        rows = [state]
        for start, end in pairwise(times):
            level = uc(0.5 * (start + end))
            solution = solve_ivp(
                lambda _, x, level=level: self.derivative(x, level, 0.0),
                (start, end),
                state,
                method="DOP853",
                rtol=tolerance,
                atol=tolerance,
            )
            state = solution.y[:, -1]
            rows.append(state)
        return np.array(rows)
