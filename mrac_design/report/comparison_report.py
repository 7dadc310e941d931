"""A comparison as a folder: report, figures, numbers, and the finished runs it can go on from."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

from mrac_design.comparison import (
    Comparison,
    ComparisonSpecification,
    ComparisonStore,
    comparison_values,
    run_comparison,
    save_specification,
)
from mrac_design.publishing import publish_file, publish_folder, staging_folder
from mrac_design.report import figures_comparison as draw
from mrac_design.report.rendering import ReportProgress, ignore_progress, render_report
from mrac_design.report.style import styled
from mrac_design.resources import notebooks_directory

NOTEBOOK = "06_comparison.py"
"""The report's only chapter."""
RUNS = "runs"
"""Folder of finished contestants, beside the specification."""
_RUNNING_SHARE = 0.9

FIGURES = {
    "ranking": draw.error_ranking_figure,
    "pareto": draw.pareto_figure,
    "limit_distance": draw.limit_distance_figure,
}
"""File name (without suffix) → what draws the picture."""


def write_comparison_report(
    specification: ComparisonSpecification,
    out: Path,
    *,
    progress: ReportProgress = ignore_progress,
) -> Comparison:
    """Run a comparison and write it up in the folder `out`; returns the comparison.

    Writes report.html, report.pdf, values.json, comparison.json, figures/ and runs/. Contestants
    are kept in runs/ as they are finished, and taken from there the next time. Raises what
    `run_comparison` and `render_report` raise.
    """
    comparison = run_comparison(
        specification,
        store=ComparisonStore(out / RUNS),
        progress=lambda message, share: progress(message, _RUNNING_SHARE * share),
    )
    with staging_folder(out / "values.json") as folder:
        progress("drawing figures", _RUNNING_SHARE)
        _save_figures(comparison, folder / "figures")
        text = json.dumps(comparison_values(comparison), indent=2, ensure_ascii=False)
        (folder / "values.json").write_text(text + "\n", encoding="utf-8")
        save_specification(specification, folder / "comparison.json")
        publish_file(folder / "comparison.json", out / "comparison.json")
        setting = specification.setting
        render_report(
            [notebooks_directory() / NOTEBOOK],
            title="Force controllers compared",
            subtitle=f"One axis at {1 / setting.period:g} Hz, {setting.delay} sample(s) of delay, "
            f"{1e3 * setting.noise:g} mN of noise, mrac_design {version('mrac-design')}",
            scenario=out / "comparison.json",
            html=folder / "report.html",
            pdf=folder / "report.pdf",
            progress=lambda message, share: progress(
                message, _RUNNING_SHARE + (1 - _RUNNING_SHARE) * share
            ),
        )
        for finished in sorted(folder.iterdir()):
            publish = publish_folder if finished.is_dir() else publish_file
            publish(finished, out / finished.name)
    return comparison


def _save_figures(comparison: Comparison, directory: Path) -> None:
    directory.mkdir()
    for name, factory in FIGURES.items():
        figure = factory(comparison)
        (directory / f"{name}.svg").write_text(figure.svg(), encoding="utf-8")
        with styled():
            figure.savefig(directory / f"{name}.png")
