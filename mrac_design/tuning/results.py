"""What the tuner leaves behind: scenario files with their provenance, and plain data."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mrac_design.simulation.scenario import Scenario, save_scenario
from mrac_design.study import scenario_motion
from mrac_design.tuning.bench import TUNED_VARIANT, CaseResult
from mrac_design.tuning.judging import Judgement, variable_text
from mrac_design.tuning.tuner import Point, TuningRecord

OBJECTIVE = "least largest max |y − Fd| in % of max |Fd| over scenarios and force axes"
"""What the tuner minimises, in words."""


def write_scenarios(record: TuningRecord, folder: Path) -> tuple[Path, ...]:
    """Write every scenario with the tuned values and their provenance; returns the paths.

    The files run as they are; paths of recordings and robots in them count from `folder`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for scenario, result in zip(record.scenarios, record.tuned.cases, strict=True):
        path = folder / f"{scenario.name}_tuned.toml"
        tuned = replace(
            scenario,
            name=f"{scenario.name}_tuned",
            title=f"{scenario.title} (tuned)",
            robot=_from(folder, scenario.robot),
            motion=replace(scenario.motion, source=_from(folder, scenario.motion.source)),
        )
        save_scenario(tuned, path, remarks=_provenance(record, scenario, result))
        paths.append(path)
    return tuple(paths)


def tuning_values(record: TuningRecord, judgement: Judgement) -> dict[str, Any]:
    """The search and its outcome as plain data; every number was computed in this run."""
    choice = record.choice
    names = [variable.name for variable in choice.variables]
    return {
        "mrac_design": version("mrac-design"),
        "objective": OBJECTIVE,
        "controller": TUNED_VARIANT.name,
        "scenarios": [scenario.name for scenario in choice.scenarios],
        "motions": {s.name: scenario_motion(s).name for s in choice.scenarios},
        "ranges": {v.name: [v.low, v.high] for v in choice.variables},
        "delay_margin_asked_s": choice.delay_margin,
        "seed": choice.seed,
        "evaluations": len(record.tried),
        "interrupted": record.interrupted,
        "start": _point(names, record.start),
        "tuned": _point(names, record.tuned),
        "change_with_half_the_step_percent": judgement.step_effect,
        "unseen": {
            one.motion: {"start": _point(names, one.start), "tuned": _point(names, one.tuned)}
            for one in judgement.unseen
        },
        "tried": [
            {
                **dict(zip(names, point.values, strict=True)),
                "worst_error_percent": _finite(point.worst),
                "delay_margin_s": _finite(point.delay_margin),
                "admissible": point.admissible(choice.delay_margin),
            }
            for point in record.tried
        ],
    }


def _point(names: Sequence[str], point: Point) -> dict[str, Any]:
    return {
        "values": dict(zip(names, point.values, strict=True)),
        "worst_error_percent": _finite(point.worst),
        "delay_margin_s": _finite(point.delay_margin),
        "scenarios": {
            case.scenario: {
                "max_force_error_percent": {
                    axis: _finite(error) for axis, error in case.errors.items()
                },
                "max_torque_Nm": dict(case.torques),
                "largest_torque_share": _finite(case.torque_share),
                "delay_margin_s": _finite(case.limits.delay_margin),
                "adaptation_speed_share": case.limits.speed_share,
            }
            for case in point.cases
        },
    }


def _provenance(record: TuningRecord, scenario: Scenario, result: CaseResult) -> tuple[str, ...]:
    choice = record.choice
    before = record.start.cases[record.tuned.cases.index(result)]
    names = ", ".join(one.name for one in choice.scenarios)
    ranges = ", ".join(f"{v.symbol} {v.low:g} to {v.high:g}" for v in choice.variables)
    motion = scenario_motion(scenario)
    ended = ", ended by the user" if record.interrupted else ""
    return (
        f"Scenario {scenario.name} with values chosen by mrac tune, mrac_design "
        f"{version('mrac-design')}:",
        f"{variable_text(choice.variables, record.tuned.values)}.",
        f"All else stands as in {scenario.name}.",
        f"Objective: {OBJECTIVE}, controller {TUNED_VARIANT.name}, scenarios: {names}.",
        f"Motion tuned on: {motion.name} ({motion.origin.value}).",
        f"Ranges: {ranges}.",
        f"Constraints: motors below their torque limits; delay margin >= "
        f"{1e3 * choice.delay_margin:g} ms in every",
        "scenario on its own tissue; adaptation slow enough for the integration.",
        f"Largest error of all: {record.tuned.worst:.4g} %; delay margin of all: "
        f"{1e3 * record.tuned.delay_margin:.4g} ms.",
        f"This scenario: {_errors(result)}; delay margin "
        f"{1e3 * result.limits.delay_margin:.4g} ms;",
        f"largest torque {result.torque_share:.1%} of its motor's limit.",
        f"Before tuning: {_errors(before)}.",
        f"Search: {len(record.tried)} evaluations, seed {choice.seed}{ended}.",
    )


def _finite(value: float) -> float | None:
    """JSON has no infinity: null where a run was lost, or where no dead time destabilises."""
    return value if math.isfinite(value) else None


def _errors(result: CaseResult) -> str:
    return ", ".join(f"{axis} {error:.4g} %" for axis, error in result.errors.items())


def _from(folder: Path, name: str) -> str:
    """A file's path counted from `folder`, absolute on another drive; names stay."""
    if not Path(name).is_file():
        return name
    try:
        return Path(os.path.relpath(name, folder)).as_posix()
    except ValueError:
        return str(Path(name).resolve())
