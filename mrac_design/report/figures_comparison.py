"""Pictures of a comparison: errors side by side, the front, and the distance to the limit."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mrac_design.comparison.comparison import Comparison
from mrac_design.comparison.contestant import Contestant, Family
from mrac_design.comparison.findings import measured_under, pareto_front, ranking
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    styled,
)
from mrac_design.report.tables_comparison import SHORT

MILLI = 1e3
"""From N to mN."""
FAMILY_COLOURS = {
    Family.FROZEN: COLOURS["frozen"],
    Family.ADAPTIVE: COLOURS["adaptive"],
    Family.RIVAL: SERIES_COLOURS[2],
}
"""Colour of each family."""
DETAIL = 2.0
"""Contestants whose motion error is within this factor of the least are shown enlarged."""
FAMILY_MARKERS = {Family.FROZEN: "s", Family.ADAPTIVE: "o", Family.RIVAL: "^"}
"""Marker of each family."""


@styled()
def error_ranking_figure(comparison: Comparison) -> CaptionedFigure:
    """Rms force error with its interval, on the held-back motion and on stiffer tissue."""
    order = ranking(comparison, comparison.conditions.judged[0].name)[::-1]
    figure = new_figure(
        0.24 * len(order) + 1.3,
        "Rms force error with its 95 % interval over draws of the sensor's noise. Filled: the "
        "held-back motion; open: the same on stiffer tissue. Dashed and dotted: the limits of "
        "linear control of the two.",
    )
    ax = figure.subplots()
    shown = comparison.conditions.judged[:2]
    for condition, filled, style in zip(shown, (True, False), ("--", ":"), strict=True):
        for row, contestant in enumerate(order):
            _draw_error(ax, comparison, contestant, condition.name, row, filled)
        limit = MILLI * comparison.limits[condition.name].error
        ax.axvline(limit, color=COLOURS["limit"], linestyle=style, linewidth=0.9)
    ax.set_yticks(range(len(order)), [contestant.title for contestant in order])
    ax.set(xscale="log", xlabel="rms force error (mN)")
    _plain_ticks(ax)
    legend_above(figure, _family_keys())
    return figure


def _draw_error(
    ax: Axes, comparison: Comparison, contestant: Contestant, name: str, row: int, filled: bool
) -> None:
    measured = measured_under(comparison, contestant.name, name)
    if measured.lost:
        return
    colour = FAMILY_COLOURS[contestant.family]
    ax.errorbar(
        MILLI * measured.mean,
        row,
        xerr=MILLI * measured.half_width,
        marker=FAMILY_MARKERS[contestant.family],
        markersize=5,
        markerfacecolor=colour if filled else "white",
        color=colour,
        linewidth=1.0,
    )


@styled()
def pareto_figure(comparison: Comparison) -> CaptionedFigure:
    """What the motion leaves against what sensor noise causes, with the front of the limit."""
    figure = new_figure(
        4.8,
        "Force error that the motion leaves with a perfect sensor, against the amplification of "
        "sensor noise, on the held-back motion; left all, right the best of them. Nothing linear "
        "and causal lies below the line; the dot on it is the limit for this sensor. Dashed steps "
        "join the contestants that no other beats in both.",
    )
    points = {
        c: (
            comparison.entries[c.name].judgement.amplification,
            MILLI * comparison.entries[c.name].judgement.motion_error,
        )
        for c in comparison.contestants
    }
    drawn = {c: point for c, point in points.items() if np.isfinite(point).all()}
    whole, detail = figure.subplots(1, 2, width_ratios=[1.0, 1.6])
    x, y = np.array(list(drawn.values())).T
    for ax in (whole, detail):
        _draw_front(ax, comparison, drawn)
        ax.set(xlabel="noise amplification", yscale="log")
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter("")
    for contestant, (own_x, own_y) in drawn.items():
        colour, marker = FAMILY_COLOURS[contestant.family], FAMILY_MARKERS[contestant.family]
        whole.plot(own_x, own_y, marker=marker, color=colour, markersize=4, linestyle="none")
    whole.set_ylabel("motion error (mN rms)")
    lowest = MILLI * comparison.limits[comparison.conditions.judged[0].name].motion_error
    whole.set(xlim=(0.0, 1.15 * x.max()), ylim=(0.5 * min(lowest, y.min()), 1.6 * y.max()))
    _draw_detail(detail, drawn)
    keys = [
        Line2D(
            [], [], color=FAMILY_COLOURS[c.family], marker=FAMILY_MARKERS[c.family],
            linestyle="none", label=f"{number} {c.title}",
        )
        for number, c in enumerate(drawn, start=1)
    ]  # fmt: skip
    figure.legend(handles=keys, loc="outside lower left", ncols=3, fontsize=7)
    return figure


def _draw_detail(ax: Axes, drawn: dict[Contestant, tuple[float, float]]) -> None:
    """Numbers instead of markers, around the contestants with the smaller errors."""
    x, y = np.array(list(drawn.values())).T
    near = y <= DETAIL * y.min()
    for number, (contestant, (own_x, own_y)) in enumerate(drawn.items(), start=1):
        if near[number - 1]:
            colour = FAMILY_COLOURS[contestant.family]
            ax.plot(own_x, own_y, ".", color=colour, markersize=4)
            ax.annotate(
                str(number), (own_x, own_y), xytext=(0, 3 if number % 2 else -9), ha="center",
                textcoords="offset points", fontsize=7.5, color=colour,
            )  # fmt: skip
    margin = 0.1 * (np.ptp(x[near]) or x[near].max())
    ax.set(
        xlim=(x[near].min() - margin, x[near].max() + margin),
        ylim=(0.85 * y.min(), 1.15 * y[near].max()),
    )
    ticks = [t for t in (0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if 0.85 * y.min() < t]
    ticks = [t for t in ticks if t < 1.15 * y[near].max()]
    ax.set_yticks(ticks, [f"{t:g}" for t in ticks])
    ax.minorticks_off()


def _draw_front(
    ax: Axes, comparison: Comparison, drawn: dict[Contestant, tuple[float, float]]
) -> None:
    line = np.array(
        [(limit.amplification, MILLI * limit.motion_error) for limit in comparison.front]
    )
    ax.plot(line[:, 0], line[:, 1], color=COLOURS["limit"], linewidth=1.3)
    limit = comparison.limits[comparison.conditions.judged[0].name]
    ax.plot(limit.amplification, MILLI * limit.motion_error, "o", color=COLOURS["limit"], ms=4)
    front = np.array([drawn[contestant] for contestant in pareto_front(comparison)])
    ax.step(
        front[:, 0], front[:, 1], where="post", color=COLOURS["reference"], ls="--", linewidth=1.0
    )


@styled()
def limit_distance_figure(comparison: Comparison) -> CaptionedFigure:
    """Rms force error over the limit of linear control, by contestant and condition."""
    conditions = comparison.conditions.judged
    order = ranking(comparison, conditions[0].name)
    ratios = np.array(
        [
            [
                np.nan
                if measured_under(comparison, contestant.name, c.name).lost
                else measured_under(comparison, contestant.name, c.name).mean
                / comparison.limits[c.name].error
                for c in conditions
            ]
            for contestant in order
        ]
    )
    figure = new_figure(
        0.25 * len(order) + 1.2,
        "Rms force error over the limit of linear control computed from each motion's own "
        "spectrum. Below 1 only what is not linear, or a motion that is not Gaussian, can lie. "
        "A dash: control was lost.",
    )
    ax = figure.subplots()
    ax.imshow(np.log(ratios), cmap="YlOrBr", aspect="auto", vmin=0.0, vmax=np.log(15.0))
    for row, values in enumerate(ratios):
        for column, ratio in enumerate(values):
            dark = np.isfinite(ratio) and ratio > 7.0
            ax.text(
                column, row, f"{ratio:.2f}" if np.isfinite(ratio) else "–",
                ha="center", va="center", fontsize=7, color="white" if dark else "black",
            )  # fmt: skip
    ax.set_xticks(range(len(conditions)), [SHORT.get(c.name, c.name) for c in conditions])
    ax.set_yticks(range(len(order)), [contestant.title for contestant in order])
    ax.grid(visible=False)
    ax.tick_params(length=0)
    return figure


def _family_keys() -> list[Line2D]:
    return [
        Line2D(
            [], [], color=FAMILY_COLOURS[family], marker=FAMILY_MARKERS[family], linestyle="none",
            label=family.value,
        )
        for family in Family
    ]  # fmt: skip


def _plain_ticks(ax: Axes) -> None:
    """Numbers instead of powers of ten, at steps that a log axis of one decade can show."""
    low, high = ax.get_xlim()
    ticks = [t for t in (1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200, 500) if low < t < high]
    ax.set_xticks(ticks, [str(t) for t in ticks])
    ax.minorticks_off()
