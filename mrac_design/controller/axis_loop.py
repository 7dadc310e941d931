"""What the judge of stability is told of an adaptive RST controller: numbers, no design."""

from __future__ import annotations

from collections.abc import Iterable

from flint import fmpq

from mrac_design.controller.advance import linear_advance
from mrac_design.controller.filter_chains import chain_equations
from mrac_design.design import RSTDesign, RSTSpecification
from mrac_design.polynomials.rationals import Number, decimal_rational
from mrac_design.stability.adaptive_loop import (
    AdaptiveLoop,
    FilterStep,
    adaptive_loop,
    filter_step,
)
from mrac_design.time_domain import Discrete


def axis_loop(design: RSTDesign, periods: Iterable[Number] = ()) -> AdaptiveLoop:
    """The closed loop of one axis for the certificates of `mrac_design.stability`.

    `periods` (s) are those the controller may be sampled with; its filters are then described by
    the very numbers it computes with. Plant and bandwidth are read as the decimals they are
    written as, what the controller holds as the binary fractions it holds.
    """
    specification = design.specification
    feedback = specification.degree + 2
    return adaptive_loop(
        design_stiffness=decimal_rational(specification.plant.stiffness),
        velocity_gain=decimal_rational(specification.plant.velocity_gain),
        bandwidth=decimal_rational(specification.reference_model.bandwidth),
        observer=specification.observer,
        internal_model=specification.internal_model,
        gains=design.parameters[:feedback].tolist(),
        gain_scale=design.scaling[:feedback].tolist(),
        filter_steps=[_filter_step(specification, decimal_rational(period)) for period in periods],
    )


def _filter_step(specification: RSTSpecification, period: fmpq) -> FilterStep:
    n = specification.degree
    domain = Discrete(int(period.p) / int(period.q))
    transition, held = linear_advance(domain, *chain_equations(specification))
    return filter_step(period, transition[:n, :n], held[:n, 0])
