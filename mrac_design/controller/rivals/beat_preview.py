"""Receding-horizon control with the last heart cycle as a preview, aligned by the ECG [Bebek 2007].

    u = u_r − L (x̂ − x_r) − Σ_j f_j p(k + j) − p̂

The disturbance p is remembered over the age of the beat: cells of equal width filled during the
last cycles. An R peak sets the age back to zero, so what is read ahead follows the beats however
long they are. L and f_j are the linear-quadratic feedback and preview; p̂ is what an observer
finds beside the remembered part, and what the cells learn from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import control
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.assembly import StepSymbols, assemble_step
from mrac_design.controller.rivals.linear import Columns
from mrac_design.controller.rivals.observation import (
    SampledModel,
    difference_chain,
    kalman_gain,
    pending_block,
    sampled_plant,
)
from mrac_design.controller.rivals.reference_rows import PREFILTER, ReferenceRows
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete

EVENTS = Layout((("beat_age", 1),))
"""What it measures beside the force: time since the last R peak (s)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BeatPreview:
    """ECG-assisted receding-horizon control, fully specified for one axis."""

    plant: ForcePlant
    """Plant of the design."""
    penalty: float
    """Weight of the squared command against the squared force error ((N/(m/s²))²), > 0."""
    preview: int
    """Number of samples of preview, from the instant the command acts."""
    cell_width: float
    """Width of the memory's cells (s), not below a sampling period."""
    longest_beat: float
    """Age up to which cells exist (s); older ages read the last cell."""
    learning: float
    """Share of what the observer finds that a cell takes over in one beat, 0 to 1."""
    lag: float
    """Age correction for the observer's own lag (s), ≥ 0."""
    drive: float
    """Standard deviation of the change of the residual disturbance from sample to sample
    (m/s²)."""
    force_noise: float
    """Standard deviation of the force sensor's noise (N)."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    time_domain: Discrete
    """Sampling."""
    delay: int
    """Dead time in whole samples."""

    def __post_init__(self) -> None:
        for name in ("penalty", "drive", "force_noise"):
            if not 0 < getattr(self, name) < float("inf"):
                raise ParameterError(name, getattr(self, name), "must be finite and > 0")
        if not self.time_domain.period <= self.cell_width < 0.5 * self.longest_beat:
            raise ParameterError("cell width", self.cell_width, "must be from a period to half "
                                 "the longest beat")  # fmt: skip
        if not 0 <= self.learning <= 1 or not self.lag >= 0 or self.preview < 1:
            raise ParameterError("learning", self.learning, "0 to 1, with lag >= 0, preview >= 1")

    @property
    def cells(self) -> int:
        """Number of cells of the memory."""
        return int(np.ceil(self.longest_beat / self.cell_width)) + 1


def quadratic_gains(
    model: SampledModel, penalty: float, preview: int
) -> tuple[FloatArray, FloatArray]:
    """Feedback L (n,) and preview gains f (preview,) that minimise Σ y² + penalty u².

    f_j = (R + ΓᵀPΓ)⁻¹ Γᵀ (Φ − ΓL)ᵀʲ P Γ weighs a disturbance at the input, known j ahead.
    """
    Γ = model.input[:, None]
    weight = np.outer(model.output, model.output)
    L, P, _ = control.dlqr(model.transition, Γ, weight, np.array([[penalty]]))
    closed = (model.transition - Γ @ L).T
    scale = penalty + float((Γ.T @ P @ Γ)[0, 0])
    gains, ahead = [], P @ Γ
    for _ in range(preview):
        gains.append(float((Γ.T @ ahead)[0, 0]) / scale)
        ahead = closed @ ahead
    return readonly(np.asarray(L).ravel()), readonly(gains)


def beat_preview_step(specification: BeatPreview) -> ControllerStep:
    """The controller as CasADi functions, with the beat's age as an event."""
    layout = _layout(specification)
    values = _parameter_values(specification)
    parameters = Layout(tuple((name, int(value.size)) for name, value in values.items()))
    step = StepSymbols.of(layout, parameters, EVENTS)
    state, symbols = layout.split(step.state), parameters.split(step.parameters)
    columns = ca.vertcat(state["prefilter"], step.force, step.reference)
    force, applied, age = step.force, step.applied, step.events

    filtered = state["estimate"] + symbols["kalman"] * (force - state["estimate"][0])
    waiting = ca.vertsplit(state["pending"]) if specification.delay else []
    # The age kept from the last sample serves the command; a new beat shows one sample later.
    ages = [state["age"] + j * symbols["period"] for j in range(_reach(specification))]
    memory = [_remembered(symbols, state, instant) for instant in ages]
    met = filtered
    for command_on_its_way, known in zip(reversed(waiting), memory, strict=False):
        met = _advanced(symbols, met, command_on_its_way + known)
    coming = ca.vertcat(*memory[specification.delay :])
    command = (
        _rows(symbols["wanted"], columns)
        - ca.dot(symbols["feedback"], met[:2])
        - ca.dot(symbols["preview"], coming)
        - met[2]
    )
    now = _remembered(symbols, state, age)
    following = {
        "estimate": _advanced(symbols, filtered, (waiting[-1] if waiting else applied) + now),
        "cells": _taught(symbols, state, age - symbols["lag"], filtered[2]),
        "age": age + symbols["period"],
        # An age below the expected one is a new beat: the last one was that long.
        "interval": ca.if_else(
            age < state["age"] - symbols["period"] / 2, state["age"], state["interval"]
        ),
        "prefilter": _rows(symbols["prefilter"], columns),
    }
    if waiting:
        following["pending"] = ca.vertcat(applied, *waiting[:-1])
    resting = {name: ca.SX.zeros(length) for name, length in layout.blocks}
    resting |= {"estimate": ca.vertcat(force, 0, 0), "prefilter": ca.vertcat(0, force)}
    return assemble_step(
        step,
        time_domain=specification.time_domain,
        values=parameters.pack(values),
        command=command,
        following=following,
        signals={
            "desired_force": state["prefilter"][1],
            "disturbance_estimate": filtered[2] + now,
        },
        rest=layout.join(resting),
    )


