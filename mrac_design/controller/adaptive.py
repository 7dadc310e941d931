r"""The adaptive RST controller of one force axis.

    r ─► pre-filter ─► F_d ─► feedforward ─► u_c ─┬─► 1/Ao ─► xc ─► 1/Am ─► zc ─┐
                                                  └─► reference model ─► y_m     ├─► φ
              y ──────────────────────────────────┬─► 1/Ao ─► xy ─► 1/Am ─► zy ──┤
              u ──────────────────────────────────┴─► 1/Ao ─► xu ─► 1/Am ─► zu ──┘

    u = −θᵀ(P1 φ)      ε = (y − y_m) + b0 η      η = −((1/P1) u + φᵀ θ)      dθ/dt = law(φ, ε)

with Q = Ao Am, P1 = Am, P2 = Ao, so P1 φ needs the first-order filters only and there is no
algebraic loop ([AW] section 5.8, Example 5.14). θ = (r1 − ao, s0, s1, t0, t1) and, if wanted, a
constant bias force. With the gain at zero this *is* the frozen RST controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.adaptation import AdaptationLaw, AdaptationSignals
from mrac_design.controller.advance import integral_advance, linear_advance
from mrac_design.controller.assembly import StepSymbols, assemble_step
from mrac_design.controller.oscillator import (
    HarmonicSignals,
    Oscillator,
    harmonic_signals,
    oscillator_advance,
    oscillator_values,
)
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel, RSTDesign
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.time_domain import Discrete, TimeDomain

GAIN_NAMES = ("r1'", "s0", "s1", "t0", "t1", "bias")
"""Entries of the gain vector, in order; r1' = r1 − ao is what adapts [AW 5.71]."""

