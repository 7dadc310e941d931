"""A study as a folder: report, figures, numbers, gains and the scenario they come from."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mrac_design.export.gains import gains_document
from mrac_design.export.values import study_values
from mrac_design.publishing import publish_contents, staging_folder
from mrac_design.report.rendering import ReportProgress, ignore_progress, render_report
from mrac_design.report.saving import save_figures, study_figures
from mrac_design.resources import notebooks_directory
from mrac_design.simulation.scenario import Scenario, save_scenario
from mrac_design.study import StudyRecord, run_study

REPORT_NOTEBOOKS = ("01_robot.py", "02_design.py", "03_nominal.py")
"""Chapters of the report, in order."""

_SIMULATION_SHARE, _FIGURES_SHARE = 0.15, 0.1


def write_study_report(
    scenario: Scenario, out: Path, *, progress: ReportProgress = ignore_progress
) -> StudyRecord:
    """Run the study of `scenario` and write it up in the folder `out`; returns the study.

    Writes report.html, report.pdf, values.json, gains.json, scenario.toml and figures/. Nothing
    of it appears in `out` before all of it is finished; other files there are left alone. Raises
    what `run_study` and `render_report` raise.
    """
    scenario = with_absolute_paths(scenario)
    study = run_study(
        scenario, progress=lambda done: progress("simulating", _SIMULATION_SHARE * done)
    )
    with staging_folder(out) as folder:
        progress("drawing figures", _SIMULATION_SHARE)
        save_figures(study_figures(study), folder / "figures")
        save_scenario(scenario, folder / "scenario.toml")
        write_json(study_values(study), folder / "values.json")
        write_json(gains_document(scenario, study.design), folder / "gains.json")
        render_report(
            [notebooks_directory() / name for name in REPORT_NOTEBOOKS],
            title=scenario.title,
            subtitle=f"Robot {study.robot.name}, heart motion {study.motion.name}, "
            f"tissue {scenario.stiffness:g} N/m, mrac_design {version('mrac-design')}",
            scenario=folder / "scenario.toml",
            html=folder / "report.html",
            pdf=folder / "report.pdf",
            progress=_after(progress, _SIMULATION_SHARE + _FIGURES_SHARE),
        )
        publish_contents(folder, out)
    return study


def with_absolute_paths(scenario: Scenario) -> Scenario:
    """Paths that work from anywhere: the notebooks run in a folder of their own."""

    def absolute(name_or_path: str) -> str:
        path = Path(name_or_path)
        return str(path.resolve()) if path.is_file() else name_or_path

    motion = replace(scenario.motion, source=absolute(scenario.motion.source))
    return replace(scenario, robot=absolute(scenario.robot), motion=motion)


def write_json(content: Mapping[str, Any], path: Path) -> None:
    """Plain data as a JSON file for people and machines."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def _after(progress: ReportProgress, start: float) -> Callable[[str, float], None]:
    return lambda message, fraction: progress(message, start + (1 - start) * fraction)
