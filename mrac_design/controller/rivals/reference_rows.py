"""Rows of the desired force, its derivatives and its near future, for linear controllers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.advance import linear_advance
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.rivals.linear import Columns
from mrac_design.design import ReferenceModel
from mrac_design.time_domain import TimeDomain

PREFILTER = ("prefilter", 2)
"""Block of the state every rival keeps: Ḟd and Fd."""

REST = {"prefilter": np.array([0.0, 1.0])}
"""The block at rest under a reference of 1 N."""


@dataclass(frozen=True, slots=True)
class ReferenceRows:
    """The pre-filter ω²/(p² + 2ξω p + ω²) over the columns of a controller."""

    prefilter: ReferenceModel
    """Pre-filter that turns the reference into the desired force F_d [Z 5]."""
    time_domain: TimeDomain
    """Continuous, or sampled with a period."""
    columns: Columns
    """Columns with a block `prefilter`."""

    def following(self) -> FloatArray:
        """How the block `prefilter` advances, (2, columns)."""
        A, B = linear_advance(self.time_domain, *self._equations())
        return A @ self.columns.block("prefilter") + np.outer(B[:, 0], self.columns.reference)

    def desired(self, *, ahead: int) -> FloatArray:
        """Fd, `ahead` samples from now while the reference stays as it is, (columns,)."""
        return self.ahead(ahead)[1]

    def input(
        self, feedforward: ReferenceFeedforward, model: ReferenceModel, *, ahead: int
    ) -> FloatArray:
        """u_c = Fd + c1 Ḟd + c2 F̈d of a loop that answers like `model`, (columns,)."""
        rate, desired = self.ahead(ahead)
        c1, c2 = feedforward.weights(model)
        damping, stiffness = self.prefilter.polynomial[1:]
        acceleration = stiffness * (self.columns.reference - desired) - damping * rate
        return desired + c1 * rate + c2 * acceleration

    def ahead(self, count: int) -> FloatArray:
        """Ḟd and Fd, `count` samples from now while the reference stays, (2, columns)."""
        rows = self.columns.block("prefilter")
        A, B = linear_advance(self.time_domain, *self._equations())
        for _ in range(count):
            rows = A @ rows + np.outer(B[:, 0], self.columns.reference)
        return rows

    def _equations(self) -> tuple[FloatArray, FloatArray]:
        damping, stiffness = self.prefilter.polynomial[1:]
        return np.array([[-damping, -stiffness], [1.0, 0.0]]), np.array([[stiffness], [0.0]])
