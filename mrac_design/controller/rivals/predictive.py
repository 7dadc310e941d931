"""Predictive force control and generalised predictive control with a motion predictor.

Predictive force control [Dominici 2008] is the receding-horizon law with past and current forces
and Δ = 1 − q⁻¹. Against the heart, the law of [Ginhoux 2005] adds both parts of a motion
predictor: breathing through Δ = (1 − q⁻¹)(1 − q⁻ᵀ), T samples a breath, and the beat through an
observer of its harmonics whose forecast the law treats as known. That observer can take the breath
too: where T is thousands of samples, its first harmonics keep a state of a few numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import readonly
from mrac_design.controller.rivals.harmonics import RhythmObserver, rhythm_observer_rows
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.observation import sampled_plant
from mrac_design.controller.rivals.prediction import ArimaxModel, Horizon, horizon_gains
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictiveControl:
    """A receding-horizon force controller, fully specified for one axis."""

    plant: ForcePlant
    """Process model."""
    horizon: Horizon
    """Cost horizon and penalty."""
    observer_poles: tuple[float, ...]
    """Roots of the noise polynomial C, real, |p| < 1; none makes C = 1."""
    breath: int | None
    """Breathing period T in samples, whose motion the model then expects; None leaves it out."""
    rhythms: RhythmObserver | None
    """Observer of harmonics of beat and breath; None leaves them unpredicted."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    time_domain: Discrete
    """Sampling."""
    delay: int
    """Dead time in whole samples."""

    def __post_init__(self) -> None:
        if not all(abs(pole) < 1.0 for pole in self.observer_poles):
            raise ParameterError("observer poles", self.observer_poles, "must have |p| < 1")
        if self.breath is not None and self.breath <= self.horizon.last + self.delay + 3:
            raise ParameterError("breath", self.breath, "must be longer than the horizon")


def predictive_model(specification: PredictiveControl) -> ArimaxModel:
    """The model the controller predicts with."""
    plant = sampled_plant(specification.plant, specification.time_domain, delay=0)
    Φ, Γ, C = plant.transition, plant.input, plant.output
    trace = float(np.trace(Φ))
    difference = np.array([1.0, -1.0])
    if specification.breath is not None:
        repetition = np.zeros(specification.breath + 1)
        repetition[[0, -1]] = 1.0, -1.0
        difference = np.convolve(difference, repetition)
    return ArimaxModel(
        A=readonly([1.0, -trace, np.linalg.det(Φ)]),
        B=readonly([C @ Γ, C @ (Φ @ Γ - trace * Γ)]),  # by Cayley–Hamilton
        C=readonly(np.poly(specification.observer_poles)),
        difference=readonly(difference),
        delay=specification.delay,
    )


def predictive_control(specification: PredictiveControl) -> LinearController:
    """The controller's equations."""
    model, horizon = predictive_model(specification), specification.horizon
    gains = horizon_gains(model.step_response(horizon.last), horizon)
    columns = Columns(_layout(specification, model))
    reference = ReferenceRows(specification.prefilter, specification.time_domain, columns)
    counted = range(horizon.first, horizon.last + 1)
    target = np.array([reference.desired(ahead=j) for j in counted])
    output, following, signals = columns.force, {"prefilter": reference.following()}, {}
    if specification.rhythms is not None:
        periodic = rhythm_observer_rows(
            columns, specification.rhythms, specification.plant, specification.time_domain,
            delay=model.delay, command=columns.applied,
        )  # fmt: skip
        # The law sees the force without its rhythms and aims beside it by what is to come of them.
        output = columns.force - periodic.forecast(0)
        target = target - np.array([periodic.forecast(j) for j in counted])
        following |= periodic.following
        signals = {"periodic_force": periodic.forecast(0)}

    outputs, inputs = columns.block("forces"), columns.block("commands")
    registers = {"forces": output, "commands": columns.applied}
    errors = np.empty((0, columns.size))
    if model.error_memory:
        past = columns.block("errors")
        registers["errors"] = model.prediction_error(output, outputs, inputs, past)
        errors = np.vstack([registers["errors"], past])
    free = model.free_response(np.vstack([output, outputs]), inputs, errors, horizon.last)
    increment = gains @ (target - free[horizon.first - 1 :])
    rest = dict.fromkeys(registers, 0.0) | {"forces": 1.0}
    if specification.rhythms is not None:
        rest["rhythm_observer"] = np.eye(specification.rhythms.size)[0]
    return LinearController(
        time_domain=specification.time_domain,
        columns=columns,
        following=following,
        registers=registers,
        command=model.held_input(inputs) + increment,
        signals={"desired_force": reference.desired(ahead=0), **signals},
        rest={**rest, **REST},
    )


def _layout(specification: PredictiveControl, model: ArimaxModel) -> Layout:
    blocks = [("forces", model.output_memory), ("commands", model.input_memory)]
    if model.error_memory:
        blocks.append(("errors", model.error_memory))
    if specification.rhythms is not None:
        blocks.append(("rhythm_observer", specification.rhythms.size))
    return Layout((*blocks, PREFILTER))
