"""A tuned controller as python-control objects, and the way back from those to gains.

    uc ─► T/R ─►(+)─► u        pieces of the frozen loop: transfer functions
    y ──► S/R ──►(−)

The adaptive controller is a nonlinear system; its parameters are those of the step itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import control
import numpy as np
from flint import fmpq

from mrac_design.arrays import FloatArray
from mrac_design.controller.adaptive import build_step
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel, RSTSpecification
from mrac_design.errors import ParameterError
from mrac_design.export.gain_set import GainSet, controller_of
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.rationals import decimal_rational, nearest_float
from mrac_design.time_domain import TimeDomain

_NEIGHBOURS = 3
"""How many floats to either side rounding can have led astray."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopPieces:
    """The design as continuous transfer functions."""

    plant: control.TransferFunction
    """Ks/(p(p + K2)), command (m/s²) to force (N)."""
    reference_model: control.TransferFunction
    """ω²/Am, u_c to the wanted force."""
    observer: control.TransferFunction
    """1/Ao, the poles the reference does not excite."""
    prefilter: control.TransferFunction | None
    """From the force reference to the desired force; none: a wire."""
    feedback: control.TransferFunction
    """S/R, force (N) to minus the command (m/s²)."""
    feedforward: control.TransferFunction
    """T/R, u_c (N) to the command (m/s²)."""


def loop_pieces(gains: GainSet) -> LoopPieces:
    """The pieces of the frozen loop."""
    design, specification = gains.design, gains.specification
    return LoopPieces(
        plant=specification.plant.transfer_function(),
        reference_model=specification.reference_model.transfer_function(),
        observer=control.TransferFunction([1.0], [1.0, specification.observer_pole]),
        prefilter=None if gains.prefilter is None else gains.prefilter.transfer_function(),
        feedback=control.TransferFunction(design.S, design.R),
        feedforward=control.TransferFunction(design.T, design.R),
    )


def redesigned(gains: GainSet, pieces: LoopPieces) -> GainSet:
    """`gains` with design and coefficients taken from python-control's transfer functions.

    The adapted gains start from the new design's own if they started from the old one's. With
    `loop_pieces(gains)` unchanged it gives `gains` again, exactly for ω and ξ of up to 15
    digits: a polynomial holds only ω² and 2ξω, rounded. Raises ParameterError
    for pieces of other shapes and for S/R and T/R that do not place the poles.
    """
    model = _model(pieces.reference_model)
    R, S = _ratio("S/R", pieces.feedback)
    also_R, T = _ratio("T/R", pieces.feedforward)
    if not np.array_equal(R, also_R):
        raise ParameterError("R", (R.tolist(), also_R.tolist()), "must be the same in S/R and T/R")
    one, Ao = pieces.observer.num[0][0], pieces.observer.den[0][0]
    if len(one) != 1 or len(Ao) != 2 or one[0] != 1.0 or Ao[0] != 1.0:
        raise ParameterError("observer", pieces.observer, "must be 1/(p + ao)")
    changed = replace(
        gains,
        specification=RSTSpecification(
            plant=ForcePlant.from_transfer_function(pieces.plant),
            reference_model=model,
            observer_pole=float(Ao[1]),
        ),
        coefficients=tuple(float(value) for value in (R[1], *S, *T)),
        prefilter=None if pieces.prefilter is None else _model(pieces.prefilter),
    )
    if gains.initial_gains != tuple(gains.design.scaled_parameters.tolist()):
        return changed
    return replace(changed, initial_gains=tuple(changed.design.scaled_parameters.tolist()))


def frozen_state_space(gains: GainSet) -> control.StateSpace:
    """The frozen controller, inputs (u_c, y) in N, output u in m/s²; one state."""
    r1, s0, s1, t0, t1 = gains.coefficients
    return control.StateSpace(
        [[-r1]],
        [[t1 - r1 * t0, -(s1 - r1 * s0)]],
        [[1.0]],
        [[t0, -s0]],
        inputs=["command_input", "force"],
        outputs=["command"],
        states=["rst"],
        name="frozen_rst",
    )


def adaptive_system(gains: GainSet, time_domain: TimeDomain) -> control.NonlinearIOSystem:
    """The adaptive controller of one axis, inputs (force, reference) in N, output command (m/s²).

    Its `params` are the step's parameters by name, so a simulation can change any of them. The
    command is taken as applied. Its state at rest is that of `build_step(...).equilibrium`.
    """
    step = build_step(controller_of(gains, time_domain))
    names = step.parameters.entry_names
    update, output = _compiled(step)

    def packed(parameters: dict[str, float]) -> FloatArray:
        return np.array([parameters[name] for name in names])

    def updated(_: float, x: Any, u: Any, parameters: dict[str, float]) -> FloatArray:
        return update(x, u[0], u[1], packed(parameters)).full().ravel()

    def command(_: float, x: Any, u: Any, parameters: dict[str, float]) -> FloatArray:
        return output(x, u[0], u[1], packed(parameters)).full().ravel()

    return control.nlsys(
        updated,
        command,
        inputs=["force", "reference"],
        outputs=["command"],
        states=list(step.state.entry_names),
        params=dict(zip(names, step.parameter_values.tolist(), strict=True)),
        dt=time_domain.dt,
        name="adaptive_rst",
    )


def _compiled(step: ControllerStep) -> tuple[ca.Function, ca.Function]:
    """(state, force, reference, parameters) → following state; → command."""
    x, p = step.state.symbols("state"), step.parameters.symbols("parameters")
    force, reference = ca.SX.sym("force"), ca.SX.sym("reference")
    command = step.command(x, force, reference, p)
    following, _ = step.advance(x, force, reference, command, p)
    arguments = [x, force, reference, p]
    return ca.Function("update", arguments, [following]), step.command


def _ratio(name: str, system: control.TransferFunction) -> tuple[FloatArray, FloatArray]:
    """Denominator and numerator of (a p + b)/(p + r1), as they are."""
    numerator, denominator = system.num[0][0], system.den[0][0]
    if system.dt != 0 or len(numerator) != 2 or len(denominator) != 2 or denominator[0] != 1.0:
        raise ParameterError(name, system, "must be a continuous (a p + b)/(p + r1)")
    return denominator, numerator


def _model(system: control.TransferFunction) -> ReferenceModel:
    """The model a transfer function is; of all that round to it, the one written shortest."""
    rough = ReferenceModel.from_transfer_function(system)
    leading, first, last = (float(value) for value in system.den[0][0])
    omega = _shortest(rough.bandwidth, lambda value: value * value, last / leading)
    return ReferenceModel(
        bandwidth=nearest_float(omega),
        damping=nearest_float(
            _shortest(rough.damping, lambda value: 2 * value * omega, first / leading)
        ),
    )


def _shortest(rough: float, image: Callable[[fmpq], fmpq], wanted: float) -> fmpq:
    """Of the few floats about `rough` whose image rounds to `wanted`, the shortest decimal."""
    near = [rough]
    for direction in (0.0, math.inf):
        value = rough
        for _ in range(_NEIGHBOURS):
            value = math.nextafter(value, direction)
            near.append(value)
    fitting = [value for value in near if nearest_float(image(decimal_rational(value))) == wanted]
    return decimal_rational(min(fitting, key=lambda value: len(repr(value)), default=rough))
