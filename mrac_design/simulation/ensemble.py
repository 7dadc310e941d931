"""Thousands of runs: lanes × threads on one machine, or the workers of a cluster.

Runs are numbered; run i of an ensemble is drawn from the seed and i alone, chunks of runs are the
same whoever computes them, and a finished chunk is kept: so the table does not depend on cores,
threads, machines or interruptions.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from itertools import islice
from typing import Protocol

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.codegen.c_source import c_routine
from mrac_design.codegen.reading import read_function
from mrac_design.errors import CompilationError, ParameterError
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.lanes import LANES, Case, GroupEngine, LaneEngine, RecordingEngine
from mrac_design.simulation.method import Method
from mrac_design.simulation.program import c_program
from mrac_design.simulation.reduction import Reduction
from mrac_design.simulation.run import Progress, RunSettings
from mrac_design.simulation.schedule import build_schedule
from mrac_design.simulation.store import EnsembleStore, StoredEnsemble
from mrac_design.simulation.system import HybridSystem

_LOG = logging.getLogger(__name__)

Sampler = Callable[[int, np.random.Generator], Case]
"""Draws the case of a run from its number and a generator of its own; a cluster must be able to
pickle it. Called once a run, so it should take well under a millisecond."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ensemble:
    """Many runs of one system, fully specified."""

    system: HybridSystem
    """The equations."""
    method: Method
    """Integration method; only one without error control has the bits of single runs."""
    reduction: Reduction
    """What is kept of a run."""
    sampler: Sampler
    """What differs between runs."""
    settings: RunSettings
    """How runs are stepped and how often the reduction looks."""
    input_powers: int
    """Degree of the inputs + 1; lower ones are padded."""
    runs: int
    """Number of runs."""
    seed: int
    """Seed of all randomness."""
    chunk: int = 512
    """Runs in the smallest piece of work and of storage."""

    def __post_init__(self) -> None:
        for name in ("runs", "chunk"):
            if getattr(self, name) < 1:
                raise ParameterError(name, getattr(self, name), "must be at least 1")

    @property
    def chunks(self) -> int:
        """Number of pieces."""
        return -(-self.runs // self.chunk)

    def fingerprint(self) -> str:
        """A hash of everything the table depends on."""
        program = c_program(
            self.system,
            self.method,
            input_powers=self.input_powers,
            reduction=self.reduction.over(self.system),
        )
        finish = c_routine(read_function(self.reduction.finish), "finish")
        drawn = (self.sampler, self.settings, self.runs, self.seed, self.chunk)
        rest = (self.reduction.initial.tobytes(), self.reduction.metrics, *drawn)
        text = f"{program}\n{finish}".encode()
        return hashlib.sha256(text + pickle.dumps(rest, protocol=5)).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnsembleResult:
    """One row of metrics a run; NaN where a run left the finite numbers."""

    metrics: tuple[str, ...]
    """Names of the columns."""
    table: FloatArray
    """Shape (runs, len(metrics))."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", readonly(self.table, (-1, len(self.metrics))))

    def __getitem__(self, metric: str) -> FloatArray:
        """A metric of every run, shape (runs,)."""
        return self.table[:, self.metrics.index(metric)]

    @property
    def diverged(self) -> int:
        """Runs that left the finite numbers."""
        return int(np.isnan(self.table).any(axis=1).sum())

    def _repr_markdown_(self) -> str:
        lines = ["| metric | median | 95 % | 99 % | largest |", "|---|---|---|---|---|"]
        for name in self.metrics:
            low, high, higher = np.nanpercentile(self[name], [50, 95, 99])
            top = np.nanmax(self[name])
            lines.append(f"| {name} | {low:.4g} | {high:.4g} | {higher:.4g} | {top:.4g} |")
        return "\n".join([*lines, "", f"{len(self.table)} runs, {self.diverged} diverged"])


class Workers(Protocol):
    """Whoever computes chunks."""

    def results(
        self, ensemble: Ensemble, chunks: Sequence[int]
    ) -> Iterator[tuple[int, FloatArray]]:
        """Number and metrics (runs of the chunk, metrics) of every chunk, as they are finished."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalThreads:
    """Threads of this process: the generated code does not hold Python's lock."""

    count: int | None = None
    """How many; None takes one per core this process may use."""

    def results(
        self, ensemble: Ensemble, chunks: Sequence[int]
    ) -> Iterator[tuple[int, FloatArray]]:
        """See `Workers`."""
        count = self.count or len(os.sched_getaffinity(0))
        engine = group_engine(ensemble)
        with ThreadPoolExecutor(count) as pool:
            waiting = iter(chunks)
            running = {
                pool.submit(_numbered, ensemble, engine, number)
                for number in islice(waiting, 2 * count)
            }
            try:
                while running:
                    done, running = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        number = next(waiting, None)
                        if number is not None:
                            running.add(pool.submit(_numbered, ensemble, engine, number))
                        yield future.result()
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


def run_ensemble(
    ensemble: Ensemble,
    *,
    workers: Workers | None = None,
    store: EnsembleStore | None = None,
    progress: Progress | None = None,
) -> EnsembleResult:
    """All runs of an ensemble, on threads of this machine unless `workers` says otherwise.

    With a `store`, finished chunks are kept there, and those already there are not run again.
    Raises EnsembleError when the store is another ensemble's or damaged, SimulationError and the
    system's own errors as single runs do.
    """
    workers = workers or LocalThreads()
    table = np.full((ensemble.runs, len(ensemble.reduction.metrics)), np.nan)
    missing = list(range(ensemble.chunks))
    if store is not None:
        store.open(
            StoredEnsemble(
                fingerprint=ensemble.fingerprint(),
                version=version("mrac-design"),
                runs=ensemble.runs,
                seed=ensemble.seed,
                chunk=ensemble.chunk,
                metrics=ensemble.reduction.metrics,
            )
        )
        kept = store.finished()
        missing = [number for number in missing if number not in kept]
        for number in kept:
            table[_rows(ensemble, number)] = store.read(number)
    count = ensemble.chunks - len(missing)
    if missing:
        for number, rows in workers.results(ensemble, missing):
            table[_rows(ensemble, number)] = rows
            if store is not None:
                store.write(number, rows)
            count += 1
            if progress is not None:
                progress(count / ensemble.chunks)
    assert count == ensemble.chunks, f"{ensemble.chunks - count} chunks were not computed"
    return EnsembleResult(metrics=ensemble.reduction.metrics, table=table)


def group_engine(ensemble: Ensemble) -> GroupEngine:
    """Lanes of compiled C where there is a compiler, else the next best single-run engine."""
    compiler = find_compiler()
    powers = ensemble.input_powers
    if compiler is not None:
        try:
            return LaneEngine(
                ensemble.system,
                ensemble.method,
                ensemble.reduction,
                input_powers=powers,
                compiler=compiler,
            )
        except CompilationError as problem:
            _LOG.info("no vectors of runs: %s", problem)
    engine = build_engine(ensemble.system, ensemble.method, input_powers=powers)
    return RecordingEngine(ensemble.system, ensemble.reduction, engine, input_powers=powers)


def chunk_metrics(ensemble: Ensemble, engine: GroupEngine, number: int) -> FloatArray:
    """Metrics of the runs of one chunk, shape (runs of the chunk, metrics)."""
    rows = _rows(ensemble, number)
    groups: dict[bytes, list[tuple[int, Case]]] = defaultdict(list)
    for run in range(rows.start, rows.stop):
        case = ensemble.sampler(run, generator(ensemble.seed, run))
        groups[case.inputs.breakpoints.tobytes()].append((run - rows.start, case))
    sums = np.empty((rows.stop - rows.start, ensemble.reduction.initial.size))
    for group in groups.values():
        schedule = build_schedule(
            group[0][1].inputs,
            duration=ensemble.settings.duration,
            step=ensemble.settings.step,
            record_period=ensemble.settings.record_period,
            sampling_period=ensemble.system.sampling_period,
            spanning=engine.spanning,
        )
        for first in range(0, len(group), LANES):
            part = group[first : first + LANES]
            places, cases = [place for place, _ in part], [case for _, case in part]
            sums[places] = engine.accumulate(schedule, cases)
    return ensemble.reduction.finished(sums)


def generator(seed: int, run: int) -> np.random.Generator:
    """Random numbers of one run, whoever computes it and whenever."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,)))


def work(payload: bytes, number: int) -> tuple[int, FloatArray]:
    """A chunk of a pickled ensemble, for workers in other processes."""
    ensemble, engine = _unpacked(payload)
    return _numbered(ensemble, engine, number)


@lru_cache(maxsize=2)
def _unpacked(payload: bytes) -> tuple[Ensemble, GroupEngine]:
    ensemble: Ensemble = pickle.loads(payload)
    return ensemble, group_engine(ensemble)


def _numbered(ensemble: Ensemble, engine: GroupEngine, number: int) -> tuple[int, FloatArray]:
    return number, chunk_metrics(ensemble, engine, number)


def _rows(ensemble: Ensemble, number: int) -> slice:
    first = number * ensemble.chunk
    return slice(first, min(first + ensemble.chunk, ensemble.runs))
