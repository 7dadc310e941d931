"""From the desired force to the command input u_c of the adaptive loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from mrac_design.design import ReferenceModel


class ReferenceFeedforward(Protocol):
    """Weights of u_c = Fd + c1 Ḟd + c2 F̈d; the derivatives come from the pre-filter."""

    def weights(self, model: ReferenceModel) -> tuple[float, float]:
        """(c1 in s, c2 in s²)."""


@dataclass(frozen=True, slots=True)
class DirectReference:
    """u_c = Fd, as in the paper: the force follows the model's output, not Fd itself [Z 9]."""

    def weights(self, model: ReferenceModel) -> tuple[float, float]:
        return 0.0, 0.0


@dataclass(frozen=True, slots=True)
class ModelInverse:
    """u_c = Fd + (2ξ/ω) Ḟd + F̈d/ω²: the model's output then is Fd.

    Exact and causal, because the pre-filter supplies both derivatives as its own states.
    """

    def weights(self, model: ReferenceModel) -> tuple[float, float]:
        return 2 * model.damping / model.bandwidth, 1 / model.bandwidth**2
