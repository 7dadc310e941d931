"""Half an hour of drift as a folder: report, figures and numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mrac_design.comparison.drift import DriftBench, DriftRun
from mrac_design.comparison.drift_findings import drift_values
from mrac_design.errors import ParameterError
from mrac_design.publishing import publish_contents, staging_folder
from mrac_design.report.figures_drift import drift_figure, path_figure
from mrac_design.report.rendering import (
    RESULTS_VARIABLE,
    ReportProgress,
    ignore_progress,
    render_report,
)
from mrac_design.report.saving import save_figures
from mrac_design.report.study_report import with_absolute_paths, write_json
from mrac_design.resources import notebooks_directory
from mrac_design.simulation.scenario import Scenario, save_scenario

NOTEBOOK = "08_robust_laws.py"
"""The report's only chapter."""
MINUTES_VARIABLE = "MRAC_MINUTES"
"""Environment variable: minutes each run lasts."""


def write_drift_report(
    scenario: Scenario, out: Path, *, minutes: int, progress: ReportProgress = ignore_progress
) -> Mapping[str, Any]:
    """Run every law for `minutes` minutes and write it up in the folder `out`; returns the numbers.

    Writes report.html, report.pdf, values.json, scenario.toml and figures/, all of it or nothing.
    Raises ParameterError for a scenario without a sampled controller, and as `render_report`.
    """
    DriftBench(scenario=scenario)  # a mistake is told before anything is run
    if minutes < 1:
        raise ParameterError("minutes", minutes, "must be at least 1")
    with staging_folder(out) as folder:
        save_scenario(with_absolute_paths(scenario), folder / "scenario.toml")
        render_report(
            [notebooks_directory() / NOTEBOOK],
            title="Drift of the gains, and what keeps them",
            subtitle=f"Scenario {scenario.name}, one axis, {minutes} min a run, "
            f"mrac_design {version('mrac-design')}",
            scenario=folder / "scenario.toml",
            html=folder / "report.html",
            pdf=folder / "report.pdf",
            environment={
                RESULTS_VARIABLE: str(folder.absolute()),
                MINUTES_VARIABLE: str(minutes),
            },
            progress=progress,
        )
        values: Mapping[str, Any] = json.loads((folder / "values.json").read_text("utf-8"))
        publish_contents(folder, out)
    return values


def save_drift_results(
    bench: DriftBench,
    guarded: Mapping[str, Sequence[DriftRun]],
    resting: Sequence[DriftRun],
    folder: Path,
) -> None:
    """Write figures/ and values.json of finished runs to `folder`; `guarded` by motion."""
    pictures = {f"drift_{motion}": partial(drift_figure, bench, runs) for motion, runs in
                guarded.items()}  # fmt: skip
    unloaded = [run for run in resting if run.case.programme.rest == 0.0]
    save_figures({"rest": partial(path_figure, bench, unloaded), **pictures}, folder / "figures")
    every = [run for runs in guarded.values() for run in runs]
    write_json(drift_values(bench, [*every, *resting]), folder / "values.json")
