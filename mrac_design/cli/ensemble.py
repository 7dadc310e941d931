"""`mrac ensemble`: thousands of runs over what nobody knows exactly."""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mrac_design.cli.console import json_text, messages, output, progress_bar
from mrac_design.cli.options import JsonOption, StudyOptions, takes
from mrac_design.errors import EnsembleError, FileError, ParameterError

if TYPE_CHECKING:  # loading them takes longer than `--help` should
    from mrac_design.ensemble_study import EnsembleRecord
    from mrac_design.simulation.ensemble import Workers

_ADDRESS = r"(tcp|tls|wss?|ucx)://.+:\d+"
_INTERRUPTED = 130


def _option(*names: str, text: str) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Ensemble")


@takes(StudyOptions)
def ensemble(
    options: StudyOptions,
    runs: Annotated[int, _option("--runs", "-n", text="Number of runs.")] = 1000,
    seed: Annotated[int, _option("--seed", text="Seed of all draws.")] = 0,
    stiffness_range: Annotated[
        tuple[float, float] | None,
        _option("--stiffness-range", text="True Ks, N/m; else 0.6 to 1.5 × the scenario's."),
    ] = None,
    gain_range: Annotated[
        tuple[float, float] | None,
        _option("--gain-range", text="Scaled γ̂; else 0.5 to 2 × the scenario's."),
    ] = None,
    inertia_spread: Annotated[
        float, _option("--inertia-spread", text="Largest relative change of each true body.")
    ] = 0.05,
    motion_seeds: Annotated[
        int | None,
        _option("--motion-seeds", text="Heart motions to pick from; else 32, a recording has 1."),
    ] = None,
    variant: Annotated[
        str, _option("--variant", text="frozen, adaptive or adaptive_inverse.")
    ] = "adaptive_inverse",
    step: Annotated[
        float | None, _option("--step", text="Integration step (s); else from the design.")
    ] = None,
    workers: Annotated[
        int | None, _option("--workers", text="Threads, or processes of --cluster local.")
    ] = None,
    cluster: Annotated[
        str | None, _option("--cluster", text="Dask scheduler, tcp://host:port, or: local.")
    ] = None,
    store: Annotated[
        Path | None, _option("--store", text="Folder that keeps finished runs; run again to go on.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for summary.json, runs.npz, ensemble.png and .svg.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run a scenario thousands of times over tissue, true robot, gain and motion.

    The same seed gives the same table on any number of cores or machines.

    Example: mrac ensemble --runs 100000 --duration 6 --store runs/first --out reports/ensemble
    """
    from mrac_design.ensemble_study import EnsembleChoice, prepare_ensemble, run_prepared
    from mrac_design.simulation.store import EnsembleStore

    _check(workers, cluster)
    choice = EnsembleChoice(
        runs=runs, seed=seed, stiffness_range=stiffness_range, gain_range=gain_range,
        inertia_spread=inertia_spread, motion_seeds=motion_seeds, variant=variant, step=step,
    )  # fmt: skip
    try:
        with progress_bar(f"{runs} runs") as bar, _workers(workers, cluster) as hands:
            record = run_prepared(
                prepare_ensemble(options.chosen(), choice),
                workers=hands,
                store=None if store is None else EnsembleStore(store),
                progress=partial(bar, f"{runs} runs"),
            )
    except KeyboardInterrupt:
        _say_interrupted(store)
        raise typer.Exit(_INTERRUPTED) from None
    values = record.values()
    if out is not None:
        _write(record, values, out)
    if as_json:
        sys.stdout.write(json_text(values))
    else:
        _print(record, values)


def _check(workers: int | None, cluster: str | None) -> None:
    if workers is not None and workers < 1:
        raise ParameterError("--workers", workers, "must be at least 1")
    if cluster not in (None, "local") and not re.fullmatch(_ADDRESS, str(cluster)):
        raise ParameterError("--cluster", cluster, "must be tcp://host:port, or local")
    if workers is not None and cluster not in (None, "local"):
        raise ParameterError(
            "--workers", workers, f"{cluster} has workers of its own; leave it out"
        )


@contextmanager
def _workers(count: int | None, cluster: str | None) -> Iterator[Workers]:
    """Threads, a cluster of processes for this command only, or someone else's cluster."""
    from mrac_design.simulation.cluster import DaskCluster
    from mrac_design.simulation.ensemble import LocalThreads

    if cluster is None:
        yield LocalThreads(count=count)
    elif cluster != "local":
        yield DaskCluster(address=cluster)
    else:
        try:
            from distributed import LocalCluster
        except ImportError as problem:
            raise EnsembleError(
                "clusters need dask and distributed: pip install 'mrac-design[cluster]'"
            ) from problem
        with LocalCluster(
            n_workers=count or len(os.sched_getaffinity(0)),
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=logging.ERROR,
        ) as own:
            yield DaskCluster(address=own.scheduler_address)


def _say_interrupted(store: Path | None) -> None:
    messages().print(
        "interrupted; nothing was kept: with --store DIR finished runs stay there"
        if store is None
        else f"interrupted; finished runs are kept in {store}: give the same command to go on",
        soft_wrap=True,
        markup=False,
    )


def _write(record: EnsembleRecord, values: dict[str, Any], out: Path) -> None:
    from mrac_design.publishing import publish_file, staging_folder
    from mrac_design.report.figures_ensemble import save_ensemble_figure

    try:
        with staging_folder(out) as staging:
            (staging / "summary.json").write_text(json_text(values), encoding="utf-8")
            record.save_runs(staging / "runs.npz")
            for name in ("summary.json", "runs.npz"):
                publish_file(staging / name, out / name)
        save_ensemble_figure(record, out)
    except OSError as problem:
        raise FileError(
            out, "", f"the results cannot be written: {problem.strerror or problem}"
        ) from problem


def _print(record: EnsembleRecord, values: dict[str, Any]) -> None:
    from rich.table import Table

    metrics = values["metrics"]
    table = Table(
        "error", "axis", "median mN", "95 % mN", "99 % mN", "largest mN",
        title=f"{values['runs']} runs of {values['scenario']} on {values['robot']}",
    )  # fmt: skip
    for name, text in (("max_force_error_N", "max |y − Fd|"), ("rms_force_error_N", "rms y − Fd")):
        for axis, spread in metrics[name].items():
            table.add_row(text, axis, *(f"{1e3 * value:.3g}" for value in spread.values()))
    output().print(table)
    drawn, ensemble = values["drawn"], record.prepared.ensemble
    gain = drawn["adaptation_gain"]
    low, high = drawn["stiffness_N_per_m"]
    _say(
        f"drawn: Ks {low:g} to {high:g} N/m, "
        + (f"γ̂ {gain[0]:g} to {gain[1]:g}, " if gain else "")
        + f"bodies × {drawn['body_scale'][0]:g} to {drawn['body_scale'][1]:g}, "
        f"{drawn['motions']} motions of {values['motion']['name']}; seed {drawn['seed']}"
    )
    _say(f"diverged: {values['diverged']}; at an effort limit: {values['at_an_effort_limit']}")
    _say(
        f"step {1e3 * values['step_s']:g} ms; with half of it the first runs' errors change by at "
        f"most {values['change_with_half_the_step_N']:.2g} N"
    )
    if record.computed < ensemble.chunks:
        kept = ensemble.chunks - record.computed
        _say(f"{kept} of {ensemble.chunks} pieces were already kept")


def _say(text: str) -> None:
    output().print(text, highlight=False, soft_wrap=True, markup=False)