_STATE = Layout(
    (
        ("filtered_command", 3),
        ("filtered_force", 3),
        ("filtered_reference", 3),
        ("gains", len(GAIN_NAMES)),
        ("model", 2),
        ("prefilter", 2),
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveRST:
    """An adaptive RST controller, fully specified for one axis."""

    design: RSTDesign
    """The nominal design: plant, reference model, observer pole, R, S, T."""
    prefilter: ReferenceModel | None
    """Pre-filter Hm that turns force steps into the desired force F_d [Z 5]; none: F_d = r."""
    law: AdaptationLaw
    """How the gains move; a gain of zero freezes them."""
    feedforward: ReferenceFeedforward
    """What enters the loop as u_c."""
    bias_force: float
    """Size of the constant regressor (N); 0 leaves the bias out."""
    initial_gains: tuple[float, ...]
    """Scaled gains at the start, θ̂(0) = D⁻¹θ(0), 5 values; the design's own are `nominal_gains`."""
    time_domain: TimeDomain
    """Continuous, or sampled with a period."""
    oscillator: Oscillator | None = None
    """Harmonics of a periodic motion as further regressors; none leaves them out."""

    def __post_init__(self) -> None:
        if len(self.initial_gains) != 5 or not np.all(np.isfinite(self.initial_gains)):
            raise ParameterError(
                "initial gains",
                self.initial_gains,
                "needs five finite numbers (r1', s0, s1, t0, t1)",
            )
        if not 0 <= self.bias_force < float("inf"):
            raise ParameterError("bias force", self.bias_force, "must be a finite force >= 0 N")


def nominal_gains(design: RSTDesign) -> tuple[float, ...]:
    """Scaled gains of the design itself, the usual start of the adaptation."""
    return tuple(float(gain) for gain in design.scaled_parameters)


def build_step(controller: AdaptiveRST) -> ControllerStep:
    """The controller as CasADi functions; see `ControllerStep` for shapes and units."""
    values = _parameter_values(controller)
    layout = _layout(controller)
    parameters = Layout(tuple((name, value.size) for name, value in values.items()))
    step = StepSymbols.of(layout, parameters)
    state, symbols = layout.split(step.state), parameters.split(step.parameters)
    force, reference = step.force, step.reference

    reference_signal = _reference_path(state, symbols, reference)
    harmonic = _harmonic_signals(controller, state, symbols)
    scaling = _joined(symbols, "scaling", "harmonic_scaling")
    coarse = ca.vertcat(
        _filtered_signals(state, symbols, force, reference_signal.input), harmonic.coarse
    )
    law = controller.law
    moving = _joined(state, "gains", "harmonic_gains")
    gains = law.confined(symbols, moving)
    command = -ca.dot(scaling * gains, coarse)

    filtered = ca.vertcat(_regressor(state, symbols), harmonic.regressor)
    regressor = symbols["b0"] * scaling * filtered
    command_over_p1 = state["filtered_command"][1] + symbols["ao"] * state["filtered_command"][2]
    augmentation = -(symbols["b0"] * command_over_p1 + ca.dot(regressor, gains))
    error = force - state["model"][1] + augmentation
    rate = law.rate(
        symbols,
        AdaptationSignals(
            gains=gains, regressor=regressor, error=error, bandwidth=symbols["bandwidth"]
        ),
    )

    advanced = _advanced_gains(controller, symbols, moving, rate)
    own = len(GAIN_NAMES)
    return assemble_step(
        step,
        time_domain=controller.time_domain,
        values=parameters.pack(values),
        command=command,
        following={
            "filtered_command": _filter(symbols, state["filtered_command"], step.applied),
            "filtered_force": _filter(symbols, state["filtered_force"], force),
            "filtered_reference": _filter(
                symbols, state["filtered_reference"], reference_signal.input
            ),
            "gains": advanced[:own],
            "model": _second_order_step(symbols, "model", state["model"], reference_signal.input),
            "prefilter": _second_order_step(symbols, "prefilter", state["prefilter"], reference),
            **_oscillator_following(controller, symbols, state, gains, rate, advanced),
        },
        signals={
            "desired_force": reference_signal.desired,
            "model_force": state["model"][1],
            "augmented_error": error,
            "adapted_gains": gains[:own],
            **({"heart_rate": state["oscillator"][1]} if controller.oscillator else {}),
        },
        rest=_resting_state(layout, symbols, force),
    )


def _layout(controller: AdaptiveRST) -> Layout:
    """State, with that of the oscillator if there is one."""
    if controller.oscillator is None:
        return _STATE
    return Layout((*_STATE.blocks, *controller.oscillator.blocks))


def _joined(blocks: Mapping[str, ca.SX], first: str, second: str) -> ca.SX:
    """A block and, if it is there, the harmonics' part."""
    return ca.vertcat(blocks[first], blocks[second]) if second in blocks else blocks[first]


def _harmonic_signals(
    controller: AdaptiveRST, state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX]
) -> HarmonicSignals:
    if controller.oscillator is None:
        return HarmonicSignals(ca.SX(0, 1), ca.SX(0, 1))
    return harmonic_signals(
        controller.oscillator, symbols, state["oscillator"], symbols["model_damping"]
    )


def _oscillator_following(
    controller: AdaptiveRST,
    symbols: Mapping[str, ca.SX],
    state: Mapping[str, ca.SX],
    gains: ca.SX,
    rate: ca.SX,
    advanced: ca.SX,
) -> Mapping[str, ca.SX]:
    if controller.oscillator is None:
        return {}
    own = len(GAIN_NAMES)
    return {
        "harmonic_gains": advanced[own:],
        "oscillator": oscillator_advance(
            controller.oscillator,
            controller.time_domain,
            symbols,
            state["oscillator"],
            gains[own:],
            rate[own:],
        ),
    }


def _advanced_gains(
    controller: AdaptiveRST, symbols: Mapping[str, ca.SX], gains: ca.SX, rate: ca.SX
) -> ca.SX:
    advanced = integral_advance(controller.time_domain, gains, rate)
    if isinstance(controller.time_domain, Discrete):  # a whole period may step over a border
        return controller.law.confined(symbols, advanced)
    return advanced


def _parameter_values(controller: AdaptiveRST) -> Mapping[str, FloatArray]:
    specification = controller.design.specification
    model, ao = specification.reference_model, specification.observer_pole
    domain = controller.time_domain
    filter_A, filter_B = linear_advance(domain, *_regressor_filter(model, ao))
    model_A, model_B = linear_advance(domain, *_second_order(model))
    c1, c2 = controller.feedforward.weights(model)
    # The bias enters like a constant that has passed 1/(Ao Am): its scaled regressor is a force.
    bias_scale = ao * model.bandwidth**2 / specification.plant.b0 * controller.bias_force
    values: dict[str, Any] = {
        "bandwidth": model.bandwidth,
        "ao": ao,
        "b0": specification.plant.b0,
        "scaling": np.append(controller.design.scaling, bias_scale),
        "filter_A": filter_A,
        "filter_B": filter_B,
        "model_A": model_A,
        "model_B": model_B,
        "feedforward": [c1, c2],
        "initial_gains": [*controller.initial_gains, 0.0],
        **_prefilter_values(controller.prefilter, domain),
    }
    size = len(GAIN_NAMES)
    if controller.oscillator is not None:
        size += 2 * controller.oscillator.harmonics
        values["model_damping"] = 2 * model.damping * model.bandwidth
        values |= oscillator_values(
            controller.oscillator,
            observer_pole=ao,
            bandwidth=model.bandwidth,
            b0=specification.plant.b0,
        )
    values |= controller.law.parameters(size)
    return {name: readonly(np.ravel(value)) for name, value in values.items()}


def _prefilter_values(prefilter: ReferenceModel | None, domain: TimeDomain) -> Mapping[str, Any]:
    names = ("prefilter_A", "prefilter_B", "prefilter_bandwidth", "prefilter_damping")
    if prefilter is None:  # its states stay at rest and the reference passes by
        return dict(zip(names, (np.zeros((2, 2)), np.zeros(2), 0, 0), strict=True)) | {"direct": 1}
    A, B = linear_advance(domain, *_second_order(prefilter))
    values = (A, B, prefilter.bandwidth, prefilter.damping)
    return dict(zip(names, values, strict=True)) | {"direct": 0}


def _regressor_filter(model: ReferenceModel, ao: float) -> tuple[FloatArray, FloatArray]:
    """States (x, z1, z2) of x' = −ao x + v, z = (p, 1) x / Am(p), driven by v."""
    A = [[-ao, 0, 0], [1, -2 * model.damping * model.bandwidth, -(model.bandwidth**2)], [0, 1, 0]]
    return np.array(A), np.array([[1.0], [0.0], [0.0]])


def _second_order(model: ReferenceModel) -> tuple[FloatArray, FloatArray]:
    """States (ẏ, y) of a second-order model of unit static gain, driven by its input."""
    stiffness = model.bandwidth**2
    A = np.array([[-2 * model.damping * model.bandwidth, -stiffness], [1.0, 0.0]])
    return A, np.array([[stiffness], [0.0]])


@dataclass(frozen=True, slots=True)
class _ReferenceSignal:
    desired: ca.SX
    """Desired force F_d (N)."""
    input: ca.SX
    """Command input u_c of loop and reference model (N)."""


def _reference_path(
    state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX], reference: ca.SX
) -> _ReferenceSignal:
    rate = state["prefilter"][0]
    desired = state["prefilter"][1] + symbols["direct"] * reference
    bandwidth, damping = symbols["prefilter_bandwidth"], symbols["prefilter_damping"]
    acceleration = bandwidth * (bandwidth * (reference - desired) - 2 * damping * rate)
    c1, c2 = symbols["feedforward"][0], symbols["feedforward"][1]
    return _ReferenceSignal(desired, desired + c1 * rate + c2 * acceleration)


