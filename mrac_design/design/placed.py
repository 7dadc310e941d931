"""What RST controllers of the force plant share: they are solved pole placements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray
from mrac_design.design.loop import FeedbackLoop
from mrac_design.design.margins import StabilityMargins
from mrac_design.design.polynomial_design import PolynomialDesign

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedController:
    """Controller R u = T uc − S y, coefficients highest power first."""

    solved: PolynomialDesign
    """The same controller as a solved pole placement."""

    @property
    def R(self) -> FloatArray:
        """Monic denominator, powers of 1/s."""
        return self.solved.R

    @property
    def S(self) -> FloatArray:
        """Feedback numerator, m/(s²·N) times powers of 1/s."""
        return self.solved.S

    @property
    def T(self) -> FloatArray:
        """Reference numerator, units as S."""
        return self.solved.T

    @property
    def residual(self) -> float:
        """Largest coefficient of A R + b0 S − Ao Am relative to that of Ao Am, recomputed
        exactly from the float64 polynomials."""
        return self.solved.residual

    @property
    def loop(self) -> FeedbackLoop:
        """The closed loop with the design plant."""
        return self.solved.loop

    @property
    def closed_loop_poles(self) -> NDArray[np.complex128]:
        """Roots of A R + b0 S, rad/s."""
        return self.loop.poles

    def margins(self) -> StabilityMargins:
        """Gain, phase, delay and modulus margin with the parameters frozen."""
        return self.loop.margins()

    def loop_transfer(self) -> control.TransferFunction:
        """b0 S/(A R)."""
        return self.loop.loop_transfer()

    def disturbance_sensitivity(self) -> control.TransferFunction:
        """S_d = A R/(Ao Am), from d = −Ks Xh to the force."""
        return self.loop.disturbance_sensitivity()

    def complementary_sensitivity(self) -> control.TransferFunction:
        """b0 S/(Ao Am), from force-sensor noise to minus the force."""
        return self.loop.complementary_sensitivity()

    def control_sensitivity(self) -> control.TransferFunction:
        """A S/(Ao Am), from force-sensor noise to minus the command, m/(s²·N)."""
        return self.loop.control_sensitivity()

    def reference_transfer(self) -> control.TransferFunction:
        """b0 T/(A R + b0 S), from uc to the force; its common factor Ao is left in."""
        return self.loop.reference_transfer()

    def _repr_latex_(self) -> str:
        return self.solved._repr_latex_()
