"""The second-order system used as reference model [Z 10] and as reference pre-filter [Z 5]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import coefficients, decimal_rational
from mrac_design.transfer import transfer_function

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceModel:
    """ω²/(p² + 2ξω p + ω²): unit static gain, bandwidth ω, damping ξ.

    Raises ParameterError when ω ≤ 0, ξ ≤ 0 or either is not finite.
    """

    bandwidth: float
    """Natural frequency ω, rad/s, positive."""

    damping: float
    """Relative damping ξ, dimensionless, positive."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bandwidth) and self.bandwidth > 0.0):
            raise ParameterError("bandwidth ω", self.bandwidth, "must be positive, in rad/s")
        if not (math.isfinite(self.damping) and self.damping > 0.0):
            raise ParameterError(
                "damping ξ", self.damping, "must be positive: the model has to be stable"
            )

    @staticmethod
    def from_transfer_function(system: control.TransferFunction) -> ReferenceModel:
        """The model a python-control transfer function is.

        Raises ParameterError when it is not a continuous ω²/(p² + 2ξω p + ω²).
        """
        shape = "must be a continuous ω²/(p² + 2ξω p + ω²)"
        if system.dt != 0 or system.ninputs != 1 or system.noutputs != 1:
            raise ParameterError("transfer function", system, shape)
        numerator = np.trim_zeros(system.num[0][0], "f")
        denominator = np.trim_zeros(system.den[0][0], "f")
        if len(numerator) != 1 or len(denominator) != 3:
            raise ParameterError("transfer function", system, shape)
        gain = numerator[0] / denominator[0]
        first, last = denominator[1:] / denominator[0]
        # A few roundings may separate a model that has been through other arithmetic.
        if last <= 0.0 or not math.isclose(gain, last, rel_tol=1e-12):
            raise ParameterError("transfer function", system, shape)
        bandwidth = math.sqrt(last)
        return ReferenceModel(bandwidth=bandwidth, damping=float(first / (2.0 * bandwidth)))

    @property
    def polynomial(self) -> FloatArray:
        """Am = p² + 2ξω p + ω², highest power first, (3,)."""
        return coefficients(self.exact_polynomial)

    @property
    def exact_polynomial(self) -> fmpq_poly:
        """Am over the rationals, with ω and ξ read as decimals."""
        omega, xi = decimal_rational(self.bandwidth), decimal_rational(self.damping)
        return fmpq_poly([omega**2, 2 * xi * omega, 1])

    def transfer_function(self) -> control.TransferFunction:
        """ω²/Am for python-control."""
        Am = self.polynomial
        return transfer_function([Am[-1]], Am)

    def _repr_latex_(self) -> str:
        _, first, last = self.polynomial
        return f"$\\dfrac{{{last:.6g}}}{{p^{{2}} + {first:.6g}\\,p + {last:.6g}}}$"
