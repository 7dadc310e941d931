"""One force axis in closed loop: the plant Ks/(p(p + K2)) with the heart's motion at its output.

    reference ─► controller ─u─► limit ─► Ẍ = u − K2 Ẋ ─X─► y = Ks (X − Xh) ─┬─►
                     ▲                                                       │
                     └────────────────────────── + noise ◄───────────────────┘

This is what exact linearisation leaves of each axis, so it serves for tuning, for comparing
controllers and for tests, at a fraction of the cost of the whole robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.robot_step import saturated
from mrac_design.controller.step import ControllerStep, require_domain
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.plant import ForcePlant
from mrac_design.simulation.closed_loop import limited
from mrac_design.simulation.engine import Engine, build_engine
from mrac_design.simulation.run import Progress, Recording, RunSettings, run
from mrac_design.simulation.system import ARGUMENT_NAMES, MODES, Event, HybridSystem
from mrac_design.simulation.tableau import RK4
from mrac_design.simulation.trajectory import Signal, Trajectory
from mrac_design.time_domain import Continuous, Discrete

_LIMIT = Event(name="command limit", rising="left", falling="reached")
_TEXTS = {
    "force": ("N", "contact force"),
    "desired_force": ("N", "desired force, the pre-filtered reference"),
    "model_force": ("N", "output of the reference model"),
    "force_reference": ("N", "force reference before the pre-filter"),
    "measured_force": ("N", "contact force as the sensor gives it"),
    "tip": ("m", "tool tip position"),
    "heart": ("m", "heart surface position"),
    "command": ("m/s²", "acceleration applied, after its limit and delay"),
    "augmented_error": ("N", "augmented error"),
    "adapted_gains": ("1", "adapted gains, scaled to order one"),
    "heart_rate": ("rad/s", "tracked frequency of the periodic motion"),
    "periodic_force": ("N", "estimated part of beat and breath in the force"),
    "learned_command": ("m/s²", "command learned over the last periods"),
    "disturbance_estimate": ("m/s²", "estimated disturbance, as an equivalent command"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AxisLoop:
    """A closed single-axis loop, ready to run."""

    system: HybridSystem
    """Inputs `heart` (m), `reference` (N), `noise` (N) and the controller's `events`."""
    parameter_values: FloatArray
    """Parameters of plant and controller, shape (system.parameters.size,)."""
    step: ControllerStep
    """The controller."""

    def with_controller_parameters(self, values: FloatArray) -> FloatArray:
        """Parameter vector of the loop with other controller parameters, same compiled code."""
        parts = self.system.parameters.split(np.array(self.parameter_values))
        return self.system.parameters.pack({**parts, "controller": values})


def build_axis_loop(
    step: ControllerStep,
    *,
    velocity_gain: float,
    stiffness: float,
    command_limit: float = math.inf,
) -> AxisLoop:
    """The loop with a continuous controller.

    `velocity_gain` K2 (1/s) and `stiffness` Ks (N/m) are the true ones, `command_limit` (m/s²)
    is symmetric; a finite one is an event. Raises ParameterError when one of them is out of range
    or the controller is sampled.
    """
    require_domain(step, Continuous())
    values, parameters, inputs = _common(step, velocity_gain, stiffness, command_limit)
    state = Layout((("position", 1), ("velocity", 1), ("controller", step.state.size)))
    limits = math.isfinite(command_limit)
    held = Layout(((MODES, 1),) if limits else ())
    x, z, v, p = (
        state.symbols("state"),
        held.symbols("held"),
        inputs.symbols("input"),
        parameters.symbols("parameters"),
    )
    states, exogenous, symbols = state.split(x), inputs.split(v), parameters.split(p)
    force = symbols["stiffness"] * (states["position"] - exogenous["heart"])
    measured = force + exogenous["noise"]
    applied, following, signal = _controlled(
        step, states["controller"], measured, exogenous, p, parameters
    )
    recorded = {
        **_recorded(states, exogenous, force, measured, applied),
        **step.signals.split(signal),
    }
    margin = None
    if limits:
        command = step.command(
            states["controller"], measured, exogenous["reference"], symbols["controller"]
        )
        margin = symbols["command_limit"] - ca.fabs(command)
        applied, following, _ = _controlled(
            step, states["controller"], measured, exogenous, p, parameters, within=z
        )
    acceleration = applied - symbols["velocity_gain"] * states["velocity"]
    return _loop(
        step, state, held, inputs, parameters, values, recorded,
        arguments=[x, z, v, p],
        rate=ca.vertcat(states["velocity"], acceleration, following),
        margin=margin,
    )  # fmt: skip


