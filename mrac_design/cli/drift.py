"""`mrac drift`: half an hour on one axis, without and with every safeguard of the adaptation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mrac_design.cli.console import output, print_json, progress_bar
from mrac_design.cli.options import JsonOption


def drift(
    scenario: Annotated[
        str, typer.Option("--scenario", "-s", help="Packaged scenario or TOML file, sampled.")
    ] = "reality_degree_one",
    minutes: Annotated[int, typer.Option(help="Minutes each run lasts.")] = 30,
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("reports/drift"),
    as_json: JsonOption = False,
) -> None:
    """Let the gains drift under noise and motion for half an hour, without and with safeguards.

    Example: mrac drift --minutes 10 --out reports/drift
    """
    from mrac_design.report.drift_report import write_drift_report
    from mrac_design.simulation.scenario import load_scenario

    chosen = load_scenario(scenario)
    with progress_bar("drift") as progress:
        values = write_drift_report(chosen, out, minutes=minutes, progress=progress)
    if as_json:
        print_json({"out": str(out), **values})
    else:
        _print(values)
        output().print(f"Report: {out / 'report.html'}", soft_wrap=True)


def _print(values: Mapping[str, Any]) -> None:
    from rich.table import Column, Table

    table = Table(
        Column("motion", no_wrap=True), Column("law", no_wrap=True), "rest N", "stray", "|pole|",
        "work mN", "max mN",
        title="how far the gains strayed, their largest pole when held, force errors",
    )  # fmt: skip
    for run in values["runs"]:
        lost = "lost" if run["lost"] is None else f"lost, min {run['lost'] + 1}"
        table.add_row(
            run["motion"],
            run["law"],
            f"{run['programme']['rest']:g}",
            f"{run['strayed']:.2f}",
            _shown(run["growth"], 1.0, ".3f"),
            _shown(run["work_rms"], 1e3, ".1f"),
            lost if run["largest"] is None else _shown(run["largest"], 1e3, ".0f"),
        )
    output().print(table)


def _shown(value: float | None, scale: float, form: str) -> str:
    return "–" if value is None else f"{scale * value:{form}}"