def _layout(specification: BeatPreview) -> Layout:
    return Layout(
        (
            ("estimate", 3),
            *pending_block("pending", specification.delay),
            ("cells", specification.cells),
            ("age", 1),
            ("interval", 1),
            PREFILTER,
        )
    )


def _parameter_values(specification: BeatPreview) -> dict[str, FloatArray]:
    domain, delay = specification.time_domain, specification.delay
    plant = sampled_plant(specification.plant, domain, delay=delay)
    augmented = plant.with_disturbance(*difference_chain(1))
    drive = np.array([[0.0], [0.0], [specification.drive]])
    L, preview = quadratic_gains(plant, specification.penalty, specification.preview)
    columns = Columns(Layout((PREFILTER,)))
    rows = ReferenceRows(specification.prefilter, domain, columns)
    ahead = rows.ahead(delay)
    damping, stiffness = specification.prefilter.polynomial[1:]
    acceleration = stiffness * (columns.reference - ahead[1]) - damping * ahead[0]
    # u_r holds the plant on the desired force; L pulls back to force and rate together.
    wanted = (acceleration + specification.plant.velocity_gain * ahead[0]) / specification.plant.b0
    wanted = wanted + L[0] * ahead[1] + L[1] * ahead[0]
    values = {
        "kalman": kalman_gain(augmented, drive, specification.force_noise),
        "transition": augmented.transition,
        "input": augmented.input,
        "feedback": L,
        "preview": preview,
        "wanted": wanted[:-1],  # without the applied command's column, which is zero
        "prefilter": rows.following()[:, :-1],
        "period": domain.period,
        "cell_width": specification.cell_width,
        "lag": specification.lag,
        # A cell meets about width/period samples, weighted by a hat whose square sums to 2/3.
        "learning": specification.learning * 1.5 * domain.period / specification.cell_width,
    }
    return {name: readonly(np.ravel(value)) for name, value in values.items()}


def _reach(specification: BeatPreview) -> int:
    """Number of samples from now on for which the memory is read."""
    return specification.delay + specification.preview


def _rows(coefficients: ca.SX, columns: ca.SX) -> ca.SX:
    """Rows of coefficients, stored one after the other, times the columns."""
    return ca.reshape(coefficients, columns.numel(), -1).T @ columns


def _advanced(symbols: Mapping[str, ca.SX], estimate: ca.SX, command: ca.SX) -> ca.SX:
    return _rows(symbols["transition"], estimate) + symbols["input"] * command


def _hats(position: ca.SX, count: int) -> ca.SX:
    """Weights of linear interpolation at `position`, counted in cells."""
    return ca.fmax(0, 1 - ca.fabs(position - ca.DM(range(count))))


def _remembered(symbols: Mapping[str, ca.SX], state: Mapping[str, ca.SX], age: ca.SX) -> ca.SX:
    """Remembered disturbance at an age of the beat (m/s²).

    Past the length of the last beat it stays at the value there, where the next beat joins on.
    """
    cells = state["cells"]
    known = ca.fmin(state["interval"] / symbols["cell_width"], cells.numel() - 1)
    position = ca.fmin(age / symbols["cell_width"], known)
    return ca.dot(_hats(position, cells.numel()), cells)


def _taught(
    symbols: Mapping[str, ca.SX], state: Mapping[str, ca.SX], age: ca.SX, residual: ca.SX
) -> ca.SX:
    """The cells after one more sample: those near `age` move towards what was found there."""
    found = _remembered(symbols, state, age) + residual
    share = symbols["learning"] * _hats(age / symbols["cell_width"], state["cells"].numel())
    return state["cells"] + share * (found - state["cells"])
