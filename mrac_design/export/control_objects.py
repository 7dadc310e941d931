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

_FACTOR_TOLERANCE = 1e-12
"""Of the terms of R's coefficients: each is the rounded sum of two products."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopPieces:
    """The design as continuous transfer functions."""

    plant: control.TransferFunction
    """Ks/(p(p + K2)), command (m/s²) to force (N)."""
    reference_model: control.TransferFunction
    """ω²/Am, u_c to the wanted force."""
    observer: control.TransferFunction
    """1/Ao, the poles the reference does not excite."""
    internal_model: control.TransferFunction
    """1/D, of what R is made beside p + r1; 1 without internal model."""
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
        observer=control.TransferFunction([1.0], specification.observer),
        internal_model=control.TransferFunction([1.0], specification.internal_model),
        prefilter=None if gains.prefilter is None else gains.prefilter.transfer_function(),
        feedback=control.TransferFunction(design.S, design.R),
        feedforward=control.TransferFunction(design.T, design.R),
    )


def redesigned(gains: GainSet, pieces: LoopPieces) -> GainSet:
    """`gains` with design and coefficients taken from python-control's transfer functions.

    The adapted gains start from the new design's own if they started from the old one's. With
    `loop_pieces(gains)` unchanged it gives `gains` again, exactly for ω and ξ of up to 15
    digits: a polynomial holds only ω² and 2ξω, rounded. Raises ParameterError
    for pieces of other shapes, for S/R and T/R that do not place the poles, and for an observer
    of another degree when the gains start from numbers of their own.
    """
    model = _model(pieces.reference_model)
    Ao = _reciprocal("observer", pieces.observer)
    D = _reciprocal("internal model", pieces.internal_model)
    R, S = _ratio("S/R", pieces.feedback, len(Ao))
    also_R, T = _ratio("T/R", pieces.feedforward, len(Ao))
    if not np.array_equal(R, also_R):
        raise ParameterError("R", (R.tolist(), also_R.tolist()), "must be the same in S/R and T/R")
    specification = RSTSpecification(
        plant=ForcePlant.from_transfer_function(pieces.plant),
        reference_model=model,
        observer=Ao,
        internal_model=D,
    )
    own = gains.initial_gains == tuple(gains.design.scaled_parameters.tolist())
    changed = replace(
        gains,
        specification=specification,
        coefficients=(_own_pole(R, np.array(D)), *S.tolist(), *T.tolist()),
        initial_gains=(0.0,) * len(specification.gain_names) if own else gains.initial_gains,
        prefilter=None if pieces.prefilter is None else _model(pieces.prefilter),
    )
    if not own:
        return changed
    return replace(changed, initial_gains=tuple(changed.design.scaled_parameters.tolist()))


def _own_pole(R: FloatArray, D: FloatArray) -> float:
    """r1 of R = (p + r1) D; raises ParameterError when D is no factor of R."""
    r1 = float(R[1] - np.append(D, 0.0)[1])
    terms = np.convolve([1.0, abs(r1)], np.abs(D))
    if np.any(np.abs(np.convolve([1.0, r1], D) - R) > _FACTOR_TOLERANCE * terms):
        raise ParameterError("R", R.tolist(), f"must have the internal model {D.tolist()} in it")
    return r1


def frozen_state_space(gains: GainSet) -> control.StateSpace:
    """The frozen controller in observer form, inputs (u_c, y) in N, output u in m/s²; as many
    states as Ao has roots."""
    R, S, T = gains.design.R, gains.design.S, gains.design.T
    n = len(R) - 1
    A = np.eye(n, k=1)
    A[:, 0] = -R[1:]
    return control.StateSpace(
        A,
        np.column_stack([T[1:] - R[1:] * T[0], R[1:] * S[0] - S[1:]]),
        np.eye(1, n),
        [[T[0], -S[0]]],
        inputs=["command_input", "force"],
        outputs=["command"],
        states=[f"rst{i}" for i in range(n)],
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


def _ratio(name: str, system: control.TransferFunction, size: int) -> tuple[FloatArray, FloatArray]:
    """Denominator and numerator of `size` coefficients each, as they are."""
    numerator, denominator = system.num[0][0], system.den[0][0]
    if system.dt != 0 or not len(numerator) == len(denominator) == size or denominator[0] != 1.0:
        raise ParameterError(
            name,
            system,
            f"must be continuous, numerator and monic denominator of the observer's degree "
            f"{size - 1}",
        )
    return denominator, numerator


def _reciprocal(name: str, system: control.TransferFunction) -> tuple[float, ...]:
    """Monic denominator of a transfer function whose numerator is 1."""
    numerator, denominator = system.num[0][0], system.den[0][0]
    if system.dt not in (0, None) or len(numerator) != 1 or numerator[0] != 1.0:
        raise ParameterError(name, system, "must be 1 over a monic polynomial, continuous")
    return tuple(denominator.tolist())


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
