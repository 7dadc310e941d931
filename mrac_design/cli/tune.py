"""`mrac tune`: K2, γ̂ and more chosen by the computer, within stated constraints."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from mrac_design.cli.console import json_text, messages, output, print_json, progress_bar
from mrac_design.cli.options import JsonOption, StudyOptions, takes
from mrac_design.errors import FileError

if TYPE_CHECKING:  # loading them takes longer than `--help` should
    from mrac_design.simulation.scenario import MotionChoice
    from mrac_design.tuning.judging import Judgement
    from mrac_design.tuning.tuner import Point, TuningChoice, TuningRecord

_INTERRUPTED = 130
_SCENARIOS = ["nominal", "parameters", "stiffness"]
_WORDS = ("start", "tuned")
_SEARCH_SHARE = 0.6
"""The search's share of the progress bar; the rest is judging."""

Bar = Callable[[str, float], None]


@takes(
    StudyOptions,
    without=("scenario", "robot", "stiffness", "k2", "omega", "xi", "ao", "gain"),
)
def tune(
    options: StudyOptions,
    delay_margin: Annotated[
        float,
        typer.Option(
            help="Dead time (s) every scenario's adaptive loop must bear, on its own tissue."
        ),
    ],
    free: Annotated[
        str,
        typer.Option(
            help="What may be chosen, of k2, gain, ao, alpha; with a range of your own: "
            "ao=250:4000."
        ),
    ] = "k2,gain",
    names: Annotated[
        list[str],
        typer.Option(
            "--scenario",
            "-s",
            help="Packaged scenario or TOML file; again for more.",
            rich_help_panel="Scenario",
        ),
    ] = _SCENARIOS,
    unseen: Annotated[
        list[str] | None,
        typer.Option(
            help="Motion, or point of the recording, only judged on; again for more; else "
            "parametric."
        ),
    ] = None,
    budget: Annotated[int, typer.Option(help="Evaluations, each a run of every scenario.")] = 40,
    seed: Annotated[int, typer.Option(help="Seed of the search's later starts.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("reports/tuning"),
    as_json: JsonOption = False,
) -> None:
    """Tune K2, γ̂ and more: the least worst force error over scenarios and axes.

    Motors stay below their torque limits, the delay margin asked for is left, and the adaptation
    is slow enough for the integration. Writes <scenario>_tuned.toml, which mrac simulate runs,
    tuning.json and figures/. Interrupted, it keeps the best so far.

    Example: mrac tune --delay-margin 0.9e-3 --free k2,gain,ao --motion heart.csv --unseen p1
    """
    from mrac_design.tuning.judging import unseen_motions
    from mrac_design.tuning.results import tuning_values
    from mrac_design.tuning.tuner import TuningChoice
    from mrac_design.tuning.variables import read_variables

    choice = TuningChoice(
        scenarios=tuple(replace(options, scenario=name).chosen() for name in names),
        variables=read_variables(free),
        delay_margin=delay_margin,
        budget=budget,
        seed=seed,
    )
    motions = unseen_motions(choice.scenarios[0], tuple(unseen or ()))
    with progress_bar("tuning") as bar:
        record = _searched(choice, out, bar)
        judgement = _judged(record, motions, out, bar)
    if as_json:
        print_json({"out": str(out), **tuning_values(record, judgement)})
    else:
        _print(record, judgement)
        output().print(f"Results: {out}", soft_wrap=True)
    if record.interrupted:
        raise typer.Exit(_INTERRUPTED)


def _searched(choice: TuningChoice, out: Path, bar: Bar) -> TuningRecord:
    """Search, and write the tuned scenarios at once: what follows only describes them."""
    from mrac_design.tuning.results import write_scenarios
    from mrac_design.tuning.tuner import tune as search

    def watch(count: int, best: float) -> None:
        found = "none admissible yet" if math.isinf(best) else f"best {best:.3g} %"
        bar(f"{count} of {choice.budget} tried, {found}", _SEARCH_SHARE * count / choice.budget)
        if asked_to_stop():
            raise KeyboardInterrupt

    with _stoppable() as asked_to_stop:
        record = search(choice, watch=watch)
    if record.interrupted:
        messages().print(
            f"interrupted after {len(record.tried)} evaluations: the best so far is kept; unseen "
            "motions and neighbours are left out",
            soft_wrap=True,
        )
    try:
        write_scenarios(record, out)
    except OSError as problem:
        raise _unwritable(out, problem) from problem
    return record


@contextmanager
def _stoppable() -> Iterator[Callable[[], bool]]:
    """Whether an interruption has come, to be asked between evaluations; a second one is raised.

    Raised at once it could fall into foreign code, which may swallow it.
    """
    asked: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)

    try:
        before = signal.signal(signal.SIGINT, note)
    except ValueError:  # not the main thread: interruptions go elsewhere
        yield lambda: False
        return
    try:
        yield lambda: bool(asked)
    finally:
        signal.signal(signal.SIGINT, before)


def _judged(
    record: TuningRecord, motions: tuple[MotionChoice, ...], out: Path, bar: Bar
) -> Judgement:
    """Judge the tuned choice (not after an interruption) and write numbers and picture."""
    from mrac_design.publishing import publish_file, staging_folder
    from mrac_design.report.figures_tuning import trade_off_figure
    from mrac_design.report.saving import save_figures
    from mrac_design.tuning.judging import UNJUDGED, judge
    from mrac_design.tuning.results import tuning_values

    judgement = UNJUDGED
    if not record.interrupted:
        judgement = judge(
            record,
            motions,
            lambda message, share: bar(message, _SEARCH_SHARE + (1 - _SEARCH_SHARE) * share),
        )
    try:
        with staging_folder(out / "tuning.json") as staging:
            content = json_text(tuning_values(record, judgement))
            (staging / "tuning.json").write_text(content, encoding="utf-8")
            publish_file(staging / "tuning.json", out / "tuning.json")
        figure = trade_off_figure(record, judgement.curves)
        save_figures({"trade_off": lambda: figure}, out / "figures")
    except OSError as problem:
        raise _unwritable(out, problem) from problem
    return judgement


def _unwritable(out: Path, problem: OSError) -> FileError:
    return FileError(out, "", f"the results cannot be written: {problem.strerror or problem}")


def _print(record: TuningRecord, judgement: Judgement) -> None:
    from mrac_design.tuning.judging import variable_text

    variables, start, tuned = record.choice.variables, record.start, record.tuned
    _print_cases(start, tuned)
    if judgement.unseen:
        _print_unseen(judgement)
    _say(f"tuned: {variable_text(variables, tuned.values)}")
    _say(
        f"worst error {start.worst:.3g} → {tuned.worst:.3g} %; least delay margin "
        f"{1e3 * start.delay_margin:.3g} → {1e3 * tuned.delay_margin:.3g} ms "
        f"({1e3 * record.choice.delay_margin:g} ms asked for); {len(record.tried)} evaluations"
    )
    if judgement.step_effect is not None:
        _say(
            f"with half the step the errors change by at most {judgement.step_effect:.2g} %-points"
        )


def _print_cases(start: Point, tuned: Point) -> None:
    from rich.table import Table

    axes = list(tuned.cases[0].errors)
    table = Table("scenario", "", *(f"{axis} %" for axis in axes), "margin ms", "torque %",
                  title="max |y − Fd| of max |Fd|, delay margin, torque of its limit")  # fmt: skip
    for pair in zip(start.cases, tuned.cases, strict=True):
        for name, word, case in zip((pair[0].scenario, ""), _WORDS, pair, strict=True):
            errors = [case.errors[axis] for axis in axes]
            numbers = (*errors, 1e3 * case.limits.delay_margin, 100 * case.torque_share)
            table.add_row(name, word, *(f"{number:.3g}" for number in numbers))
    output().print(table)


def _print_unseen(judgement: Judgement) -> None:
    from rich.table import Table

    axes = list(judgement.unseen[0].tuned.cases[0].errors)
    table = Table("motion not tuned on", "", *(f"{axis} %" for axis in axes), "torque %",
                  title="largest of all scenarios")  # fmt: skip
    for one in judgement.unseen:
        points = (one.start, one.tuned)
        for name, word, point in zip((one.motion, ""), _WORDS, points, strict=True):
            errors = (max(case.errors[axis] for case in point.cases) for axis in axes)
            numbers = (*errors, 100 * point.torque_share)
            table.add_row(name, word, *(f"{number:.3g}" for number in numbers))
    output().print(table)


def _say(text: str) -> None:
    output().print(text, highlight=False, soft_wrap=True, markup=False)