def build_sampled_axis_loop(
    step: ControllerStep,
    *,
    velocity_gain: float,
    stiffness: float,
    period: float,
    delay: int,
    command_limit: float = math.inf,
) -> AxisLoop:
    """The loop with a controller sampled every `period` s, its command held in between.

    A command computed from the measurement of instant k acts from instant k + `delay` on; the
    controller knows its own limited command at once. Other arguments as `build_axis_loop`, but
    the controller must be sampled with the same period.
    """
    _check_sampling(period, delay)
    require_domain(step, Discrete(period))
    values, parameters, inputs = _common(step, velocity_gain, stiffness, command_limit)
    state = Layout((("position", 1), ("velocity", 1)))
    held = _sampled_memory(step, int(delay))
    x, z, v, p = (
        state.symbols("state"),
        held.symbols("held"),
        inputs.symbols("input"),
        parameters.symbols("parameters"),
    )
    states, memory = state.split(x), held.split(z)
    exogenous, symbols = inputs.split(v), parameters.split(p)
    force = symbols["stiffness"] * (states["position"] - exogenous["heart"])
    measured = force + exogenous["noise"]
    applied, following, signal = _controlled(
        step, memory["controller"], measured, exogenous, p, parameters
    )
    acting = memory["pipeline"][int(delay)]
    acceleration = acting - symbols["velocity_gain"] * states["velocity"]
    recorded = {
        **_recorded(states, exogenous, force, memory["measured"], acting),
        **step.signals.split(memory["signals"]),
    }
    update = held.join(
        {
            "controller": following,
            "pipeline": ca.vertcat(applied, *ca.vertsplit(memory["pipeline"])[:-1]),
            "measured": measured,
            "signals": signal,
        }
    )
    return _loop(
        step, state, held, inputs, parameters, values, recorded,
        arguments=[x, z, v, p],
        rate=ca.vertcat(states["velocity"], acceleration),
        update=update,
        period=period,
    )  # fmt: skip


def _check_sampling(period: float, delay: int) -> None:
    if not 0 < period < math.inf:
        raise ParameterError("sampling period", period, "must be a positive time in s")
    if int(delay) != delay or delay < 0:
        raise ParameterError("delay", delay, "must be a whole number of samples >= 0")


def _sampled_memory(step: ControllerStep, delay: int) -> Layout:
    """What is held between samples; the last entry of the pipeline acts on the plant."""
    return Layout(
        (
            ("controller", step.state.size),
            ("pipeline", delay + 1),
            ("measured", 1),
            ("signals", step.signals.size),
        )
    )


def axis_inputs(
    step: ControllerStep,
    *,
    heart: PiecewisePolynomial,
    reference: PiecewisePolynomial,
    noise: PiecewisePolynomial | None = None,
    events: PiecewisePolynomial | None = None,
    end: float,
) -> PiecewisePolynomial:
    """Inputs of a loop around `step` over [0, end] s: one channel each, and the step's events.

    Without `noise` the sensor is perfect. Raises ParameterError when an input ends before `end`
    or `events` do not fit the controller.
    """
    silent = PiecewisePolynomial(breakpoints=np.array([0.0, end]), coefficients=np.zeros((1, 1, 1)))
    given = [heart, reference, silent if noise is None else noise]
    channels = 0 if events is None else events.channels
    if channels != step.events.size:
        raise ParameterError("events", f"{channels} channels", f"needs {step.events.size}")
    if events is not None:
        given.append(events)
    return stack(*(signal.restricted(0.0, end) for signal in given))


def white_noise(*, rms: float, period: float, duration: float, seed: int) -> PiecewisePolynomial:
    """Gaussian noise of standard deviation `rms`, constant over each `period` (s), one channel."""
    for name, value in (("noise period", period), ("duration", duration)):
        if not 0 < value < math.inf:
            raise ParameterError(name, value, "must be a positive time in s")
    if not 0 <= rms < math.inf:
        raise ParameterError("noise rms", rms, "must be finite and >= 0")
    count = math.ceil(duration / period - 1e-9)
    samples = rms * np.random.default_rng(seed).standard_normal(count)
    return PiecewisePolynomial(
        breakpoints=period * np.arange(count + 1.0), coefficients=samples.reshape(1, -1, 1)
    )


def resting_axis(loop: AxisLoop, *, force: float, heart: float) -> tuple[FloatArray, FloatArray]:
    """State and held memory at rest, pressing with `force` N on a heart surface at `heart` m.

    Reference and controller have settled on the same force.
    """
    stiffness = loop.system.parameters.split(np.array(loop.parameter_values))["stiffness"]
    settled = loop.step.equilibrium(force, loop.step.parameter_values).full().ravel()
    plant = {"position": heart + force / stiffness, "velocity": 0.0}
    if loop.system.update is None:
        held = np.ones(loop.system.held.size)  # its modes: within the limits
        return readonly(loop.system.state.pack({**plant, "controller": settled})), readonly(held)
    memory = {"controller": settled, "pipeline": 0.0, "measured": force, "signals": 0.0}
    return readonly(loop.system.state.pack(plant)), readonly(loop.system.held.pack(memory))


