"""The simulations of [Z] as a folder: report, figures, numbers, gains and the scenarios."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mrac_design.export.gains import gains_document
from mrac_design.export.values import study_values
from mrac_design.publishing import publish_contents, staging_folder
from mrac_design.report.paper import PAPER_SIMULATIONS, PaperStudy, check_paper_conditions
from mrac_design.report.rendering import (
    RESULTS_VARIABLE,
    ReportProgress,
    ignore_progress,
    render_report,
)
from mrac_design.report.saving import paper_figures, save_figures
from mrac_design.report.study_report import with_absolute_paths, write_json
from mrac_design.resources import notebooks_directory
from mrac_design.simulation.scenario import Scenario, load_scenario, save_scenario
from mrac_design.study import check_scenario

NOTEBOOK = "07_paper.py"
"""The report's only chapter."""


def write_paper_report(
    scenarios: Sequence[Scenario], out: Path, *, progress: ReportProgress = ignore_progress
) -> Mapping[str, Any]:
    """Run the three simulations of [Z] and write them up in the folder `out`; returns the numbers.

    `scenarios` come in the order of `PAPER_SIMULATIONS`. Writes report.html, report.pdf,
    values.json, gains.json, figures/ and scenarios/. Nothing of it appears in `out` before all of
    it is finished; other files there are left alone. Raises what `check_paper_conditions`,
    `check_scenario` and `render_report` raise.
    """
    # A mistake is told before anything is run.
    check_paper_conditions(scenarios)
    for scenario in scenarios:
        check_scenario(scenario)
    with staging_folder(out) as folder:
        _save_scenarios(scenarios, folder / "scenarios")
        first = scenarios[0]
        render_report(
            [notebooks_directory() / NOTEBOOK],
            title="The paper's three simulations",
            subtitle=f"Robot {Path(first.robot).stem}, heart motion "
            f"{Path(first.motion.source).stem}, mrac_design {version('mrac-design')}",
            scenario=folder / "scenarios",
            html=folder / "report.html",
            pdf=folder / "report.pdf",
            environment={RESULTS_VARIABLE: str(folder.absolute())},
            progress=progress,
        )
        values: Mapping[str, Any] = json.loads((folder / "values.json").read_text("utf-8"))
        publish_contents(folder, out)
    return values


def save_paper_results(studies: tuple[PaperStudy, ...], folder: Path) -> None:
    """Write figures/, values.json and gains.json of finished runs to `folder`."""
    save_figures(paper_figures(studies), folder / "figures")
    write_json(paper_values(studies), folder / "values.json")
    # One design serves all three: the controller is made for the tissue of the first.
    first = studies[0].study
    write_json(gains_document(first.scenario, first.design), folder / "gains.json")


def paper_values(studies: Sequence[PaperStudy]) -> dict[str, Any]:
    """Numbers of the three simulations as plain data, beside those that [Z] states."""
    return {
        "mrac_design": version("mrac-design"),
        "simulations": [
            {"paper": asdict(item.simulation), **study_values(item.study)} for item in studies
        ],
    }


def read_paper_scenarios(folder: Path) -> tuple[Scenario, ...]:
    """The scenarios that `write_paper_report` left in a folder; raises as `load_scenario` does."""
    return tuple(
        load_scenario(folder / f"{simulation.scenario}.toml") for simulation in PAPER_SIMULATIONS
    )


def _save_scenarios(scenarios: Sequence[Scenario], folder: Path) -> None:
    folder.mkdir()
    for simulation, scenario in zip(PAPER_SIMULATIONS, scenarios, strict=True):
        save_scenario(with_absolute_paths(scenario), folder / f"{simulation.scenario}.toml")
