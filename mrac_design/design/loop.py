"""The closed loop of a process and an RST controller: poles, sensitivities, margins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly
from numpy.typing import NDArray

from mrac_design.design.margins import StabilityMargins, stability_margins
from mrac_design.design.region import is_stable
from mrac_design.plant import Process
from mrac_design.polynomials.rationals import coefficients, roots
from mrac_design.transfer import transfer_function

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackLoop:
    """A y = B u with R u = T uc − S y, and a disturbance d added to the output.

                          d
        uc ─► T ─►(+)─► 1/R ─► B/A ─►(+)─┬─► y
                   └──────── −S ◄────────┘

    Every transfer function comes from the polynomials by multiplication alone, without
    cancellation, so its order is that of the closed loop.
    """

    process: Process
    """A and B."""

    R: fmpq_poly
    """Denominator of the controller."""

    S: fmpq_poly
    """Feedback numerator."""

    T: fmpq_poly
    """Reference numerator."""

    @property
    def characteristic(self) -> fmpq_poly:
        """A R + B S."""
        return self.process.A * self.R + self.process.B * self.S

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of A R + B S, by increasing modulus, (n,); rad/s in continuous time."""
        return roots(self.characteristic)

    @property
    def is_stable(self) -> bool:
        """Whether all closed-loop poles are stable, decided exactly."""
        return is_stable(self.characteristic, self.process.domain)

    def loop_transfer(self) -> control.TransferFunction:
        """B S/(A R), the loop gain with the sign of negative feedback taken out."""
        return self._ratio(self.process.B * self.S, self.process.A * self.R)

    def disturbance_sensitivity(self) -> control.TransferFunction:
        """S_d = A R/(A R + B S), from d to y."""
        return self._ratio(self.process.A * self.R, self.characteristic)

    def complementary_sensitivity(self) -> control.TransferFunction:
        """B S/(A R + B S), from measurement noise to −y."""
        return self._ratio(self.process.B * self.S, self.characteristic)

    def control_sensitivity(self) -> control.TransferFunction:
        """A S/(A R + B S), from d, or measurement noise, to −u."""
        return self._ratio(self.process.A * self.S, self.characteristic)

    def reference_transfer(self) -> control.TransferFunction:
        """B T/(A R + B S), from uc to y."""
        return self._ratio(self.process.B * self.T, self.characteristic)

    def reference_to_control(self) -> control.TransferFunction:
        """A T/(A R + B S), from uc to u."""
        return self._ratio(self.process.A * self.T, self.characteristic)

    def margins(self) -> StabilityMargins:
        """Gain, phase, delay and modulus margin of the loop."""
        return stability_margins(
            self.process.B * self.S, self.process.A * self.R, self.process.domain
        )

    def _ratio(self, numerator: fmpq_poly, denominator: fmpq_poly) -> control.TransferFunction:
        if numerator.is_zero():
            return transfer_function([0.0], [1.0], dt=self.process.domain.dt)
        return transfer_function(
            coefficients(numerator), coefficients(denominator), dt=self.process.domain.dt
        )
