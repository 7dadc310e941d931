"""Active observers: state feedback that cancels an estimated disturbance [Cortesão 2009].

    u = L1 u_c − L x̂ − p̂

A Kalman filter estimates the plant's state x and a disturbance p at its input, whose N-th
difference is taken for white noise; L places the poles critically damped with time constant τ.
Dead time enters by augmenting the state with the commands on their way. A second observer may
close an outer loop around the first: it sees the first loop from its reference to the force and
cancels, at that input, what the first one left.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.observation import (
    SampledModel,
    difference_chain,
    kalman_gain,
    observer_rows,
    pending_block,
    sampled_plant,
)
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverTuning:
    """What one active observer is tuned by."""

    order: int
    """N: the disturbance's N-th difference is white."""
    time_constant: float
    """τ of the critically damped loop (s)."""
    drive: float
    """Standard deviation of that N-th difference, in the input's unit."""
    input_noise: float
    """Standard deviation of white noise at the input, in its unit; 0 trusts the model fully."""
    force_noise: float
    """Standard deviation of the force sensor's noise (N); only its ratio to `drive` matters."""

    def __post_init__(self) -> None:
        for name in ("time_constant", "drive", "force_noise"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ParameterError(name.replace("_", " "), value, "must be finite and > 0")
        if not 0 <= self.input_noise < float("inf"):
            raise ParameterError("input noise", self.input_noise, "must be finite and >= 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveObserver:
    """One active observer, or two in cascade, fully specified for one axis."""

    plant: ForcePlant
    """Plant of the design."""
    force_loop: ObserverTuning
    """The observer around the plant; its drive is in m/s²."""
    motion_loop: ObserverTuning | None
    """The observer around the force loop, its drive in N; None for a single observer."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    feedforward: ReferenceFeedforward
    """What enters the loop as u_c."""
    time_domain: Discrete
    """Sampling."""
    delay: int
    """Dead time in whole samples."""


def state_feedback(model: SampledModel, domain: Discrete, time_constant: float) -> FloatArray:
    """L that puts every pole of Φ − Γ L at exp(−h/τ), (n,)."""
    pole = np.exp(-domain.period / time_constant)
    gain = control.acker(model.transition, model.input[:, None], [pole] * model.order)
    return readonly(np.asarray(gain).ravel())


def observed_disturbance_gain(model: SampledModel, tuning: ObserverTuning) -> FloatArray:
    """Kalman gain of the model with the tuning's disturbance at its input, (n + N,)."""
    augmented = model.with_disturbance(*difference_chain(tuning.order))
    drive = np.column_stack(
        [tuning.input_noise * augmented.input, tuning.drive * np.eye(augmented.order)[-1]]
    )
    return kalman_gain(augmented, drive, tuning.force_noise)


def active_observer(specification: ActiveObserver) -> LinearController:
    """The controller's equations."""
    domain, inner = specification.time_domain, specification.force_loop
    plant = sampled_plant(specification.plant, domain, delay=specification.delay)
    columns = Columns(_layout(specification))
    reference = ReferenceRows(specification.prefilter, domain, columns)
    outer = specification.motion_loop
    # The loop answers like (1/(τ p + 1))², which the feedforward may invert.
    slowest = inner if outer is None else outer
    answer = ReferenceModel(bandwidth=1.0 / slowest.time_constant, damping=1.0)
    wanted = reference.input(specification.feedforward, answer, ahead=specification.delay)

    following = {"prefilter": reference.following()}
    registers: dict[str, FloatArray] = {}
    if outer is not None:
        # Seen from outside, the force loop is the plant with its poles moved.
        L = state_feedback(plant, domain, inner.time_constant)
        closed = SampledModel(
            transition=plant.transition - np.outer(plant.input, L),
            input=plant.input * L[0],
            output=plant.output,
            delay=plant.delay,
        )
        wanted = _level(
            columns, closed, domain, outer, "motion_", wanted, None, following, registers
        )
    command = _level(
        columns, plant, domain, inner, "", wanted, columns.applied, following, registers
    )
    estimate = columns.block("estimate")
    rest = {name: np.eye(length)[0] for name, length in columns.state.blocks if "estimate" in name}
    # Commands of the outer loop are forces, which stay at the reference; those of the inner fade.
    pending = {name: 0.0 if name == "pending" else 1.0 for name in registers}
    return LinearController(
        time_domain=domain,
        columns=columns,
        following=following,
        registers=registers,
        command=command,
        signals={"desired_force": reference.desired(ahead=0), "disturbance_estimate": estimate[2]},
        rest={**pending, **rest, **REST},
    )


def _level(
    columns: Columns,
    model: SampledModel,
    domain: Discrete,
    tuning: ObserverTuning,
    prefix: str,
    wanted: FloatArray,
    applied: FloatArray | None,
    following: dict[str, FloatArray],
    registers: dict[str, FloatArray],
) -> FloatArray:
    """Row of u = L1 u_c − L x̂ − p̂ of one observer; adds how its blocks advance."""
    L = state_feedback(model, domain, tuning.time_constant)
    augmented = model.with_disturbance(*difference_chain(tuning.order))
    names = {"estimate": f"{prefix}estimate", "pending": f"{prefix}pending"}
    gain = observed_disturbance_gain(model, tuning)

    def rows(command: FloatArray) -> tuple[FloatArray, FloatArray]:
        observer = observer_rows(columns, augmented, gain, command=command, **names)
        n = model.order
        # L1 = L[0] makes the static gain one, since x = (y, 0) at rest.
        static = L[0] if model.transition[0, 0] == 1.0 else 1.0 + L[0]
        law = static * wanted - L @ observer.ahead[:n] - observer.ahead[n]
        return law, observer.following

    own, _ = rows(np.zeros(columns.size))
    acting = own if applied is None else applied
    following[names["estimate"]] = rows(acting)[1]
    if model.delay:
        registers[names["pending"]] = acting
    return own


def _layout(specification: ActiveObserver) -> Layout:
    delay = specification.delay
    blocks = [("estimate", 2 + specification.force_loop.order), *pending_block("pending", delay)]
    if specification.motion_loop is not None:
        blocks.append(("motion_estimate", 2 + specification.motion_loop.order))
        blocks.extend(pending_block("motion_pending", delay))
    return Layout((*blocks, PREFILTER))
