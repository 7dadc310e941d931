r"""The adaptive RST controller of one force axis.

    r ─► pre-filter ─► F_d ─► feedforward ─► u_c ─┬─► 1/Ao ─► 1/Am ─┐
                                                  └─► reference model ─► y_m
              y ──────────────────────────────────┬─► 1/Ao ─► 1/Am ─┤─► φ
              u ──────────────────────────────────┴─► 1/Ao ─► 1/Am ─┘

    u = −(K/Ao) u − θᵀ(P1 φ)      ε = (y − y_m) + b0 η      η = −((p + c) D/(P1 Ao) u + φᵀ θ)
    dθ/dt = law(φ, ε)

with Q = Ao Am, P1 = Am, P2 = Ao, so P1 φ needs the filters 1/Ao only and there is no algebraic
loop ([AW] section 5.8, Example 5.14). D is the internal model in R = (p + r1) D, c chosen so that
K = (p + c) D − Ao has no power above the (n − 2)nd, n = deg Ao; without internal model c = ao and
K = 0, which is [AW 5.71]. θ = (r1 − c, s0 … sn, t0 … tn) and, if wanted, a constant bias force.
With the gain at zero this *is* the frozen RST controller.
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
from mrac_design.controller.filter_chains import FilterChain, chain_equations, settled
from mrac_design.controller.oscillator import (
    HarmonicSignals,
    Oscillator,
    harmonic_signals,
    oscillator_advance,
    oscillator_values,
)
from mrac_design.controller.reference import ReferenceFeedforward
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel, RSTDesign, RSTSpecification
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.time_domain import Discrete, TimeDomain

BIAS = "bias"
"""Name of the gain vector's last entry; `RSTSpecification.gain_names` are the others."""


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
    """Scaled gains at the start, θ̂(0) = D⁻¹θ(0), one for each of the design's; its own are
    `nominal_gains`."""
    time_domain: TimeDomain
    """Continuous, or sampled with a period."""
    oscillator: Oscillator | None = None
    """Harmonics of a periodic motion as further regressors; none leaves them out."""

    def __post_init__(self) -> None:
        names = self.design.specification.gain_names
        if len(self.initial_gains) != len(names) or not np.all(np.isfinite(self.initial_gains)):
            raise ParameterError(
                "initial gains",
                self.initial_gains,
                f"needs {len(names)} finite numbers ({', '.join(names)})",
            )
        if not 0 <= self.bias_force < float("inf"):
            raise ParameterError("bias force", self.bias_force, "must be a finite force >= 0 N")

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Entries of the adapted gains, in order."""
        return (*self.design.specification.gain_names, BIAS)


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
    chains = {name: _chain(state, symbols, name) for name in _CHAINS}
    command_powers = chains["filtered_command"].before_model(ca.SX(0))[1:]
    coarse = ca.vertcat(
        ca.dot(symbols["internal_model"], command_powers),
        chains["filtered_force"].before_model(force),
        -chains["filtered_reference"].before_model(reference_signal.input),
        1 / _static(symbols),
        harmonic.coarse,
    )
    law = controller.law
    moving = _joined(state, "gains", "harmonic_gains")
    gains = law.confined(symbols, moving)
    command = -ca.dot(scaling * gains, coarse)
    if "known" in symbols:
        command -= ca.dot(symbols["known"], command_powers[1:])

    slow_command = chains["filtered_command"].after_model()
    modelled = ca.dot(symbols["internal_model"], slow_command[1:])
    filtered = ca.vertcat(
        modelled,
        chains["filtered_force"].after_model(),
        -chains["filtered_reference"].after_model(),
        1 / (_static(symbols) * symbols["model_polynomial"][1]),
        harmonic.regressor,
    )
    regressor = symbols["b0"] * scaling * filtered
    driven = ca.dot(symbols["internal_model"], slow_command[:-1])
    augmentation = -(
        symbols["b0"] * (driven + symbols["adapted_pole"] * modelled) + ca.dot(regressor, gains)
    )
    error = force - state["model"][1] + augmentation
    rate = law.rate(
        symbols,
        AdaptationSignals(
            gains=gains, regressor=regressor, error=error, bandwidth=symbols["bandwidth"]
        ),
    )

    advanced = _advanced_gains(controller, symbols, moving, rate)
    own = len(controller.gain_names)
    return assemble_step(
        step,
        time_domain=controller.time_domain,
        values=parameters.pack(values),
        command=command,
        following={
            **{
                name: _filter(symbols, state[name], signal)
                for name, signal in zip(
                    _CHAINS, (step.applied, force, reference_signal.input), strict=True
                )
            },
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


_CHAINS = ("filtered_command", "filtered_force", "filtered_reference")


def _layout(controller: AdaptiveRST) -> Layout:
    """State, with that of the oscillator if there is one."""
    order = controller.design.specification.degree + 2
    oscillator = controller.oscillator
    return Layout(
        (
            *((name, order) for name in _CHAINS),
            ("gains", len(controller.gain_names)),
            ("model", 2),
            ("prefilter", 2),
            *(() if oscillator is None else oscillator.blocks),
        )
    )


def _chain(state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX], name: str) -> FilterChain:
    return FilterChain(
        states=state[name], observer=symbols["observer"], model=symbols["model_polynomial"]
    )


def _static(symbols: Mapping[str, ca.SX]) -> ca.SX:
    """Ao(0), what a constant is divided by on its way through 1/Ao."""
    return symbols["observer"][-1]


def _joined(blocks: Mapping[str, ca.SX], first: str, second: str) -> ca.SX:
    """A block and, if it is there, the harmonics' part."""
    return ca.vertcat(blocks[first], blocks[second]) if second in blocks else blocks[first]