def build_axis_engine(loop: AxisLoop, inputs: PiecewisePolynomial) -> Engine:
    """A machine for the loop, reusable with inputs of the same degree."""
    return build_engine(loop.system, RK4, input_powers=inputs.degree + 1)


def simulate_axis(
    loop: AxisLoop,
    *,
    inputs: PiecewisePolynomial,
    settings: RunSettings,
    parameters: ArrayLike | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Trajectory:
    """Run the loop from rest on the initial reference and heart position.

    `parameters` replaces the loop's own values (same layout), `engine` reuses compiled code.
    Raises SimulationError when the loop diverges past the range of numbers.
    """
    machine = build_axis_engine(loop, inputs) if engine is None else engine
    heart, reference = inputs([0.0])[:2, 0]
    state, held = resting_axis(loop, force=float(reference), heart=float(heart))
    recording = run(
        machine,
        loop.system,
        inputs=inputs,
        parameters=readonly(loop.parameter_values if parameters is None else parameters),
        initial_state=state,
        initial_held=held,
        settings=settings,
        progress=progress,
    )
    return axis_trajectory(loop, recording, engine=machine.name)


def axis_trajectory(loop: AxisLoop, recording: Recording, *, engine: str) -> Trajectory:
    """Named signals of a recorded run."""
    signals = {}
    for name, values in loop.system.outputs.split(np.asarray(recording.outputs)).items():
        unit, text = _TEXTS.get(name, ("1", name.replace("_", " ")))
        labels = tuple(
            name if values.shape[1] == 1 else f"{name} {i}" for i in range(values.shape[1])
        )
        signals[name] = Signal(values=values, unit=unit, labels=labels, description=text)
    return Trajectory(time=recording.time, signals=signals, engine=engine, events=recording.events)


def _common(
    step: ControllerStep, velocity_gain: float, stiffness: float, command_limit: float
) -> tuple[dict[str, ArrayLike], Layout, Layout]:
    plant = ForcePlant(stiffness=stiffness, velocity_gain=velocity_gain)
    if not command_limit > 0:
        raise ParameterError("command limit", command_limit, "must be > 0 m/s²")
    values: dict[str, ArrayLike] = {
        "stiffness": plant.stiffness,
        "velocity_gain": plant.velocity_gain,
        "command_limit": command_limit,
        "controller": step.parameter_values,
    }
    parameters = Layout(tuple((name, int(np.size(value))) for name, value in values.items()))
    events = (("events", step.events.size),) if step.events.size else ()
    inputs = Layout((("heart", 1), ("reference", 1), ("noise", 1), *events))
    return values, parameters, inputs


def _controlled(
    step: ControllerStep,
    state: ca.SX,
    measured: ca.SX,
    exogenous: dict[str, ca.SX],
    p: ca.SX,
    parameters: Layout,
    within: ca.SX | None = None,
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Applied command, what the controller's state advances to, and its signals.

    `within` says whether the command is taken to be within its limits (1), or beyond them (0).
    """
    symbols = parameters.split(p)
    own, limit, reference = symbols["controller"], symbols["command_limit"], exogenous["reference"]
    command = step.command(state, measured, reference, own)
    applied = saturated(command, limit) if within is None else limited(command, limit, within)
    events = [exogenous["events"]] if step.events.size else []
    following, signal = step.advance(state, measured, reference, applied, own, *events)
    return applied, following, signal


def _recorded(
    states: dict[str, ca.SX],
    exogenous: dict[str, ca.SX],
    force: ca.SX,
    measured: ca.SX,
    command: ca.SX,
) -> dict[str, ca.SX]:
    return {
        "force": force,
        "measured_force": measured,
        "force_reference": exogenous["reference"],
        "tip": states["position"],
        "heart": exogenous["heart"],
        "command": command,
    }


def _loop(
    step: ControllerStep,
    state: Layout,
    held: Layout,
    inputs: Layout,
    parameters: Layout,
    values: dict[str, ArrayLike],
    recorded: dict[str, ca.SX],
    *,
    arguments: list[ca.SX],
    rate: ca.SX,
    update: ca.SX | None = None,
    period: float | None = None,
    margin: ca.SX | None = None,
) -> AxisLoop:
    outputs = Layout(tuple((name, value.numel()) for name, value in recorded.items()))

    def function(name: str, result: ca.SX, label: str) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [label])

    system = HybridSystem(
        state=state,
        held=held,
        inputs=inputs,
        parameters=parameters,
        outputs=outputs,
        rate=function("rate", rate, "rate"),
        output=function("output", outputs.join(recorded), "output"),
        update=None if update is None else function("update", update, "next_held"),
        sampling_period=period,
        events=() if margin is None else (_LIMIT,),
        event_functions=None if margin is None else function("event_functions", margin, "events"),
    )
    return AxisLoop(system=system, parameter_values=parameters.pack(values), step=step)
