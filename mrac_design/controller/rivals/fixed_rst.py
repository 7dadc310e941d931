r"""The RST controller with fixed gains, as rows of numbers: the honest non-adaptive rival.

    R u = T u_c − S y,   R = (p + r1) D,   T = (ω²/b0) Ao

realised as Ao u = (Ao − R) u_applied + T u_c − S y, so a saturated command cannot wind up what D
integrates [AW §3.2, eq. 5.64 ff.].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.advance import linear_advance
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import ReferenceModel, RSTDesign
from mrac_design.layout import Layout
from mrac_design.time_domain import TimeDomain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixedRST:
    """An RST controller, fully specified for one axis."""

    design: RSTDesign
    """R, S, T and the observer polynomial."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    feedforward: ReferenceFeedforward
    """What enters the loop as u_c."""
    time_domain: TimeDomain
    """Continuous, or the continuous controller held exactly over each period."""


def fixed_rst(controller: FixedRST) -> LinearController:
    """The controller's equations."""
    design, specification = controller.design, controller.design.specification
    order = specification.degree
    columns = Columns(Layout((("observer", order), PREFILTER)))
    reference = ReferenceRows(controller.prefilter, controller.time_domain, columns)
    command_input = reference.input(controller.feedforward, specification.reference_model, ahead=0)
    Ao = np.array(specification.observer)
    numerators = {"u": Ao - design.R, "y": -design.S, "c": design.T}
    # Observer form of (numerator)/Ao: direct part, and what is left over it feeds the states.
    A = np.eye(order, k=1)
    A[:, 0] = -Ao[1:]
    B = np.column_stack(
        [numerator[1:] - Ao[1:] * numerator[0] for numerator in numerators.values()]
    )
    F, G = linear_advance(controller.time_domain, A, B)
    inputs = np.vstack([columns.applied, columns.force, command_input])
    following: FloatArray = F @ columns.block("observer") + G @ inputs
    command = (
        columns.block("observer")[0]
        + numerators["y"][0] * columns.force
        + numerators["c"][0] * command_input
    )
    return LinearController(
        time_domain=controller.time_domain,
        columns=columns,
        following={"observer": following, "prefilter": reference.following()},
        command=command,
        signals={"desired_force": reference.desired(ahead=0)},
        # At rest y = u_c and u = 0: what the states hold makes up for the direct parts.
        rest={"observer": np.linalg.solve(-A, B[:, 1] + B[:, 2]), **REST},
    )
