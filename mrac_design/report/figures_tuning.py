"""Picture of a tuning: what the adaptation gain buys, and what it costs in delay margin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    styled,
)
from mrac_design.tuning.judging import Curve, variable_text
from mrac_design.tuning.tuner import Point, TuningRecord

MILLI = 1e3
"""From s to ms."""
_ERROR = "worst max $|y - F_d|$ (%)"
_MARGIN = "delay margin (ms)"


@styled()
def trade_off_figure(record: TuningRecord, curves: Sequence[Curve]) -> CaptionedFigure:
    """Error and delay margin over γ̂ (left), and one over the other (right), for some K2."""
    choice = record.choice
    others = any(not curve.tuned for curve in curves)
    figure = new_figure(
        4.6,
        "Largest force error over scenarios ("
        + ", ".join(scenario.name for scenario in choice.scenarios)
        + ") and axes, and least delay margin of the adaptive loop on each scenario's tissue. "
        + f"Tuned: {variable_text(choice.variables, record.tuned.values)}. "
        + ("Dashed: all but K2 and γ̂ as at the start. " if others else "")
        + f"Grey: less than the {MILLI * choice.delay_margin:g} ms asked for. Dots: tried.",
    )
    grid = figure.add_gridspec(2, 2)
    error = figure.add_subplot(grid[0, 0])
    margin = figure.add_subplot(grid[1, 0], sharex=error)
    plane = figure.add_subplot(grid[:, 1])
    colours = dict(zip(sorted({c.k2 for c in curves}), SERIES_COLOURS, strict=False))
    drawn: dict[str, Line2D] = {}
    for curve in curves:
        style: dict[str, Any] = {
            "color": colours[curve.k2],
            "linestyle": "-" if curve.tuned else "--",
        }
        kept = np.isfinite(curve.errors)
        errors, margins = curve.errors[kept], MILLI * curve.margins[kept]
        line = error.plot(curve.gains[kept], errors, **style, label=f"$K_2$ = {curve.k2:g} 1/s")[0]
        margin.plot(curve.gains[kept], margins, **style)
        plane.plot(margins, errors, **style)
        if curve.tuned:
            drawn[f"{curve.k2}"] = line
    _tried(plane, record)
    _forbidden(margin, plane, MILLI * choice.delay_margin)
    marks = [
        _mark(plane, record.start, "^", "start"),
        _mark(plane, record.tuned, "*", "tuned"),
    ]
    error.set(xscale="log", yscale="log", ylabel=_ERROR)
    margin.set(xlabel=r"$\hat\gamma$", ylabel=_MARGIN)
    plane.set(xlabel=_MARGIN, yscale="log", ylabel=_ERROR)
    for ax in (error, plane):
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
    if others:
        grey = COLOURS["limit"]
        marks.append(Line2D([], [], color=grey, linestyle="--", label="else as at the start"))
    legend_above(figure, [*drawn.values(), *marks])
    return figure


def _tried(ax: Axes, record: TuningRecord) -> None:
    """What the search tried, as far as it is near enough to matter."""
    limit = 2 * max(record.start.worst, record.tuned.worst)
    near = [point for point in record.tried if point.worst <= limit]
    ax.plot(
        [MILLI * point.delay_margin for point in near],
        [point.worst for point in near],
        ".",
        color=COLOURS["limit"],
        markersize=3,
        zorder=1,
    )


def _forbidden(margin: Axes, plane: Axes, asked: float) -> None:
    """Shade what leaves less delay margin than asked for (ms)."""
    seen = plane.get_xlim()[0]
    margin.axhspan(0, asked, color=COLOURS["reference"], alpha=0.25, linewidth=0)
    plane.axvspan(0, asked, color=COLOURS["reference"], alpha=0.25, linewidth=0)
    margin.set_ylim(0.0, None)
    plane.set_xlim(max(0.0, seen), None)


def _mark(ax: Axes, point: Point, marker: str, label: str) -> Line2D:
    return ax.plot(
        MILLI * point.delay_margin,
        point.worst,
        marker,
        color=COLOURS["desired"],
        markersize=9,
        label=label,
        zorder=3,
    )[0]
