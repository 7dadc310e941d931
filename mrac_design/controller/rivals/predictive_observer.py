"""Predictive force control on a plant whose disturbance an active observer cancels.

    u = v − p̂,     Δv = (GᵀG + λ I)⁻¹ Gᵀ (r − f)

The observer gives the state and the disturbance p̂; the receding-horizon law then moves the
remaining command v, so that the heart's motion costs no increments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.observation import (
    SampledModel,
    difference_chain,
    kalman_gain,
    observer_rows,
    pending_block,
    sampled_plant,
)
from mrac_design.controller.rivals.prediction import Horizon, horizon_gains
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictiveObserver:
    """Predictive control with an active observer, fully specified for one axis."""

    plant: ForcePlant
    """Plant of the design."""
    horizon: Horizon
    """Cost horizon, counted from the instant the command acts, and penalty on Δv."""
    order: int
    """N: the disturbance's N-th difference is white."""
    drive: float
    """Standard deviation of that N-th difference (m/s²)."""
    force_noise: float
    """Standard deviation of the force sensor's noise (N); only its ratio to `drive` matters."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    time_domain: Discrete
    """Sampling."""
    delay: int
    """Dead time in whole samples."""

    def __post_init__(self) -> None:
        if not 0 < self.drive < float("inf"):
            raise ParameterError("drive", self.drive, "must be finite and > 0")


def predictive_observer(specification: PredictiveObserver) -> LinearController:
    """The controller's equations."""
    domain, delay = specification.time_domain, specification.delay
    horizon = specification.horizon
    plant = sampled_plant(specification.plant, domain, delay=delay)
    augmented = plant.with_disturbance(*difference_chain(specification.order))
    drive = np.zeros((augmented.order, 1))
    drive[-1] = specification.drive
    columns = Columns(
        Layout(
            (
                ("estimate", augmented.order),
                *pending_block("pending", delay),
                ("effective", 1),
                PREFILTER,
            )
        )
    )
    reference = ReferenceRows(specification.prefilter, domain, columns)
    observer = observer_rows(
        columns,
        augmented,
        kalman_gain(augmented, drive, specification.force_noise),
        estimate="estimate",
        pending="pending",
        command=columns.applied,
    )
    state, disturbance = observer.ahead[: plant.order], observer.ahead[plant.order]
    held = columns.block("effective")[0]
    free, step = _responses(plant, state, held, horizon.last)
    counted = range(horizon.first, horizon.last + 1)
    target = np.array([reference.desired(ahead=delay + j) for j in counted])
    effective = held + horizon_gains(step, horizon) @ (target - free[horizon.first - 1 :])
    return LinearController(
        time_domain=domain,
        columns=columns,
        following={
            "estimate": observer.following,
            "effective": (columns.applied + disturbance)[None, :],
            "prefilter": reference.following(),
        },
        registers={"pending": columns.applied} if delay else {},
        command=effective - disturbance,
        signals={"desired_force": reference.desired(ahead=0), "disturbance_estimate": disturbance},
        rest={
            "estimate": np.eye(augmented.order)[0],
            "effective": 0.0,
            **({"pending": 0.0} if delay else {}),
            **REST,
        },
    )


def _responses(
    plant: SampledModel, state: FloatArray, held: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Rows of y(1 … count) with v held, and the response to a unit step of v at 0 … count."""
    free, step, moved = [], [0.0], np.zeros(plant.order)
    for _ in range(count):
        state = plant.transition @ state + np.outer(plant.input, held)
        moved = plant.transition @ moved + plant.input
        free.append(plant.output @ state)
        step.append(float(plant.output @ moved))
    return np.array(free), np.array(step)