def _harmonic_signals(
    controller: AdaptiveRST, state: Mapping[str, ca.SX], symbols: Mapping[str, ca.SX]
) -> HarmonicSignals:
    if controller.oscillator is None:
        return HarmonicSignals(ca.SX(0, 1), ca.SX(0, 1))
    return harmonic_signals(
        controller.oscillator,
        state["oscillator"],
        static=_static(symbols),
        model=symbols["model_polynomial"],
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
    own = len(controller.gain_names)
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
    model, b0 = specification.reference_model, specification.plant.b0
    domain = controller.time_domain
    filter_A, filter_B = linear_advance(domain, *chain_equations(specification))
    model_A, model_B = linear_advance(domain, *_second_order(model))
    c1, c2 = controller.feedforward.weights(model)
    # The bias enters like a constant that has passed 1/(Ao Am): its scaled regressor is a force.
    unit_force = specification.observer[-1] * model.bandwidth**2 / b0
    values: dict[str, Any] = {
        "bandwidth": model.bandwidth,
        "b0": b0,
        "observer": specification.observer[1:],
        "model_polynomial": model.polynomial[1:],
        "internal_model": specification.internal_model,
        "adapted_pole": specification.adapted_pole,
        "scaling": np.append(controller.design.scaling, unit_force * controller.bias_force),
        "filter_A": filter_A,
        "filter_B": filter_B,
        "model_A": model_A,
        "model_B": model_B,
        "feedforward": [c1, c2],
        "initial_gains": [*controller.initial_gains, 0.0],
        **_prefilter_values(controller.prefilter, domain),
    }
    if specification.degree > 1:
        values["known"] = _known_part(specification)
    size = len(controller.gain_names)
    if controller.oscillator is not None:
        size += 2 * controller.oscillator.harmonics
        values |= oscillator_values(controller.oscillator, unit_force=unit_force)
    values |= controller.law.parameters(size)
    return {name: readonly(np.ravel(value)) for name, value in values.items()}


def _known_part(specification: RSTSpecification) -> FloatArray:
    """K = (p + c) D − Ao, of degree n − 2, highest power first, (n − 1,)."""
    placed = np.convolve([1.0, specification.adapted_pole], specification.internal_model)
    return np.asarray(placed - specification.observer, dtype=float)[2:]


def _prefilter_values(prefilter: ReferenceModel | None, domain: TimeDomain) -> Mapping[str, Any]:
    names = ("prefilter_A", "prefilter_B", "prefilter_bandwidth", "prefilter_damping")
    if prefilter is None:  # its states stay at rest and the reference passes by
        return dict(zip(names, (np.zeros((2, 2)), np.zeros(2), 0, 0), strict=True)) | {"direct": 1}
    A, B = linear_advance(domain, *_second_order(prefilter))
    values = (A, B, prefilter.bandwidth, prefilter.damping)
    return dict(zip(names, values, strict=True)) | {"direct": 0}


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


def _filter(symbols: Mapping[str, ca.SX], x: ca.SX, v: ca.SX) -> ca.SX:
    order = x.numel()
    A = ca.reshape(symbols["filter_A"], order, order).T
    # What the second part of the chain does never acts back on the first: those entries are zero.
    A[: order - 2, order - 2 :] = 0
    return A @ x + symbols["filter_B"] * v


def _second_order_step(symbols: Mapping[str, ca.SX], name: str, x: ca.SX, v: ca.SX) -> ca.SX:
    A, b = symbols[f"{name}_A"], symbols[f"{name}_B"]
    return ca.vertcat(A[0] * x[0] + A[1] * x[1] + b[0] * v, A[2] * x[0] + A[3] * x[1] + b[1] * v)


def _resting_state(layout: Layout, symbols: Mapping[str, ca.SX], force: ca.SX) -> ca.SX:
    """At rest y = u_c = F: the filters have settled on F and the command is zero."""
    still = settled(symbols["observer"], symbols["model_polynomial"], force)
    resting = {
        "filtered_command": ca.SX.zeros(still.numel()),
        "filtered_force": still,
        "filtered_reference": still,
        "gains": symbols["initial_gains"],
        "model": ca.vertcat(0, force),
        "prefilter": ca.vertcat(0, (1 - symbols["direct"]) * force),
    }
    if "oscillator_start" in symbols:
        harmonics = dict(layout.blocks)["harmonic_gains"]
        resting["harmonic_gains"] = ca.SX.zeros(harmonics)
        resting["oscillator"] = ca.vertcat(0, symbols["oscillator_start"])
    return layout.join(resting)
