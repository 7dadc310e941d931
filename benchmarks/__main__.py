"""Runs the measurements and prints ratios: `python -m benchmarks [--quick] [--out FOLDER]`."""

from __future__ import annotations

import argparse
import logging
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.measure import Result, machine
from benchmarks.picture import draw
from benchmarks.sections import measure_section
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
    say = CONSOLE.print
    say(machine())
    duration = 1.0 if chosen.quick else 3.0
    terms = _apart("terms", compiler, rounds, duration)
    _show("Rigid-body terms, five joints", "ns", terms)
    single = _apart("single", compiler, rounds, duration)
    _show("One run of the closed loop", "ms per simulated second", single)
    _compare(single, say)
    many = _apart("many", compiler, rounds, duration)
    _show("One of many runs, per core", "ms per simulated second", many)
    _compare(many, say)
    path = draw({"One run": single, "One of many": many}, terms, chosen.out)
    say(f"picture: {path}")


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


def _compare(results: Sequence[Result], say) -> None:
    """Peers against this package at each peer's own error, interpolated between settings."""
    own = sorted((r.error, r.cost) for r in results if r.name.startswith("mrac_design"))
    own = [p for p in own if not any(e <= p[0] and c < p[1] for e, c in own)]
    errors, costs = (np.log([point[i] for point in own]) for i in (0, 1))
    for result in results:
        if result.name.startswith("mrac_design") or not result.error:
            continue
        equal = float(np.exp(np.interp(np.log(result.error), errors, costs)))
        say(f"{result.name}: {result.cost / equal:.2f} × this package's time at equal error")


if __name__ == "__main__":
    main()
