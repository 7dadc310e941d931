"""`mrac realtime`: the exported controller on this machine's clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mrac_design.cli.console import json_text, messages, output, print_json
from mrac_design.cli.options import JsonOption, RealChoice, StudyOptions, takes
from mrac_design.errors import FileError, ParameterError

if TYPE_CHECKING:  # loading them takes longer than `--help` should
    from rich.table import Table

    from mrac_design.realtime import RealtimeReport, RealtimeRun

_DURATION = 2.0


@takes(StudyOptions)
def realtime(
    options: StudyOptions,
    rates: Annotated[
        str, typer.Option(help="Sampling rates (Hz), separated by commas.")
    ] = "1000,2000,4000",
    delay: Annotated[
        int | None,
        typer.Option(
            help="Whole samples between a measurement and its torque; else the scenario's, or 1."
        ),
    ] = None,
    real: Annotated[
        RealChoice, typer.Option(help="Floating-point type of the controller.")
    ] = RealChoice.DOUBLE,
    out: Annotated[
        Path | None, typer.Option(help="Folder for realtime.json and latency.png, .svg.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run the exported C step on the clock against the simulated robot; measure its latencies.

    Each rate runs for --duration, 2 s unless given. Torques are compared with the simulation's.

    Example: mrac realtime --rates 1000,2000,4000 --duration 2 --out reports/realtime
    """
    from mrac_design.export.c_expressions import REAL_TYPES
    from mrac_design.realtime import run_realtime

    wanted = _parsed(rates)
    base = replace(options, duration=None).chosen()
    duration = _DURATION if options.duration is None else options.duration
    scenario = replace(base, simulation=replace(base.simulation, duration=duration, settling=0.0))
    with messages().status("real time") as status:
        report = run_realtime(
            scenario,
            rates=wanted,
            delay=delay,
            number=REAL_TYPES[real.value],
            progress=lambda message, _: status.update(message),
        )
    if out is not None:
        _write(report, out)
    if as_json:
        print_json(report.values())
    else:
        _print(report)


def _parsed(rates: str) -> Sequence[float]:
    try:
        return [float(rate) for rate in rates.split(",")]
    except ValueError:
        raise ParameterError(
            "--rates", rates, "must be numbers in Hz separated by commas, as 1000,2000"
        ) from None


def _write(report: RealtimeReport, out: Path) -> None:
    from mrac_design.publishing import publish_file, staging_folder
    from mrac_design.report.figures_realtime import save_latency_figure

    try:
        with staging_folder(out) as staging:
            (staging / "realtime.json").write_text(json_text(report.values()), "utf-8")
            publish_file(staging / "realtime.json", out / "realtime.json")
        save_latency_figure(report, out)
    except OSError as problem:
        raise FileError(
            out, "", f"the results cannot be written: {problem.strerror or problem}"
        ) from problem


def _print(report: RealtimeReport) -> None:
    from rich.table import Table

    table = Table(
        "rate (Hz)", "time (µs)", "p50", "p99", "p99.9", "max", "missed",
        title=f"{report.controller} on {report.robot}, {report.duration:g} s, "
        f"delay {report.delay}, {report.real}",
    )  # fmt: skip
    for run in report.runs:
        _add_rows(table, run)
        table.add_section()
    output().print(table)
    for run in report.runs:
        _say(f"{run.rate:g} Hz: torques against the simulation's: {run.agreement}")
        _say(f"    {_conditions(run)}")
    for text in dict.fromkeys(_cost(run) for run in report.runs):
        _say(text)
    _say(f"measured on {report.machine}")


def _add_rows(table: Table, run: RealtimeRun) -> None:
    from mrac_design.realtime.record import time_percentiles

    record = run.record
    parts = {"wake-up": record.wake, "step": record.step, "torque ready": record.response}
    for number, (name, values) in enumerate(parts.items()):
        times = time_percentiles(values)
        first = number == 0
        table.add_row(
            f"{run.rate:g}" if first else "",
            name,
            *times.in_microseconds(),
            f"{record.missed} of {record.wake.size}" if first else "",
        )


def _conditions(run: RealtimeRun) -> str:
    record = run.record
    lock = f"refused ({record.memory_lock})" if record.memory_lock else "granted"
    priority = f"refused ({record.priority})" if record.priority else "granted"
    return (
        f"memory lock {lock}, real-time priority {priority}, {record.page_faults} page faults, "
        f"preempted {record.preemptions} times, clock read in {1e9 * record.clock_cost:.0f} ns"
    )


def _cost(run: RealtimeRun) -> str:
    costs = run.costs
    count = "not counted" if costs.instructions is None else f"{costs.instructions:.0f}"
    return f"a step: {costs.operations} operations, instructions {count} ({costs.tools})"


def _say(text: str) -> None:
    output().print(text, highlight=False, soft_wrap=True, markup=False)
