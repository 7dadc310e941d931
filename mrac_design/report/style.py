"""The look shared by all figures: one colour per signal, units on axes, legends outside."""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mrac_design.arrays import FloatArray

# Okabe & Ito's palette (2008): told apart with any common colour vision deficiency.
COLOURS = {
    "reference": "#9aa1a9",
    "desired": "#1d232b",
    "frozen": "#d55e00",
    "adaptive": "#0072b2",
    "adaptive_inverse": "#009e73",
    "heart": "#cc79a7",
    "tip": "#0072b2",
    "limit": "#5c6672",
}
"""Colour of each kind of line, the same in every figure."""

SERIES_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#1d232b")
"""Colours for series that are none of those kinds."""

WIDTH = 6.5
"""Width of a figure in inches: the text width of an A4 page."""

STYLE: dict[Any, Any] = {
    "axes.edgecolor": "#5c6672",
    "axes.grid": True,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.prop_cycle": f"cycler('color', {list(SERIES_COLOURS)})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "figure.dpi": 100,
    "font.size": 8.5,
    "grid.color": "#e3e7eb",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.columnspacing": 1.2,
    "legend.frameon": False,
    "legend.handlelength": 1.5,
    "lines.linewidth": 1.1,
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    "svg.hashsalt": "mrac_design",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.color": "#3c444d",
    "ytick.color": "#3c444d",
}
"""Matplotlib settings of every figure."""


class CaptionedFigure(Figure):
    """A Matplotlib figure with a caption that notebooks and the report show with it."""

    caption: str = ""
    """Markdown with $…$ mathematics; empty for none."""

    def svg(self) -> str:
        """The figure as SVG text, text as outlines so that it looks alike everywhere."""
        buffer = io.StringIO()
        with rc_context(STYLE):
            self.savefig(buffer, format="svg", metadata={"Date": None})
        return buffer.getvalue()

    def _repr_mimebundle_(
        self, include: object = None, exclude: object = None
    ) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
        return {"image/svg+xml": self.svg()}, {"image/svg+xml": {"caption": self.caption}}


def styled() -> Any:
    """Decorator (or context) under which axes are made with this module's settings."""
    return rc_context(STYLE)


def new_figure(height: float, caption: str, width: float = WIDTH) -> CaptionedFigure:
    """An empty figure of `width` × `height` inches, drawn without any window system."""
    figure = CaptionedFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.caption = caption
    return figure


def stacked_axes(figure: Figure, labels: Sequence[str], ratios: Sequence[float]) -> list[Axes]:
    """Axes one above the other over a common time axis in s; `labels` name the ordinates."""
    axes = figure.subplots(len(labels), 1, sharex=True, squeeze=False, height_ratios=list(ratios))
    column = list(axes[:, 0])
    for ax, label in zip(column, labels, strict=True):
        ax.set_ylabel(label)
    column[-1].set_xlabel("time (s)")
    figure.align_ylabels(column)
    return column


def legend_above(figure: Figure, lines: Sequence[Artist], columns: int = 6) -> None:
    """One legend above all axes, at most `columns` entries in a row, where it covers no data."""
    entries = {str(line.get_label()): line for line in lines}
    figure.legend(list(entries.values()), list(entries), loc="outside upper left", ncols=columns)


def thinned(
    time: FloatArray, values: FloatArray, points: int = 1600
) -> tuple[FloatArray, FloatArray]:
    """At most `points` samples of a line, keeping the extremes of every stretch left out.

    `time` and `values` have shape (N,). The line looks the same at the width of a page, and no
    peak is lost; a vector picture of 10 s at 4 kHz would otherwise take megabytes.
    """
    if time.size <= points:
        return time, values
    edges = np.linspace(0, time.size, points // 2 + 1).astype(int)
    chosen: set[int] = set()
    for start, end in pairwise(edges):
        stretch = values[start:end]
        chosen.update((start + int(np.argmin(stretch)), start + int(np.argmax(stretch))))
    # The ends stay, so that the line spans the whole time.
    index = np.array(sorted(chosen | {0, time.size - 1}))
    return time[index], values[index]


def line(
    ax: Axes, time: FloatArray, values: FloatArray, kind: str, label: str, **style: Any
) -> Line2D:
    """Draw a thinned line in the colour of its `kind` (a key of COLOURS)."""
    return ax.plot(*thinned(time, values), color=COLOURS[kind], label=label, **style)[0]
