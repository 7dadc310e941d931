"""Picture of an ensemble: how the errors are distributed, and how they depend on the tissue."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mrac_design.arrays import FloatArray
from mrac_design.ensemble_study import EnsembleRecord
from mrac_design.publishing import publish_file, staging_folder
from mrac_design.report.style import (
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    styled,
)

MILLI = 1e3
"""From N to mN."""
_BANDS = 24
"""Intervals of stiffness at most."""
_POINTS = 600
"""Points of a line at most."""
_FAR_OFF = 20
"""Worst run over median from which an axis is logarithmic."""
_RUNS_A_BAND = 20
"""Runs an interval should hold, so that its percentiles mean something."""


@styled()
def ensemble_figure(record: EnsembleRecord) -> CaptionedFigure:
    """Share of runs with larger errors (top), and largest error over stiffness (bottom)."""
    values, axes = record.prepared, record.prepared.robot.force_axes
    finite = ~np.isnan(record.result.table).any(axis=1)
    largest = MILLI * record.metric("max_force_error")[finite]
    figure = new_figure(
        5.0,
        f"{finite.sum()} runs of {values.scenario.name} ({record.result.diverged} diverged). Top: "
        "share of the runs whose largest and whose rms force error $y - F_d$ exceed a value. "
        "Bottom: largest error over the true stiffness; within bands of equally many runs: "
        "median, 95 % of the runs, worst run. Dotted: the stiffness of the design.",
    )
    # Six columns can be shared by one, two or three axes.
    grid = figure.add_gridspec(2, 6)
    titles = (("max_force_error", "max $|y - F_d|$ (mN)"), ("rms_force_error", "rms (mN)"))
    drawn: list[Line2D] = []
    for number, (name, label) in enumerate(titles):
        ax = figure.add_subplot(grid[0, 3 * number : 3 * number + 3])
        rows = MILLI * record.metric(name)[finite]
        drawn = [
            _exceedance(ax, rows[:, i], axis, SERIES_COLOURS[i]) for i, axis in enumerate(axes)
        ]
        ax.set(xscale=_scale(rows), yscale="log", xlabel=label)
        if number == 0:
            ax.set_ylabel("share of runs")
    width, first = 6 // len(axes), None
    for i, axis in enumerate(axes):
        ax = figure.add_subplot(grid[1, width * i : width * (i + 1)], sharey=first)
        _bands(ax, record.drawn("stiffness")[finite], largest[:, i], SERIES_COLOURS[i])
        ax.axvline(values.scenario.design.stiffness, color="#5c6672", linestyle=":")
        ax.set(xlabel="$K_s$ (N/m)", title=f"axis {axis}", yscale=_scale(largest))
        first = first or ax
    if first is not None:
        first.set_ylabel("max $|y - F_d|$ (mN)")
        if first.get_yscale() == "linear":
            first.set_ylim(0.0, None)
    keys = [
        Line2D([], [], color="#5c6672", linestyle=":", label="worst"),
        Line2D([], [], color="#5c6672", linestyle="--", label="95 %"),
        Line2D([], [], color="#5c6672", linestyle="-", label="median"),
    ]
    legend_above(figure, [*drawn, *keys])
    return figure


def save_ensemble_figure(record: EnsembleRecord, directory: Path) -> tuple[Path, ...]:
    """Write `ensemble_figure` to `directory` as PNG and SVG, each whole or not at all."""
    figure = ensemble_figure(record)
    names = ("ensemble.png", "ensemble.svg")
    with staging_folder(directory) as staging:
        (staging / "ensemble.svg").write_text(figure.svg(), encoding="utf-8")
        with styled():
            figure.savefig(staging / "ensemble.png")
        for name in names:
            publish_file(staging / name, directory / name)
    return tuple(directory / name for name in names)


def stiffness_bands(stiffness: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean stiffness (bands,) and (median, 95 %, largest) errors (3, bands) of equal shares."""
    order = np.argsort(stiffness, kind="stable")
    count = int(np.clip(stiffness.size // _RUNS_A_BAND, 1, _BANDS))
    parts = np.array_split(order, count)
    centres = np.array([stiffness[part].mean() for part in parts])
    levels = [np.percentile(errors[part], [50, 95, 100]) for part in parts]
    return centres, np.array(levels).T


def _scale(errors: FloatArray) -> str:
    """Logarithmic where a few runs are so far off that the others would be squeezed together."""
    return "log" if errors.max() > _FAR_OFF * np.median(errors) > 0 else "linear"


def _exceedance(ax: Axes, errors: FloatArray, label: str, colour: str) -> Line2D:
    ordered = np.sort(errors)[::-1]
    # Ranks spaced like the axis they stand on: the rare runs are what the picture is for.
    ranks = np.geomspace(1, ordered.size, min(_POINTS, ordered.size)).round().astype(int)
    ranks = np.unique(ranks)
    return ax.plot(ordered[ranks - 1], ranks / ordered.size, color=colour, label=label)[0]


def _bands(ax: Axes, stiffness: FloatArray, errors: FloatArray, colour: str) -> None:
    centres, (median, high, worst) = stiffness_bands(stiffness, errors)
    marker = "." if centres.size == 1 else None
    for level, style in ((median, "-"), (high, "--"), (worst, ":")):
        ax.plot(centres, level, color=colour, linestyle=style, marker=marker)
    ax.fill_between(centres, median, high, color=colour, alpha=0.15, linewidth=0)
