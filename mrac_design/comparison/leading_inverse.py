"""The model's inverse for a loop that answers late: what is fed in leads by a dead time."""

from __future__ import annotations

from dataclasses import dataclass

from mrac_design.comparison.contestant import TuningParameter
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError

LEAD = TuningParameter(name="lead", unit="s", low=1e-4, high=5e-3, start=1.5e-3)
"""The lead as the tuner sees it: every contestant with a model's inverse may choose it."""


@dataclass(frozen=True, slots=True)
class LeadingInverse:
    """u_c = (1 + 2ξp/ω + p²/ω²) e^{pλ} Fd, to the second derivative of Fd.

    A sampled loop with dead time answers about λ = (delay + ½) periods later than the model it
    was designed with; λ = 0 is the plain inverse of the model.
    """

    lead: float
    """λ (s), ≥ 0."""

    def __post_init__(self) -> None:
        if not 0 <= self.lead < float("inf"):
            raise ParameterError("lead", self.lead, "must be a finite time >= 0 s")

    def weights(self, model: ReferenceModel) -> tuple[float, float]:
        """(c1 in s, c2 in s²) of u_c = Fd + c1 Ḟd + c2 F̈d."""
        first, second = 2 * model.damping / model.bandwidth, 1 / model.bandwidth**2
        return first + self.lead, second + first * self.lead + self.lead**2 / 2
