"""Runs the measurements and prints ratios: `python -m benchmarks [--quick] [--out FOLDER]`."""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.measure import Result, machine
from benchmarks.picture import draw
from benchmarks.sections import measure_section
from benchmarks.shows import Show, loop_shows, terms_shows
from benchmarks.start_up import start_up
from mrac_design.simulation.compilation import find_compiler

CONSOLE = Console(width=150)


def main() -> None:
    """Measure everything and show it."""
    logging.disable(logging.INFO)
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer rounds, a shorter run")
    parser.add_argument("--out", type=Path, default=Path("reports/benchmarks"))
    chosen = parser.parse_args()
    compiler = find_compiler()
    if compiler is None:
        raise SystemExit("the benchmarks compare compiled code: install a C compiler")
    rounds = 5 if chosen.quick else 15
    CONSOLE.print(machine())
    duration = 1.0 if chosen.quick else 3.0
    terms = _apart("terms", compiler, rounds, duration)
    _show("Rigid-body terms, five joints", "ns", terms)
    single = _apart("single", compiler, rounds, duration)
    _show("One run of the closed loop", "ms per simulated second", single)
    many = _apart("many", compiler, rounds, duration)
    _show("One of many runs, per core", "ms per simulated second", many)
    _show("Commands from start to end", "s of processor time", start_up(rounds=rounds))
    _claims([*terms_shows(terms), *loop_shows("single", single), *loop_shows("many", many)])
    path = draw({"One run": single, "One of many": many}, terms, chosen.out)
    CONSOLE.print(f"picture: {path}; load at the end {os.getloadavg()[0]:.1f}")


def _apart(section: str, compiler: str, rounds: int, duration: float) -> list[Result]:
    """A section's results, from a process of its own: peers' libraries do not all get along."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        results, remarks = pool.submit(
            measure_section, section, compiler, rounds, duration
        ).result()
    for remark in remarks:
        CONSOLE.print(remark)
    return results


def _show(title: str, unit: str, results: Sequence[Result]) -> None:
    fastest = min(result.cost for result in results)
    table = Table("who", unit, "ratio", "error N", "set-up s", "", title=title)
    for result in sorted(results, key=lambda result: result.cost):
        table.add_row(
            result.name,
            f"{result.cost:.3g}",
            f"{result.cost / fastest:.2f}",
            "" if result.error is None else f"{result.error:.1e}",
            f"{result.setup:.1f}",
            result.note,
        )
    CONSOLE.print(table)


def _claims(shows: Sequence[Show]) -> None:
    table = Table(
        "peer's time over this package's, at no larger error", "median (quartiles)", "wanted", "",
        "this package's setting",
        title="Claims",
    )  # fmt: skip
    for show in shows:
        table.add_row(
            show.claim,
            str(show.ratio),
            f"{'≤' if show.at_most else '≥'} {show.wanted:g}",
            "holds" if show.holds else "FALLS SHORT",
            show.setting,
        )
    CONSOLE.print(table)


if __name__ == "__main__":
    main()
