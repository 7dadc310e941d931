"""Thousands of runs of a scenario over what nobody knows exactly: tissue, robot, gain, motion."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.adaptive import build_step
from mrac_design.controller.linearisation import build_linearisation, home_task_position
from mrac_design.errors import ParameterError, ScenarioFileError, SimulationError
from mrac_design.motion import available_motions, find_model
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.robot import RobotDescription, RobotDynamics, build_dynamics, load_robot
from mrac_design.robot.parameters import parameter_names
from mrac_design.simulation.closed_loop import ForceLoop
from mrac_design.simulation.ensemble import (
    Ensemble,
    EnsembleResult,
    Workers,
    chunk_metrics,
    generator,
    group_engine,
    run_ensemble,
)
from mrac_design.simulation.lanes import LANES
from mrac_design.simulation.reduction import tracking_reduction
from mrac_design.simulation.run import Progress, RunSettings
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_run import ReadyLoop, ready_loop
from mrac_design.simulation.scenario_spread import (
    MotionSource,
    OneMotion,
    ScenarioSpread,
    SeededMotions,
)
from mrac_design.simulation.store import EnsembleStore
from mrac_design.simulation.tableau import RK4
from mrac_design.study import (
    VARIANTS,
    controller_domain,
    exogenous_inputs,
    scenario_design,
    scenario_motion,
    variant_controller,
)

_CHUNK_BYTES = 64e6
"""What the inputs of one chunk may take; every thread holds one chunk."""
_LARGEST_CHUNK = 512
_LARGEST_STEP = 5e-4
"""Longest integration step taken unless one is given (s)."""
_MOTION_SEEDS = 32
"""Different motions taken unless a number is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleChoice:
    """How many runs, and how far they lie apart."""

    runs: int = 1000
    """Number of runs."""
    seed: int = 0
    """Seed of all draws."""
    stiffness_range: tuple[float, float] | None = None
    """True Ks (N/m), drawn evenly; None is 0.6 to 1.5 times the scenario's."""
    gain_range: tuple[float, float] | None = None
    """Scaled γ̂, drawn evenly in its logarithm; None is half to twice the scenario's, and no
    draw where nothing adapts."""
    inertia_spread: float = 0.05
    """Each body of the true robot is scaled by a factor within 1 ± this, drawn evenly."""
    motion_seeds: int | None = None
    """How many motions of other beat-to-beat variation (and sensor noise) to pick from; None is
    32, or 1 for a recording."""
    variant: str = "adaptive_inverse"
    """Name of the controller."""
    step: float | None = None
    """Integration step (s) of the Runge–Kutta method of order 4; None is a quarter of the time
    constant of the fastest designed pole, at most 0.5 ms."""

    def __post_init__(self) -> None:
        names = [variant.name for variant in VARIANTS]
        if self.variant not in names:
            raise ParameterError("variant", self.variant, f"must be one of {', '.join(names)}")
        if self.runs < 1:
            raise ParameterError("runs", self.runs, "must be at least 1")
        if self.seed < 0:
            raise ParameterError("seed", self.seed, "must be 0 or more")
        for name in ("stiffness_range", "gain_range"):
            limits = getattr(self, name)
            if limits is not None and not 0 < limits[0] <= limits[1] < float("inf"):
                raise ParameterError(name.replace("_", " "), limits, "needs 0 < low <= high")
        if not 0 <= self.inertia_spread < 1:
            raise ParameterError("inertia spread", self.inertia_spread, "must lie in [0, 1)")
        if self.motion_seeds is not None and self.motion_seeds < 1:
            raise ParameterError("motion seeds", self.motion_seeds, "must be at least 1")
        if self.step is not None and not 0 < self.step < float("inf"):
            raise ParameterError("step", self.step, "must be a finite time > 0 s")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedEnsemble:
    """An ensemble of a scenario, ready to run."""

    scenario: Scenario
    """The nominal choices."""
    choice: EnsembleChoice
    """How many runs and how far apart."""
    robot: RobotDescription
    """The nominal robot."""
    spread: ScenarioSpread
    """What differs between runs."""
    ensemble: Ensemble
    """The runs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EnsembleRecord:
    """A finished ensemble with what was drawn for it."""

    prepared: PreparedEnsemble
    """What was run."""
    result: EnsembleResult
    """Metrics of every run; see `tracking_reduction`."""
    computed: int
    """Chunks that were run this time; the others were in the store."""
    step_effect: float
    """Largest change of a force metric (N) of the first runs with half the step."""

    @cached_property
    def draws(self) -> FloatArray:
        """What was drawn, shape (runs, len(spread.columns))."""
        spread, seed = self.prepared.spread, self.prepared.ensemble.seed
        rows = (spread.draw(generator(seed, run)) for run in range(len(self.result.table)))
        return readonly(np.array(list(rows)))

    def drawn(self, column: str) -> FloatArray:
        """A column of `draws` by name, shape (runs,)."""
        return self.draws[:, self.prepared.spread.columns.index(column)]

    def metric(self, name: str) -> FloatArray:
        """A metric of all axes or joints, shape (runs, k); NaN where a run diverged."""
        columns = [i for i, m in enumerate(self.result.metrics) if m.split("[")[0] == name]
        return self.result.table[:, columns]

    def values(self) -> dict[str, Any]:
        """Distributions of the figures of merit as plain data, with what they rest on."""
        prepared, scenario = self.prepared, self.prepared.scenario
        ensemble, choice, robot = prepared.ensemble, prepared.choice, prepared.robot
        joints = tuple(joint.name for joint in robot.joints)
        finite = ~np.isnan(self.result.table).any(axis=1)
        efforts = self.metric("max_effort")[finite]
        first = prepared.spread.motions.motion(0, scenario.simulation.duration)
        return {
            "mrac_design": version("mrac-design"),
            "scenario": scenario.name,
            "robot": robot.name,
            "motion": {"name": first.name, "origin": first.origin.value},
            "runs": choice.runs,
            "diverged": self.result.diverged,
            "at_an_effort_limit": int((efforts >= robot.effort_limits).any(axis=1).sum()),
            "drawn": _drawn(choice, prepared.spread),
            "duration_s": scenario.simulation.duration,
            "settling_s": scenario.simulation.settling,
            "step_s": ensemble.settings.step,
            "change_with_half_the_step_N": self.step_effect,
            "fingerprint": ensemble.fingerprint(),
            "metrics": {
                **{
                    f"{name}_N": _distributions(self.metric(name)[finite], robot.force_axes)
                    for name in ("max_force_error", "rms_force_error", "max_model_error")
                },
                "max_effort": _distributions(efforts, joints),
            },
        }

    def save_runs(self, path: Path) -> None:
        """Write every run to an .npz file: `metrics`, `table`, `columns`, `draws`."""
        np.savez_compressed(
            path,
            metrics=np.array(self.result.metrics),
            table=self.result.table,
            columns=np.array(self.prepared.spread.columns),
            draws=self.draws,
        )


def prepare_ensemble(scenario: Scenario, choice: EnsembleChoice) -> PreparedEnsemble:
    """The ensemble of `choice` around `scenario`, nothing of it run yet.

    Raises the package's errors for anything in either that cannot be.
    """
    robot = load_robot(scenario.robot)
    if len(robot.force_axes) != len(scenario.reference.steps):
        raise ScenarioFileError(
            scenario.name,
            "reference",
            f"{len(scenario.reference.steps)} axes given, but {robot.name} controls force on "
            f"{', '.join(robot.force_axes)}",
        )
    dynamics = build_dynamics(robot)
    motions = _motions(scenario, choice.motion_seeds)
    duration = scenario.simulation.duration
    inputs = exogenous_inputs(scenario, dynamics, motions.motion(0, duration))
    ready = _ready(scenario, choice, dynamics, inputs)
    spread = _spread(scenario, choice, dynamics, motions, ready)
    size = inputs.coefficients.nbytes
    chunk = int(np.clip(_CHUNK_BYTES / size, LANES, _LARGEST_CHUNK)) // LANES * LANES
    system = ready.loop.system
    ensemble = Ensemble(
        system=system,
        method=RK4,
        reduction=tracking_reduction(system.outputs, settling=scenario.simulation.settling),
        sampler=spread,
        settings=RunSettings(
            duration=duration,
            step=choice.step or _step(scenario),
            record_period=scenario.simulation.record_period,
        ),
        input_powers=inputs.degree + 1,
        runs=choice.runs,
        seed=choice.seed,
        chunk=chunk,
    )
    return PreparedEnsemble(
        scenario=scenario, choice=choice, robot=robot, spread=spread, ensemble=ensemble
    )


def run_prepared(
    prepared: PreparedEnsemble,
    *,
    workers: Workers | None = None,
    store: EnsembleStore | None = None,
    progress: Progress | None = None,
) -> EnsembleRecord:
    """Run what is not yet in the store; see `run_ensemble`.

    Raises SimulationError when not one run stayed within the finite numbers.
    """
    computed = 0

    def count(fraction: float) -> None:
        nonlocal computed
        computed += 1
        if progress is not None:
            progress(fraction)

    ensemble = prepared.ensemble
    result = run_ensemble(ensemble, workers=workers, store=store, progress=count)
    if result.diverged == ensemble.runs:
        raise SimulationError(
            f"all {ensemble.runs} runs left the finite numbers: take a smaller --step, or narrower "
            "ranges"
        )
    return EnsembleRecord(
        prepared=prepared,
        result=result,
        computed=computed,
        step_effect=_step_effect(ensemble, result),
    )


def _motions(scenario: Scenario, seeds: int | None) -> MotionSource:
    source = scenario.motion.source
    if source in available_motions() or Path(source).suffix == ".toml":
        return SeededMotions(model=find_model(source), count=seeds or _MOTION_SEEDS)
    if seeds not in (None, 1):
        raise ParameterError("motion seeds", seeds, f"{source} is a recording, which has no seeds")
    return OneMotion(recorded=scenario_motion(scenario))


def _ready(
    scenario: Scenario,
    choice: EnsembleChoice,
    dynamics: RobotDynamics,
    inputs: PiecewisePolynomial,
) -> ReadyLoop:
    """The nominal loop with the chosen controller."""
    variant = next(variant for variant in VARIANTS if variant.name == choice.variant)
    controller = variant_controller(scenario, scenario_design(scenario), variant)
    axes = len(dynamics.description.force_axes)
    return ready_loop(
        scenario,
        dynamics,
        build_linearisation(
            dynamics,
            velocity_gain=scenario.design.velocity_gain,
            tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
            model_error=scenario.model_error,
        ),
        build_step(replace(controller, time_domain=controller_domain(scenario))),
        force=readonly(inputs(0.0)[axes : 2 * axes, 0]),
    )


def _spread(
    scenario: Scenario,
    choice: EnsembleChoice,
    dynamics: RobotDynamics,
    motions: MotionSource,
    ready: ReadyLoop,
) -> ScenarioSpread:
    robot, gain = dynamics.description, scenario.adaptation.gain
    slices = ready.loop.system.parameters.slices
    adapts = next(v.adapts for v in VARIANTS if v.name == choice.variant) and gain > 0
    if choice.gain_range is not None and not adapts:
        raise ParameterError("gain range", choice.gain_range, "nothing adapts in this controller")
    bodies: list[list[int]] = [[] for _ in robot.joints]
    for place, name in enumerate(parameter_names(robot), slices["inertia"].start):
        bodies[int(re.sub(r"\D", "", name)) - 1].append(place)
    stiffness = slices["stiffness"]
    return ScenarioSpread(
        scenario=scenario,
        motions=motions,
        axes=tuple(robot.task.position),
        tip=readonly(home_task_position(dynamics)[: len(robot.force_axes)]),
        parameters=ready.loop.parameter_values,
        initial_state=ready.state,
        held=ready.held,
        stiffness_places=tuple(range(stiffness.start, stiffness.stop)),
        body_places=tuple(tuple(places) for places in bodies),
        gain_places=_gain_places(ready.loop) if adapts else (),
        stiffness_range=choice.stiffness_range
        or (0.6 * scenario.stiffness, 1.5 * scenario.stiffness),
        gain_range=choice.gain_range or ((0.5 * gain, 2.0 * gain) if adapts else (1.0, 1.0)),
        inertia_spread=choice.inertia_spread,
    )


def _gain_places(loop: ForceLoop) -> tuple[int, ...]:
    """Where γ̂ stands; the controllers' parameters follow each other axis by axis."""
    slices = loop.system.parameters.slices
    first = f"controller_{loop.dynamics.description.force_axes[0]}"
    if first in slices:
        start = slices[first].start
    else:  # a sampled loop keeps them in one block, the linearisation's before them
        start = slices["controller"].stop - sum(c.parameters.size for c in loop.controllers)
    places: list[int] = []
    for controller in loop.controllers:
        own = controller.parameters.slices["adaptation_gain"]
        places.extend(range(start + own.start, start + own.stop))
        start += controller.parameters.size
    return tuple(places)


