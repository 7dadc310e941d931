r"""RST controller with integral action: the honest non-adaptive rival.

    A R + b0 S = Ao Am,   R = p (p + r1),   S = s0 p² + s1 p + s2,   T = (ω²/b0) Ao

realised as Ao u = (Ao − R) u_applied + T u_c − S y, so a saturated command cannot wind it up
[AW §3.2, eq. 5.64 ff.].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.advance import linear_advance
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import (
    FollowModel,
    KeepZeros,
    PolePlacement,
    PolynomialDesign,
    ReferenceModel,
    place_poles,
)
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.rationals import exact_polynomial
from mrac_design.time_domain import TimeDomain


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegralRST:
    """RST controller with an integrator, fully specified for one axis."""

    plant: ForcePlant
    """Plant of the design."""
    reference_model: ReferenceModel
    """Wanted response ω²/Am."""
    observer: ReferenceModel
    """Its polynomial p² + α1 p + α2 is Ao."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    feedforward: ReferenceFeedforward
    """What enters the loop as u_c."""
    time_domain: TimeDomain
    """Continuous, or the continuous controller held exactly over each period."""


def design_integral_rst(specification: IntegralRST) -> PolynomialDesign:
    """R, S and T with the integrator as a prescribed factor of R."""
    Am = specification.reference_model.exact_polynomial
    return place_poles(
        PolePlacement(
            process=specification.plant.process,
            Am=Am,
            Ao=specification.observer.exact_polynomial,
            zeros=KeepZeros(),
            tracking=FollowModel(Bm=exact_polynomial([Am[0]])),
            fixed_R=exact_polynomial([1, 0]),
        )
    )


def integral_rst(specification: IntegralRST) -> LinearController:
    """The controller's equations."""
    design = design_integral_rst(specification)
    columns = Columns(Layout((("observer", 2), PREFILTER)))
    reference = ReferenceRows(specification.prefilter, specification.time_domain, columns)
    command_input = reference.input(
        specification.feedforward, specification.reference_model, ahead=0
    )
    Ao = specification.observer.polynomial
    numerators = {"u": Ao - design.R, "y": -design.S, "c": design.T}
    # Observer form of (numerator)/Ao: direct part, and what is left over it feeds the states.
    A = np.array([[-Ao[1], 1.0], [-Ao[2], 0.0]])
    B = np.column_stack(
        [numerator[1:] - Ao[1:] * numerator[0] for numerator in numerators.values()]
    )
    F, G = linear_advance(specification.time_domain, A, B)
    inputs = np.vstack([columns.applied, columns.force, command_input])
    following: FloatArray = F @ columns.block("observer") + G @ inputs
    command = (
        columns.block("observer")[0]
        + numerators["y"][0] * columns.force
        + numerators["c"][0] * command_input
    )
    # At rest y = u_c and u = 0: the first state cancels the direct part, the second holds it.
    first = design.S[0] - design.T[0]
    drive = float(B[0, 1] + B[0, 2])
    return LinearController(
        time_domain=specification.time_domain,
        columns=columns,
        following={"observer": following, "prefilter": reference.following()},
        command=command,
        signals={"desired_force": reference.desired(ahead=0)},
        rest={"observer": np.array([first, Ao[1] * first - drive]), **REST},
    )
