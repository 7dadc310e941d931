"""The bench contestants are run on: one axis, sampled, with a noisy and quantised force."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.contestant import TunedAxis
from mrac_design.comparison.setting import AxisSetting, Condition
from mrac_design.controller.step import ControllerStep
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.simulation.engine import Engine
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.sensor import UniformQuantiser
from mrac_design.simulation.single_axis import (
    AxisLoop,
    build_axis_engine,
    build_sampled_axis_loop,
    simulate_axis,
    white_noise,
)

FINE = 1e-9
"""Resolution that counts as none (N)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """What the force sensor does to a run."""

    noise: float
    """Standard deviation of its noise (N)."""
    resolution: float
    """Step between its readings (N), > 0."""
    seed: int
    """Seed of the noise."""

    @staticmethod
    def of(setting: AxisSetting, seed: int) -> Sensing:
        """The sensor of the setting."""
        return Sensing(noise=setting.noise, resolution=setting.resolution, seed=seed)

    @staticmethod
    def perfect() -> Sensing:
        """A sensor that reads the force as it is."""
        return Sensing(noise=0.0, resolution=FINE, seed=0)


def with_quantised_force(step: ControllerStep, resolution: float) -> ControllerStep:
    """The same controller behind a sensor whose readings are multiples of `resolution` (N).

    The resolution becomes the last of its parameters, so it can change without recompiling.
    """
    layout = Layout((*step.parameters.blocks, ("resolution", 1)))
    x, p = step.state.symbols("state"), layout.symbols("parameters")
    inputs = [ca.SX.sym(name) for name in ("force", "reference", "applied_command")]
    events = [step.events.symbols("events")] if step.events.size else []
    own, fine = p[: step.parameters.size], p[step.parameters.size]
    reading = UniformQuantiser(resolution=resolution).read(inputs[0], {"resolution": fine})
    names = ["state", "force", "reference"]
    return replace(
        step,
        parameters=layout,
        parameter_values=readonly(np.append(step.parameter_values, resolution)),
        command=ca.Function(
            "command",
            [x, *inputs[:2], p],
            [step.command(x, reading, inputs[1], own)],
            [*names, "parameters"],
            ["command"],
        ),
        advance=ca.Function(
            "advance",
            [x, *inputs, p, *events],
            list(step.advance(x, reading, *inputs[1:], own, *events)),
            [*names, "applied_command", "parameters", *(["events"] if events else [])],
            ["next", "signals"],
        ),
        equilibrium=ca.Function(
            "equilibrium",
            [inputs[0], p],
            [step.equilibrium(inputs[0], own)],
            ["force", "parameters"],
            ["state"],
        ),
    )


@dataclass(slots=True)
class Bench:
    """Runs tuned controllers; what was compiled for one serves all of the same form."""

    setting: AxisSetting
    """What every contestant faces."""
    _compiled: dict[tuple[str, int], tuple[AxisLoop, Engine]] = field(default_factory=dict)

    def force_error(
        self, axis: TunedAxis, condition: Condition, sensing: Sensing, *, extra_delay: int = 0
    ) -> FloatArray:
        """Force less desired force (N) at every sample from the condition's settling on, (N,).

        `extra_delay` samples of dead time come on top of the setting's. Raises SimulationError
        when the loop diverges past the range of numbers.
        """
        step = with_quantised_force(axis.step, sensing.resolution)
        inputs = _inputs(
            step.events.size > 0, condition, sensing.noise, sensing.seed, self.setting.period
        )
        form, engine = self._form(step, inputs, self.setting.delay + extra_delay)
        parameters = self._parameters(form, axis, step, condition)
        loop = replace(form, step=step, parameter_values=parameters)
        run = simulate_axis(
            loop,
            inputs=inputs,
            settings=RunSettings(
                duration=condition.duration,
                step=self.setting.period,
                record_period=self.setting.period,
            ),
            engine=engine,
        )
        counted = run.time >= condition.settling - 1e-9
        error: FloatArray = (run["force"] - run["desired_force"])[counted, 0]
        return error

    def _form(
        self, step: ControllerStep, inputs: PiecewisePolynomial, delay: int
    ) -> tuple[AxisLoop, Engine]:
        """Loop and machine for every controller with the same equations."""
        text = (step.command.serialize() + step.advance.serialize()).encode()
        key = (hashlib.sha256(text).hexdigest(), delay)
        if key not in self._compiled:
            loop = build_sampled_axis_loop(
                step,
                velocity_gain=self.setting.velocity_gain,
                stiffness=self.setting.stiffness,
                period=self.setting.period,
                delay=delay,
            )
            self._compiled[key] = (loop, build_axis_engine(loop, inputs))
        return self._compiled[key]

    def _parameters(
        self, form: AxisLoop, axis: TunedAxis, step: ControllerStep, condition: Condition
    ) -> FloatArray:
        layout = form.system.parameters
        parts = layout.split(np.array(form.parameter_values))
        stiffness = condition.stiffness_factor * self.setting.stiffness
        own = {"stiffness": stiffness, "velocity_gain": axis.velocity_gain}
        return layout.pack({**parts, **own, "controller": step.parameter_values})


def root_mean_square(error: FloatArray) -> float:
    """Square root of the mean square; what exceeds a million counts as a million."""
    return float(np.sqrt(np.mean(np.square(np.clip(error, -1e6, 1e6)))))


@lru_cache(maxsize=6)
def _inputs(
    has_events: bool, condition: Condition, noise: float, seed: int, period: float
) -> PiecewisePolynomial:
    """Inputs of a run; the last few are kept, since drawing them takes longer than the run."""
    end = condition.duration
    drawn = white_noise(rms=noise, period=period, duration=end + period, seed=seed)
    signals = [condition.heart, condition.reference, drawn.restricted(0.0, end)]
    if has_events:
        signals.append(condition.beat_age())
    return stack(*signals)
