"""Pictures of a real-time run: how late the program woke up, and how long its steps took."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mrac_design.arrays import FloatArray
from mrac_design.publishing import publish_file, staging_folder
from mrac_design.realtime import RealtimeRecord, RealtimeReport, RealtimeRun
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    styled,
)

MICRO = 1e6
"""From s to µs."""
_BINS_A_DECADE = 20

_PARTS: tuple[tuple[str, Callable[[RealtimeRecord], FloatArray]], ...] = (
    ("wake-up latency (µs)", lambda record: record.wake),
    ("step time (µs)", lambda record: record.step),
)


@styled()
def latency_figure(report: RealtimeReport) -> CaptionedFigure:
    """Histograms of wake-up latency and step time (µs), one line a rate, both axes logarithmic.

    A dashed line marks the period of each rate: what lies beyond it came too late.
    """
    caption = (
        f"Wake-up latency and duration of the exported controller's step, {report.duration:g} s a "
        f"rate, against the simulated robot. Dashed: the period. Measured on {report.machine}."
    )
    figure = new_figure(4.4, caption)
    axes = figure.subplots(len(_PARTS), 1, sharex=True)
    edges = _edges([times(run.record) for run in report.runs for _, times in _PARTS])
    for ax, (label, times) in zip(axes, _PARTS, strict=True):
        drawn = [
            _histogram(ax, times(run.record), edges, f"{run.rate:g} Hz", colour)
            for run, colour in _coloured(report)
        ]
        ax.set(xscale="log", yscale="log", xlabel=label, ylabel="periods", ylim=(0.6, None))
        ax.tick_params(labelbottom=True)
    for run, colour in _coloured(report):
        axes[0].axvline(MICRO * run.record.period, color=colour, linestyle="--", linewidth=0.9)
    period = Line2D([], [], color=COLOURS["limit"], linestyle="--", label="period")
    legend_above(figure, [*drawn, period])
    return figure


def save_latency_figure(report: RealtimeReport, directory: Path) -> tuple[Path, ...]:
    """Write `latency_figure` to `directory` as PNG and SVG, each whole or not at all."""
    figure = latency_figure(report)
    with staging_folder(directory) as staging:
        (staging / "latency.svg").write_text(figure.svg(), encoding="utf-8")
        with styled():
            figure.savefig(staging / "latency.png")
        names = ("latency.png", "latency.svg")
        for name in names:
            publish_file(staging / name, directory / name)
    return tuple(directory / name for name in names)


def _coloured(report: RealtimeReport) -> list[tuple[RealtimeRun, str]]:
    return [(run, SERIES_COLOURS[i % len(SERIES_COLOURS)]) for i, run in enumerate(report.runs)]


def _edges(samples: Sequence[FloatArray]) -> FloatArray:
    """Edges of bins (µs) that hold every sample, evenly spaced on a logarithmic axis."""
    low = MICRO * min(_positive(values).min() for values in samples)
    high = MICRO * max(_positive(values).max() for values in samples)
    first, last = np.floor(10 * np.log10(low)) / 10, np.ceil(10 * np.log10(high)) / 10 + 0.1
    return np.logspace(first, last, int(np.ceil((last - first) * _BINS_A_DECADE)) + 1)


def _positive(values: FloatArray) -> FloatArray:
    # A clock of coarse grain reads 0: less than a nanosecond has no place on the axis.
    return np.maximum(values, 1e-9)


def _histogram(ax: Axes, values: FloatArray, edges: FloatArray, label: str, colour: str) -> Line2D:
    counts, _ = np.histogram(MICRO * _positive(values), edges)
    # Empty bins leave gaps instead of lines down to nothing.
    shown = np.where(counts > 0, counts, np.nan)
    return ax.plot(
        np.sqrt(edges[:-1] * edges[1:]), shown, drawstyle="steps-mid", color=colour, label=label,
        marker=".", markersize=3,
    )[0]  # fmt: skip
