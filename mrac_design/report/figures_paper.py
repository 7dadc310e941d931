"""Figures 9, 11 and 12 of [Z]: positions of robot and heart, with the error that they hide."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from mrac_design.arrays import FloatArray
from mrac_design.report.figures_study import VARIANT_NAMES, draw_compensation
from mrac_design.report.paper import PAPER_POSITION_ERROR, paper_figure, paper_simulation
from mrac_design.report.style import CaptionedFigure, legend_above, line, new_figure, styled
from mrac_design.study import StudyRecord

_MICRO = 1e6


@styled()
def positions_figure(study: StudyRecord) -> CaptionedFigure:
    """Robot and heart on each axis (mm), and how far the tip is from where it should be (µm).

    The tip should press the tissue by F_d/Ks; every variant's error is drawn. For tissue that is
    a spring.
    """
    names = study.robot.force_axes
    figure = new_figure(
        1.05 * len(names) + 0.5,
        f"Position of robot and heart{paper_figure(study, 'positions')}. Left: adaptive "
        "controller, counted from the heart's mean position. Right, for every controller: distance "
        "of the tip from where it presses with the desired force, $x - x_h - F_d/K_s$. Grey: the "
        f"start, not judged. {_largest_distances(study)}",
    )
    grid = figure.subplots(len(names), 2, sharex=True, squeeze=False)
    for i, name in enumerate(names):
        place, error = grid[i]
        place.set_ylabel(f"{name} (mm)")
        error.set_ylabel(f"error {name} (µm)")
        positions = draw_compensation(place, study.trajectories["adaptive"], i)
        error.axvspan(0, study.scenario.simulation.settling, color="#eef0f2", linewidth=0)
        errors = [_draw_error(error, study, variant, i) for variant in study.trajectories]
    for ax in grid[-1]:
        ax.set_xlabel("time (s)")
        ax.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]))
    for column in grid.T:
        figure.align_ylabels(list(column))
    legend_above(figure, [*positions, *errors])
    return figure


def position_errors(study: StudyRecord, variant: str) -> FloatArray:
    """Distance of the tip from where it presses with the desired force (m), shape (N, k)."""
    run_ = study.trajectories[variant]
    wanted = run_["heart"] + run_["desired_force"] / study.scenario.stiffness
    return np.asarray(run_["tip"] - wanted)


def _draw_error(ax: Axes, study: StudyRecord, variant: str, axis: int) -> Line2D:
    time, error = study.trajectories[variant].time, position_errors(study, variant)[:, axis]
    return line(ax, time, _MICRO * error, variant, VARIANT_NAMES[variant], linewidth=0.9)


def _largest_distances(study: StudyRecord) -> str:
    """A caption's sentence: largest distance of every variant by axis, beside that of [Z]."""
    simulation = paper_simulation(study.scenario)
    stated = simulation is not None and simulation.number == 1
    theirs = f"{_MICRO * PAPER_POSITION_ERROR:g} µm" if stated else "gives none"
    parts = [f"[Z] {theirs}"]
    for variant, run_ in study.trajectories.items():
        kept = run_.time >= study.scenario.simulation.settling
        largest = _MICRO * np.abs(position_errors(study, variant)[kept]).max(axis=0)
        numbers = " / ".join(f"{value:.3g}" for value in largest)
        parts.append(f"{VARIANT_NAMES[variant]} {numbers} µm")
    return f"Largest, {' / '.join(study.robot.force_axes)}: {', '.join(parts)}."
