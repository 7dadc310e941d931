"""The stability report as a folder: report, certificates, numbers and what they come from."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mrac_design.assessment.choices import choices_path, load_choices
from mrac_design.errors import CertificateError, ParameterError
from mrac_design.publishing import publish_contents, staging_folder
from mrac_design.report.rendering import (
    RESULTS_VARIABLE,
    ReportProgress,
    ignore_progress,
    render_report,
)
from mrac_design.report.study_report import with_absolute_paths
from mrac_design.resources import notebooks_directory
from mrac_design.simulation.scenario import Scenario, save_scenario
from mrac_design.study import check_scenario
from mrac_design.verify import verify_certificate

STABILITY_NOTEBOOKS = ("05_stability.py",)
"""Chapters of the report, in order."""

CHOICES_VARIABLE = "MRAC_STABILITY"
"""Environment variable: the file of choices the notebook is to use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityReport:
    """A stability report that has been written."""

    folder: Path
    """Where it lies."""
    certificates: tuple[Path, ...]
    """Certificates in it, each accepted by the independent checker before it was published."""
    values: Mapping[str, Any]
    """The numbers of values.json."""


def write_stability_report(
    scenario: Scenario,
    out: Path,
    *,
    choices: str = "paper",
    progress: ReportProgress = ignore_progress,
) -> StabilityReport:
    """Certify, try and write up the stability of a scenario's design in the folder `out`.

    `choices` names what is certified and how hard it is tried, packaged or a TOML file. Writes
    report.html, report.pdf, certificate_*.json, values.json, scenario.toml and stability.toml;
    nothing of it appears in `out` before all of it is finished. Every certificate is checked again
    by the code that knows no solver. Raises what `render_report` raises, CertificateError when a
    certificate is refused, ParameterError for a design with an internal model.
    """
    # A mistake in either file is told before anything is run.
    load_choices(choices)
    check_scenario(scenario)
    if scenario.design.internal_model != (1.0,):
        raise ParameterError(
            "scenario",
            scenario.name,
            "has an internal model, and this report follows the paper's argument, which has none; "
            f"prove its stability with: mrac certify -s {scenario.name}",
        )
    with staging_folder(out) as folder:
        save_scenario(with_absolute_paths(scenario), folder / "scenario.toml")
        shutil.copyfile(choices_path(choices), folder / "stability.toml")
        render_report(
            [notebooks_directory() / name for name in STABILITY_NOTEBOOKS],
            title=f"Stability: {scenario.title}",
            subtitle=f"Choices {load_choices(choices).name}, mrac_design {version('mrac-design')}",
            scenario=folder / "scenario.toml",
            html=folder / "report.html",
            pdf=folder / "report.pdf",
            environment={
                RESULTS_VARIABLE: str(folder.absolute()),
                CHOICES_VARIABLE: str((folder / "stability.toml").absolute()),
            },
            progress=progress,
        )
        names = sorted(path.name for path in folder.glob("certificate_*.json"))
        for name in names:
            _require_accepted(folder / name)
        values = json.loads((folder / "values.json").read_text(encoding="utf-8"))
        publish_contents(folder, out)
    return StabilityReport(
        folder=out, certificates=tuple(out / name for name in names), values=values
    )


def _require_accepted(path: Path) -> None:
    findings = verify_certificate(path).findings
    if findings:
        first = findings[0]
        raise CertificateError(f"{path.name}, line {first.line}: {first.problem}")
