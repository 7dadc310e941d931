"""The controller's filters and its feedback law in SI units, for simulations that stand apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.stability import AdaptiveLoop
from mrac_design.stability.rational_function import to_float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AxisFilters:
    """u = −(R − Ao)/Ao u − S/Ao y with R = (p + c + r1') D, c = α1 − d1, written from scratch."""

    observer: FloatArray
    """Ao, highest power first, (n + 1,)."""
    internal_model: FloatArray
    """D, (n,)."""

    @property
    def degree(self) -> int:
        """n."""
        return len(self.observer) - 1

    @property
    def flow(self) -> tuple[FloatArray, FloatArray]:
        """(A, B) of (p^{n-1}, …, 1) v/Ao from v, (n, n) and (n, 1)."""
        A = np.eye(self.degree, k=-1)
        A[0] = -self.observer[1:]
        return A, np.eye(self.degree)[:, :1]

    def command(self, point: FloatArray) -> FloatArray:
        """u as a row on (ξ, ξ', x_u, x_y), (2 + 2n,), for a point (r1', s0, …, sn, Ks)."""
        Ao, D = self.observer, self.internal_model
        c = Ao[1] - (D[1] if self.degree > 1 else 0.0)
        R, S = np.convolve([1.0, c + point[0]], D), point[1:-1]
        return np.concatenate([[-S[0] * point[-1], 0.0], (Ao - R)[1:], (S[0] * Ao - S)[1:]])


def axis_filters(loop: AdaptiveLoop) -> AxisFilters:
    """The filters of a loop in floats."""
    observer, internal_model = (
        readonly([to_float(v) for v in polynomial])
        for polynomial in (loop.observer, loop.internal_model)
    )
    return AxisFilters(observer=observer, internal_model=internal_model)
