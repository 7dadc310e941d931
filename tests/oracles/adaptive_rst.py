"""The adaptive RST loop of one axis, written out plainly in SI units with NumPy.

    y'' = −K2 y' + b0 (u + push)
    φ = (D u, pⁿ y … y, −pⁿ uc … −uc)/(Ao Am),   n = deg Ao = deg D + 1
    R = (p + c) D + r1' D,   so   u = −(((p + c) D − Ao)/Ao) u − θᵀ (Am φ)
    η = −((p + c) D/(Ao Am) u + φᵀθ),   ε = (y − ym) + b0 η

gradient law as in Åström and Wittenmark, *Adaptive Control*, section 5.8, with Q = Ao Am, P1 = Am,
P2 = Ao. Every signal goes through one chain of integrators with the characteristic polynomial
Ao Am, of which all powers up to n + 1 are states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class AxisLoop:
    """States: y, y', chains of u, y and uc (n + 2 each, lowest power first), ym, ym', θ.

    A chain holds pⁱ v/(Ao Am) times ω^(n + 2 − i), which makes its entries of the size of v.
    """

    b0: float
    k2: float
    omega: float
    xi: float
    observer: tuple[float, ...]
    """Ao, highest power first, like the next."""
    internal_model: tuple[float, ...]
    scaling: np.ndarray
    """Of φ̂ = b0 · scaling · φ."""
    gamma: np.ndarray
    alpha: float | None
    """None: plain gradient law; else Γ φ ε / (α + φ̂ᵀφ̂)."""
    push: float = 0.0
    """Constant disturbance of the command (m/s²)."""

    @property
    def n(self) -> int:
        return len(self.observer) - 1

    @property
    def gains_at(self) -> int:
        """Where θ begins in the state."""
        return 3 * (self.n + 2) + 4

    def _powers(self, chain: np.ndarray, signal: float) -> np.ndarray:
        """pⁱ v/(Ao Am) for i = 0 … n + 2."""
        n = self.n
        product = np.polymul(self.observer, self._model())[::-1]
        low = chain / self.omega ** np.arange(n + 2, 0, -1.0)
        return np.append(low, signal - product[:-1] @ low)

    def _model(self) -> list[float]:
        return [1.0, 2 * self.xi * self.omega, self.omega**2]

    def _through(self, numerator: np.ndarray, powers: np.ndarray) -> float:
        """numerator(p) v/(Ao Am)."""
        return float(np.asarray(numerator)[::-1] @ powers[: len(numerator)])

    def _driven(self) -> np.ndarray:
        """(p + c) D, c such that its two highest coefficients are those of Ao."""
        second = self.internal_model[1] if self.n > 1 else 0.0
        return np.polymul([1.0, self.observer[1] - second], self.internal_model)

    def signals(self, state: np.ndarray, uc: float) -> tuple[float, np.ndarray, float]:
        """(u, φ, ε)."""
        n, Am = self.n, self._model()
        y, _, ym, _ = (*state[:2], *state[self.gains_at - 2 : self.gains_at])
        chains = state[2 : self.gains_at - 2].reshape(3, n + 2)
        theta = state[self.gains_at :]
        of_u = self._powers(chains[0], 0.0)  # nothing below reads its highest power
        of_y, of_uc = self._powers(chains[1], y), self._powers(chains[2], uc)
        unit = np.eye(n + 1)  # pⁿ … 1
        phi, coarse = (
            np.array(
                [
                    self._through(np.polymul(self.internal_model, by), of_u),
                    *(self._through(np.polymul(row, by), of_y) for row in unit),
                    *(-self._through(np.polymul(row, by), of_uc) for row in unit),
                ]
            )
            for by in ([1.0], Am)
        )
        known = np.polysub(self._driven(), self.observer)[2:]  # nothing left above pⁿ⁻²
        u = -theta @ coarse
        if n > 1:
            u -= self._through(np.polymul(known, Am), of_u)
        eta = -(self._through(self._driven(), of_u) + phi @ theta)
        return float(u), phi, float(y - ym + self.b0 * eta)

    def derivative(self, state: np.ndarray, uc: float) -> np.ndarray:
        n = self.n
        y, dy, ym, dym = (*state[:2], *state[self.gains_at - 2 : self.gains_at])
        u, phi, epsilon = self.signals(state, uc)
        rate = self.gamma * phi * epsilon
        if self.alpha is not None:
            scaled = self.b0 * self.scaling * phi
            rate = rate / (self.alpha + scaled @ scaled)
        chains = state[2 : self.gains_at - 2].reshape(3, n + 2)
        moving = [
            np.append(self.omega * chain[1:], self.omega * self._powers(chain, signal)[-1])
            for chain, signal in zip(chains, (u, y, uc), strict=True)
        ]
        _, damping, stiffness = self._model()
        return np.concatenate(
            [
                [dy, -self.k2 * dy + self.b0 * (u + self.push)],
                *moving,
                [dym, -damping * dym - stiffness * ym + stiffness * uc],
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
        state = np.concatenate([np.zeros(self.gains_at), theta])
        rows = [state]
        for start, end in pairwise(times):
            level = uc(0.5 * (start + end))
            solution = solve_ivp(
                lambda _, x, level=level: self.derivative(x, level),
                (start, end),
                state,
                method="DOP853",
                rtol=tolerance,
                atol=tolerance,
            )
            state = solution.y[:, -1]
            rows.append(state)
        return np.array(rows)
