"""Pictures of the gains' drift: how far they stray, what the force then does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrac_design.comparison.drift import DriftBench, DriftRun
from mrac_design.comparison.drift_findings import frozen_growth
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    stacked_axes,
    styled,
)

MILLI = 1e3
"""From N to mN."""
CEILING = 30.0
"""Errors above this (N) are drawn there."""


@styled()
def drift_figure(bench: DriftBench, runs: Sequence[DriftRun]) -> CaptionedFigure:
    """Distance of the gains, the poles they would give, and the force error, minute by minute."""
    figure = new_figure(
        6.4,
        "Heart motion “" + runs[0].case.motion.replace("_", " ") + "”, minute by minute: the "
        "largest distance of a scaled gain from nominal; the largest pole of the loop with the "
        "gains held (from 1 on it is unstable); the rms and the largest force error. Shaded: "
        "minutes of work. A cross marks where the loop left the range of numbers.",
    )
    labels = ("distance of gains", "largest pole", "rms error (mN)", "largest error (mN)")
    axes = stacked_axes(figure, labels, (1.0, 1.0, 1.0, 1.0))
    lines = []
    for run, colour in zip(runs, SERIES_COLOURS, strict=False):
        minutes = np.arange(1, run.rms.size + 1)
        growth = [frozen_growth(bench, row) for row in run.gains]
        errors = [MILLI * np.minimum(values, CEILING) for values in (run.rms, run.largest)]
        shown = [run.strayed, np.array(growth), *errors]
        for ax, values in zip(axes, shown, strict=True):
            (line,) = ax.plot(minutes, values, color=colour, label=run.case.law.title)
            if run.lost is not None and minutes.size:
                ax.plot(minutes[-1], values[-1], "x", color=colour, markersize=7)
        lines.append(line)
    for ax in (axes[0], axes[2], axes[3]):
        ax.set_yscale("log")
    axes[1].axhline(1.0, color=COLOURS["limit"], linestyle="--", linewidth=0.9)
    axes[-1].set_xlabel("time (min)")
    longest = max(run.rms.size for run in runs)
    for minute in filter(runs[0].case.programme.works, range(longest)):
        for ax in axes:
            ax.axvspan(minute + 0.5, minute + 1.5, color="#e3e7eb", linewidth=0)
    legend_above(figure, lines, columns=3)
    return figure


@styled()
def path_figure(bench: DriftBench, runs: Sequence[DriftRun]) -> CaptionedFigure:
    """The five gains of the plain law at rest against time, one column a run."""
    figure = new_figure(
        5.2,
        "Scaled gains of the law without safeguard at rest: on the left "
        + ", then ".join(
            f"{run.case.motion.replace('_', ' ')} at {run.case.programme.rest:g} N" for run in runs
        )
        + ". Below: the largest pole with the gains held.",
    )
    axes: NDArray[np.object_] = figure.subplots(
        2, len(runs), sharex=True, sharey="row", squeeze=False
    )
    names = ("$r_1'$", "$s_0$", "$s_1$", "$t_0$", "$t_1$")
    lines = []
    for column, run in enumerate(runs):
        gains = np.vstack([bench.nominal, run.gains])
        minutes = np.arange(gains.shape[0])
        lines = [
            axes[0, column].plot(minutes, gains[:, i], color=SERIES_COLOURS[i], label=name)[0]
            for i, name in enumerate(names)
        ]
        growth = [frozen_growth(bench, row) for row in gains]
        axes[1, column].plot(minutes, growth, color=COLOURS["adaptive"])
        axes[1, column].axhline(1.0, color=COLOURS["limit"], linestyle="--", linewidth=0.9)
        axes[1, column].set_xlabel("time (min)")
    axes[0, 0].set_ylabel("scaled gain")
    axes[1, 0].set_ylabel("largest pole")
    legend_above(figure, lines)
    return figure