def _step(scenario: Scenario) -> float:
    design = scenario.design
    return min(_LARGEST_STEP, 0.25 / max(design.bandwidth, *map(abs, np.roots(design.observer))))


def _step_effect(ensemble: Ensemble, result: EnsembleResult) -> float:
    settings = replace(ensemble.settings, step=ensemble.settings.step / 2)
    few = replace(ensemble, settings=settings, runs=min(ensemble.runs, LANES))
    finer = chunk_metrics(few, group_engine(few), 0)
    forces = [i for i, name in enumerate(result.metrics) if "error" in name]
    change = np.abs(finer - result.table[: few.runs])[:, forces]
    return float(np.nanmax(change)) if np.isfinite(change).any() else float("nan")


def _drawn(choice: EnsembleChoice, spread: ScenarioSpread) -> dict[str, Any]:
    return {
        "seed": choice.seed,
        "stiffness_N_per_m": list(spread.stiffness_range),
        "adaptation_gain": list(spread.gain_range) if spread.gain_places else None,
        "body_scale": [1 - spread.inertia_spread, 1 + spread.inertia_spread],
        "motions": spread.motions.count,
        "controller": choice.variant,
    }


def _distributions(rows: FloatArray, names: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Where the values (runs, k) of each name lie."""
    return {name: asdict(_distribution(rows[:, i])) for i, name in enumerate(names)}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Distribution:
    median: float
    percentile_95: float
    percentile_99: float
    largest: float


def _distribution(values: FloatArray) -> _Distribution:
    median, high, higher = (float(v) for v in np.percentile(values, [50, 95, 99]))
    return _Distribution(
        median=median, percentile_95=high, percentile_99=higher, largest=float(values.max())
    )
