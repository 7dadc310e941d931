"""Loops with an internal model, from a pole placement and filter steps of the oracle's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.stability.adaptive_loop import AdaptiveLoop, adaptive_loop, filter_step
from tests.oracles.adaptive_axis import Axis

PERIOD = 1e-3


@dataclass(frozen=True)
class Placed:
    """A R + b0 S = Ao Am with R = (p + r1) D and A = p(p + K2), solved in floats."""

    K2: float
    bandwidth: float
    damping: float
    observer: tuple[float, ...]
    internal_model: tuple[float, ...]
    b0: float = 800.0

    @property
    def axis(self) -> Axis:
        return Axis(K2=self.K2, observer=self.observer, internal_model=self.internal_model)

    @property
    def poles(self) -> np.ndarray:
        """Ao Am, highest power first."""
        Am = [1.0, 2 * self.damping * self.bandwidth, self.bandwidth**2]
        return np.polymul(self.observer, Am)

    @property
    def gains(self) -> np.ndarray:
        """(r1', s0, …, sn): one column for r1, one for every coefficient of S."""
        AD = np.polymul([1.0, self.K2, 0.0], self.internal_model)
        n = len(self.internal_model)
        columns = np.zeros((n + 3, n + 2))
        columns[1:, 0] = AD
        columns[2:, 1:] = self.b0 * np.eye(n + 1)
        rest = self.poles - np.append(AD, 0.0)
        r1, *s = np.linalg.lstsq(columns, rest, rcond=None)[0]
        first = self.internal_model[1] if n > 1 else 0.0
        return np.array([r1 - self.observer[1] + first, *s])

    @property
    def loop(self) -> AdaptiveLoop:
        return adaptive_loop(
            design_stiffness=self.b0,
            velocity_gain=self.K2,
            bandwidth=self.bandwidth,
            observer=self.observer,
            internal_model=self.internal_model,
            gains=self.gains.tolist(),
            gain_scale=[
                self.bandwidth,
                *(self.bandwidth**2 / self.b0 * np.array(self.observer)).tolist(),
            ],
            filter_steps=[filter_step("1/1000", *self.axis.filter_step(PERIOD))],
        )


INTEGRATOR = Placed(
    K2=20.0, bandwidth=300.0, damping=1.2, observer=(1.0, 150.0, 5400.0), internal_model=(1.0, 0.0)
)
HEART_BAND = Placed(
    K2=0.0,
    bandwidth=550.0,
    damping=1.7,
    observer=tuple(np.polymul([1.0, 2 * 0.3 * 76.0, 76.0**2], [1.0, 120.0]).tolist()),
    internal_model=(1.0, 0.0, 41.0**2),
)
