"""The loop everybody runs: three adaptive axes on the five-joint robot, model ≠ truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from mrac_design.codegen.reading import read_function
from mrac_design.codegen.straight_line import StraightLine
from mrac_design.controller.linearisation import RobotModelError
from mrac_design.motion.signal import PiecewisePolynomial, from_ppoly, stack
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.closed_loop import ForceLoop
from mrac_design.simulation.engine import CompiledEngine
from mrac_design.simulation.method import Method
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.scenario import load_scenario
from mrac_design.simulation.scenario_run import ready_loop
from mrac_design.simulation.system import HybridSystem, Kinks
from mrac_design.study import (
    VARIANTS,
    exogenous_inputs,
    scenario_design,
    scenario_linearisation,
    scenario_motion,
    variant_step,
)

RECORD = 1e-3
"""Time between records (s)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One closed loop with all its numbers."""

    loop: ForceLoop
    """The equations."""
    state: np.ndarray
    """Initial state."""
    inputs: PiecewisePolynomial
    """Heart and reference."""
    duration: float
    """Length of a run (s)."""

    @property
    def system(self) -> HybridSystem:
        """The hybrid system."""
        return self.loop.system

    @property
    def parameters(self) -> np.ndarray:
        """Values of the parameters."""
        return np.array(self.loop.parameter_values)

    def rate_program(self) -> StraightLine:
        """The right-hand side, common subexpressions shared, for peers to translate."""
        return read_function(self.system.rate, inputs=("x", "z", "v", "p"))

    def forces(self, states: np.ndarray) -> np.ndarray:
        """Contact force (N) at the records of states (records, states), for every peer alike."""
        q = states[: self.times.size, self.system.state.slices["joint_position"]]
        tips = self.loop.dynamics.task_position.map(len(q))(q.T).full()[:3].T
        stiffness = self.system.parameters.split(self.parameters)["stiffness"]
        return stiffness * (tips - self.inputs(self.times)[:3].T)

    @property
    def times(self) -> np.ndarray:
        """Instants of the records (s)."""
        return np.arange(round(self.duration / RECORD)) * RECORD

    def reference(self) -> np.ndarray:
        """Forces (N) at the records by SciPy's DOP853 at 1e-12, restarted at every breakpoint."""
        borders, rows, x = self.inputs.breakpoints, [], self.state
        for index in range(self.inputs.segments):
            start, end = borders[index], min(borders[index + 1], self.duration)
            if start >= self.duration - 1e-12:
                break
            records = self.times[(self.times >= start - 1e-12) & (self.times < end - 1e-12)]
            solved = solve_ivp(
                self._derivative(index),
                (0.0, end - start),
                x,
                method="DOP853",
                t_eval=np.append(np.maximum(records - start, 0.0), end - start),
                rtol=1e-12,
                atol=1e-13,
            )
            rows.append(solved.y[:, :-1].T)
            x = solved.y[:, -1]
        return self.forces(np.vstack(rows))

    def _derivative(self, index: int) -> Callable[[float, np.ndarray], np.ndarray]:
        """Right-hand side over the time since the beginning of a segment of the inputs."""
        buffer, evaluate = self.system.rate.buffer()
        state, v, slope = np.array(self.state), np.zeros(self.inputs.channels), self.state * 0.0
        # CasADi keeps addresses only: the function below keeps the arrays.
        kept = {0: state, 2: v, 3: np.array(self.parameters)}
        for number, values in kept.items():
            buffer.set_arg(number, memoryview(values))
        buffer.set_res(0, memoryview(slope))
        powers = self.inputs.coefficients[:, index, ::-1].T

        def derivative(t: float, x: np.ndarray) -> np.ndarray:
            state[:] = x
            v[:] = powers[0]
            for coefficients in powers[1:]:
                v[:] = v * t + coefficients
            evaluate()
            return np.array(slope)

        derivative.kept = buffer, kept
        return derivative

    def engine(self, method: Method, compiler: str) -> CompiledEngine:
        """This package's engine for it."""
        return CompiledEngine(
            self.system, method, input_powers=self.inputs.degree + 1, compiler=compiler
        )

    def run(self, engine: CompiledEngine, step: float) -> np.ndarray:
        """Recorded forces (N), by this package."""
        outputs = run(
            engine,
            self.system,
            inputs=self.inputs,
            parameters=self.parameters,
            initial_state=self.state,
            settings=RunSettings(duration=self.duration, step=step, record_period=RECORD),
        ).outputs
        return self.system.outputs.split(outputs)["force"]


def five_joint_loop(duration: float, *, kinks: Kinks = Kinks.CROSSED) -> Problem:
    """The nominal scenario with the first simulation's reference and a wrong robot model.

    No peer ends its steps where an effort meets its limit; neither does this package then.
    """
    scenario = load_scenario("nominal")
    wrong = RobotModelError(body_scale=1.05, first_joint_scale=1.25)
    scenario = replace(scenario, model_error=wrong)
    dynamics, design = build_dynamics(load_robot(scenario.robot)), scenario_design(scenario)
    inputs = _as_recorded(exogenous_inputs(scenario, dynamics, scenario_motion(scenario)))
    ready = ready_loop(
        scenario,
        dynamics,
        scenario_linearisation(scenario, dynamics),
        variant_step(scenario, design, VARIANTS[-1]),
        kinks=kinks,
    )
    return Problem(loop=ready.loop, state=np.array(ready.state), inputs=inputs, duration=duration)


def _as_recorded(inputs: PiecewisePolynomial) -> PiecewisePolynomial:
    """The heart as a track of 25 frames a second gives it: cubic splines of 40 ms.

    Peers restart at every breakpoint, and a motion of finer pieces would count against them.
    """
    frames = np.arange(0.0, inputs.end + 1e-9, 0.04)
    heart = from_ppoly(CubicSpline(frames, inputs(frames)[:3].T))
    borders = np.unique(np.concatenate([frames, _jumps(inputs)]))
    levels = inputs(borders[:-1])[3:6, :, None]
    reference = PiecewisePolynomial(breakpoints=borders, coefficients=levels)
    return stack(heart.restricted(0.0, borders[-1]), reference)


def _jumps(inputs: PiecewisePolynomial) -> np.ndarray:
    """Instants at which the reference steps."""
    levels = inputs.coefficients[3:6, :, 0]
    changed = (np.diff(levels, axis=1) != 0).any(axis=0)
    return inputs.breakpoints[1:-1][changed]
