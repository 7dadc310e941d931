"""`mrac paper`: the paper's three simulations under its own figure numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from mrac_design.cli.console import output, print_json, progress_bar
from mrac_design.cli.options import JsonOption, StudyOptions, takes


@takes(StudyOptions, without=("scenario", "stiffness", "omega", "xi"))
def paper(
    options: StudyOptions,
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("reports/paper"),
    as_json: JsonOption = False,
) -> None:
    """Repeat the paper's three simulations and write them up: figures 5 to 13, its numbers, ours.

    What the paper states is fixed; robot, motion and what else it leaves open may be changed.

    Example: mrac paper --motion heart.csv --frame-rate 25 --out reports/my_paper
    """
    from mrac_design.report.paper import PAPER_SIMULATIONS
    from mrac_design.report.paper_report import write_paper_report

    scenarios = [replace(options, scenario=item.scenario).chosen() for item in PAPER_SIMULATIONS]
    with progress_bar("paper") as progress:
        values = write_paper_report(scenarios, out, progress=progress)
    if as_json:
        print_json({"out": str(out), **values})
    else:
        _print(values)
        output().print(f"Report: {out / 'report.html'}", soft_wrap=True)


def _print(values: Mapping[str, Any]) -> None:
    from rich.table import Table

    simulations = values["simulations"]
    variants = list(simulations[0]["metrics"])
    table = Table(
        "simulation", "axis", "paper", *variants, title="largest |y − Fd|, % of the largest Fd"
    )
    for entry in simulations:
        stated = entry["paper"]["max_force_error_percent"]
        for axis in entry["metrics"][variants[0]]:
            ours = [
                f"{entry['metrics'][variant][axis]['max_force_error_percent']:.3g}"
                for variant in variants
            ]
            theirs = f"{stated[axis]:g}" if axis in stated else "–"
            table.add_row(entry["scenario"], axis, theirs, *ours)
    output().print(table)
