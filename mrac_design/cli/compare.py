"""`mrac compare`: every controller tuned alike, judged alike, and set beside the limit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mrac_design.cli.console import output, print_json, progress_bar
from mrac_design.cli.options import JsonOption

if TYPE_CHECKING:  # loading them takes longer than `--help` should
    from mrac_design.comparison import Comparison, ComparisonSpecification
    from mrac_design.simulation.scenario import MotionChoice


def compare(
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("reports/comparison"),
    scenario: Annotated[
        str, typer.Option("--scenario", "-s", help="Packaged scenario or TOML file, sampled.")
    ] = "reality",
    motion: Annotated[
        str | None, typer.Option(help="Packaged motion or recording (CSV, .mat).")
    ] = None,
    point: Annotated[str | None, typer.Option(help="Tracked point of the recording.")] = None,
    frame_rate: Annotated[
        float | None, typer.Option(help="Frames a second of the recording (Hz).")
    ] = None,
    axis: Annotated[str, typer.Option(help="Axis of the motion: X, Y or Z.")] = "Z",
    budget: Annotated[int, typer.Option(help="Evaluations each controller is tuned with.")] = 160,
    seeds: Annotated[int, typer.Option(help="Draws of the noise each is judged with.")] = 8,
    only: Annotated[
        str | None, typer.Option(help="Names of controllers, separated by commas.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Compare all controllers: same tuner, same budget, same noise, motions they never saw.

    Finished controllers are kept in the folder; an interrupted comparison goes on from there.

    Example: mrac compare --motion heart.csv --frame-rate 25 --out reports/comparison
    """
    from mrac_design.comparison import comparison_specification, comparison_values
    from mrac_design.simulation.scenario import load_scenario

    base = load_scenario(scenario)
    specification = comparison_specification(
        replace(base, motion=_motion(base.motion, motion, point, frame_rate)),
        axis=axis,
        budget=budget,
        seeds=seeds,
        taking_part=None if only is None else tuple(only.split(",")),
    )
    comparison = _written(specification, out)
    if as_json:
        values = {"out": str(out), **comparison_values(comparison)}
        print_json(values)
    else:
        _print(comparison)
        output().print(f"Report: {out / 'report.html'}", soft_wrap=True)


def _written(specification: ComparisonSpecification, out: Path) -> Comparison:
    from mrac_design.report.comparison_report import write_comparison_report

    with progress_bar("comparison") as progress:
        return write_comparison_report(specification, out, progress=progress)


def _motion(
    base: MotionChoice, source: str | None, point: str | None, frame_rate: float | None
) -> MotionChoice:
    """The scenario's motion with what was given; a path then works from anywhere."""
    chosen = base.source if source is None else source
    return replace(
        base,
        source=str(Path(chosen).resolve()) if Path(chosen).is_file() else chosen,
        point=base.point if point is None else point,
        frame_rate=base.frame_rate if frame_rate is None else frame_rate,
    )


def _print(comparison: Comparison) -> None:
    from rich.table import Table

    from mrac_design.comparison.findings import claims, findings, measured_under, ranking

    first, second = comparison.conditions.judged[:2]
    table = Table(
        "controller", "held back, rms mN", "stiffer, rms mN", "motion mN", "amplification",
        title=comparison.conditions.training.title,
    )  # fmt: skip
    for contestant in ranking(comparison, first.name):
        judgement = comparison.entries[contestant.name].judgement
        cells = [
            f"{1e3 * m.mean:.2f} ± {1e3 * m.half_width:.2f}" if not m.lost else "lost"
            for m in (measured_under(comparison, contestant.name, c.name) for c in (first, second))
        ]
        noise = f"{1e3 * judgement.motion_error:.2f}", f"{judgement.amplification:.2f}"
        table.add_row(contestant.title, *cells, *noise)
    limits = [f"{1e3 * comparison.limits[c.name].error:.2f}" for c in (first, second)]
    table.add_row("limit of linear control", *limits, "", "")
    output().print(table)
    for sentence in findings(comparison):
        output().print(sentence.replace("**", ""), markup=False, highlight=False)
    for claim in claims(comparison):
        verdict = "met" if claim.met else "NOT MET"
        output().print(
            f"{verdict}: {claim.text}: {claim.value} (wanted {claim.bound})",
            markup=False,
            highlight=False,
        )