def _filtered_signals(
    state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX], force: ca.SX, command_input: ca.SX
) -> ca.SX:
    """P1 φ: the regressor before the reference model's filter, free of derivatives of u."""
    ao = symbols["ao"]
    xu, xy, xc = (state[f"filtered_{name}"][0] for name in ("command", "force", "reference"))
    return ca.vertcat(xu, force - ao * xy, xy, -(command_input - ao * xc), -xc, 1 / ao)


def _regressor(state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX]) -> ca.SX:
    """φ, the last entry being the constant 1 that has settled through 1/(Ao Am)."""
    zu, zy, zc = (state[f"filtered_{name}"][1:] for name in ("command", "force", "reference"))
    constant = 1 / (symbols["ao"] * symbols["bandwidth"] ** 2)
    return ca.vertcat(zu[1], zy[0], zy[1], -zc[0], -zc[1], constant)


def _filter(symbols: Mapping[str, ca.SX], x: ca.SX, v: ca.SX) -> ca.SX:
    A, b = symbols["filter_A"], symbols["filter_B"]
    # Row-major A; its entries (0, 1) and (0, 2) are zero in either time domain.
    return ca.vertcat(
        A[0] * x[0] + b[0] * v,
        A[3] * x[0] + A[4] * x[1] + A[5] * x[2] + b[1] * v,
        A[6] * x[0] + A[7] * x[1] + A[8] * x[2] + b[2] * v,
    )


def _second_order_step(symbols: Mapping[str, ca.SX], name: str, x: ca.SX, v: ca.SX) -> ca.SX:
    A, b = symbols[f"{name}_A"], symbols[f"{name}_B"]
    return ca.vertcat(A[0] * x[0] + A[1] * x[1] + b[0] * v, A[2] * x[0] + A[3] * x[1] + b[1] * v)


def _resting_state(layout: Layout, symbols: Mapping[str, ca.SX], force: ca.SX) -> ca.SX:
    """At rest y = u_c = F: the filters have settled on F and the command is zero."""
    settled = ca.vertcat(
        force / symbols["ao"], 0, force / (symbols["ao"] * symbols["bandwidth"] ** 2)
    )
    resting = {
        "filtered_command": ca.SX.zeros(3),
        "filtered_force": settled,
        "filtered_reference": settled,
        "gains": symbols["initial_gains"],
        "model": ca.vertcat(0, force),
        "prefilter": ca.vertcat(0, (1 - symbols["direct"]) * force),
    }
    if "oscillator_start" in symbols:
        harmonics = dict(layout.blocks)["harmonic_gains"]
        resting["harmonic_gains"] = ca.SX.zeros(harmonics)
        resting["oscillator"] = ca.vertcat(0, symbols["oscillator_start"])
    return layout.join(resting)
