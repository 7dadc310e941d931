"""Runs a prepared ensemble and judges its step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrac_design.ensemble_study.preparation import PreparedEnsemble
from mrac_design.ensemble_study.record import EnsembleRecord
from mrac_design.errors import SimulationError
from mrac_design.simulation.ensemble import (
    Ensemble,
    EnsembleResult,
    Workers,
    chunk_metrics,
    group_engine,
    run_ensemble,
)
from mrac_design.simulation.lanes import LANES
from mrac_design.simulation.run import Progress
from mrac_design.simulation.store import EnsembleStore


def run_prepared(
    prepared: PreparedEnsemble,
    *,
    workers: Workers | None = None,
    store: EnsembleStore | None = None,
    progress: Progress | None = None,
) -> EnsembleRecord:
    """Run what is not yet in the store; see `run_ensemble`.

    Raises SimulationError when not one run stayed within the finite numbers.
    """
    computed = 0

    def count(fraction: float) -> None:
        nonlocal computed
        computed += 1
        if progress is not None:
            progress(fraction)

    ensemble = prepared.ensemble
    result = run_ensemble(ensemble, workers=workers, store=store, progress=count)
    if result.diverged == ensemble.runs:
        raise SimulationError(
            f"all {ensemble.runs} runs left the finite numbers: take a smaller --step, or narrower "
            "ranges"
        )
    return EnsembleRecord(
        prepared=prepared,
        result=result,
        computed=computed,
        step_effect=_step_effect(ensemble, result),
    )


def _step_effect(ensemble: Ensemble, result: EnsembleResult) -> float:
    settings = replace(ensemble.settings, step=ensemble.settings.step / 2)
    few = replace(ensemble, settings=settings, runs=min(ensemble.runs, LANES))
    finer = chunk_metrics(few, group_engine(few), 0)
    forces = [i for i, name in enumerate(result.metrics) if "error" in name]
    change = np.abs(finer - result.table[: few.runs])[:, forces]
    return float(np.nanmax(change)) if np.isfinite(change).any() else float("nan")
