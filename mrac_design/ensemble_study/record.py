"""A finished ensemble: what was drawn, what came out, as plain data."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.ensemble_study.choice import EnsembleChoice
from mrac_design.ensemble_study.preparation import PreparedEnsemble
from mrac_design.simulation.ensemble import EnsembleResult, generator
from mrac_design.simulation.scenario_spread import ScenarioSpread


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
