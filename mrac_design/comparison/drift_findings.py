"""What half an hour of drift left behind: poles of the gains held, summaries, plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.comparison.drift import DriftBench, DriftRun
from mrac_design.controller.axis_loop import axis_loop
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.simulation.safeguards import safeguard_entries
from mrac_design.stability.adaptive_loop import exact
from mrac_design.stability.parameter_box import ParameterBox
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.sampled_loop import sampled_vertices, sampling

MOST_DELAY = 4
"""Samples of dead time, all told, up to which a loop is asked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftSummary:
    """One run in a few numbers."""

    strayed: float
    """Largest |scaled gain − nominal| before the loop was lost."""
    settled: float
    """Largest change of a gain over the last sixth of the finished minutes."""
    growth: float
    """Largest |pole| over the ends of all minutes, the gains held there."""
    bears: int
    """Further samples of dead time the loop bears with the last gains held; −1: it is unstable."""
    rest_rms: float
    """Rms force error at rest (N); nan without."""
    work_rms: float
    """Rms force error at work (N); nan without."""
    largest: float
    """Largest |force error| of all minutes but the first (N), inf when the loop was lost."""
    lost: int | None
    """Minute 0, 1, … in which the loop left the range of numbers; None if it did not."""


def summary(bench: DriftBench, run: DriftRun) -> DriftSummary:
    """The run in a few numbers; the first minute counts for the gains only."""
    gains = np.vstack([bench.nominal, run.gains])
    last = gains[-max(2, gains.shape[0] // 6) :]
    later = run.largest[1:]
    return DriftSummary(
        strayed=float(run.strayed.max(initial=0.0)),
        settled=float(np.abs(last[-1] - last[0]).max()),
        growth=max(frozen_growth(bench, row) for row in gains[1:]) if len(gains) > 1 else np.nan,
        bears=borne_delay(bench, gains[-1]),
        rest_rms=_rms(run, work=False),
        work_rms=_rms(run, work=True),
        largest=np.inf if run.lost is not None else float(later.max(initial=0.0)),
        lost=run.lost,
    )


def frozen_growth(
    bench: DriftBench, gains: Sequence[float] | FloatArray, *, extra_delay: int = 0
) -> float:
    """Largest |pole| of the loop with its gains held there: 1 and above is unstable.

    `extra_delay` samples come on top of the scenario's; together at most `MOST_DELAY`.
    """
    design, choice = bench.design, bench.scenario.design
    timing = bench.measurement
    sampled = sampling(decimal_rational(timing.domain.period), timing.delay + extra_delay)
    loop = axis_loop(design, [sampled.period])
    feedback = tuple(exact(float(gain), "gain") for gain in gains[: len(loop.gains)])
    ratio = exact(bench.scenario.stiffness / choice.stiffness, "stiffness ratio")
    point = ParameterBox(lower=feedback, upper=feedback, stiffness_ratio=(ratio, ratio))
    vertices = sampled_vertices(loop, point, sampled)
    matrix = np.array([[to_float(entry) for entry in row] for row in vertices[0].A])
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def borne_delay(bench: DriftBench, gains: Sequence[float] | FloatArray) -> int:
    """Further samples of dead time the loop bears with its gains held; −1 if it is unstable."""
    for extra in range(MOST_DELAY - bench.measurement.delay + 1):
        if frozen_growth(bench, gains, extra_delay=extra) >= 1.0:
            return extra - 1
    return MOST_DELAY - bench.measurement.delay


def drift_values(bench: DriftBench, runs: Sequence[DriftRun]) -> dict[str, Any]:
    """Everything measured as plain data, forces in N; what was lost is null."""
    return {
        "scenario": bench.scenario.name,
        "axis": bench.axis,
        "nominal_gains": bench.nominal.tolist(),
        "runs": [_run_values(bench, run) for run in runs],
    }


def _run_values(bench: DriftBench, run: DriftRun) -> dict[str, Any]:
    numbers = summary(bench, run)
    programme = run.case.programme
    return {
        "law": run.case.law.name,
        "safeguards": safeguard_entries(run.case.law.safeguards),
        "motion": run.case.motion,
        "programme": {name: getattr(programme, name) for name in programme.__slots__},
        **{
            name: value if value is None or np.isfinite(value) else None
            for name in numbers.__slots__
            for value in [getattr(numbers, name)]
        },
        "minutes": {
            "gains": run.gains.tolist(),
            "strayed": run.strayed.tolist(),
            "rms": run.rms.tolist(),
            "largest": run.largest.tolist(),
        },
    }


def _rms(run: DriftRun, *, work: bool) -> float:
    chosen = run.rms[run.minutes(work=work)]
    return float(np.sqrt(np.mean(chosen**2))) if chosen.size else float("nan")
