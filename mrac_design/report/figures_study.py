"""Pictures of a simulated study; a picture that [Z] has too carries its number there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mrac_design.report.paper import (
    PAPER_TORQUE_LIMIT,
    paper_error,
    paper_figure,
    paper_simulation,
)
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    line,
    new_figure,
    stacked_axes,
    styled,
    thinned,
)
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.study import VARIANTS, StudyRecord

MILLI = 1e3
"""From N to mN and from m to mm."""

VARIANT_NAMES = {variant.name: variant.title for variant in VARIANTS}
"""What people read for each variant of the controller."""


@styled()
def heart_motion_figure(study: StudyRecord) -> CaptionedFigure:
    """Displacement of the heart on each axis (mm) over the simulated time."""
    time = next(iter(study.trajectories.values())).time
    displacement = MILLI * study.motion.displacement(time)[list(study.robot.task.position)]
    names = study.robot.force_axes
    figure = new_figure(
        3.6,
        "Motion of the heart's surface about its mean position"
        f"{paper_figure(study, 'heart motion')}. Origin: {study.motion.origin.value}.",
    )
    axes = stacked_axes(figure, [f"{name} (mm)" for name in names], [1] * len(names))
    for ax, values in zip(axes, displacement, strict=True):
        line(ax, time, values, "heart", "heart")
    return figure


@styled()
def force_figure(study: StudyRecord, axis: int) -> CaptionedFigure:
    """Force and force reference on one axis, and the force's error for every variant.

    `axis` counts the force axes from 0 (X, Y, Z). Below the force (N) stand its error to the
    desired force and to the reference model's output (both mN).
    """
    name = study.robot.force_axes[axis]
    lost = [
        occurrence.time
        for occurrence in study.trajectories["adaptive"].events
        if occurrence.event.name == f"contact {name}" and not occurrence.rises
    ]
    marked = "Dotted, upright: the adaptive controller loses contact. " if lost else ""
    figure = new_figure(
        4.0,
        f"Force and force reference on the {name} axis{paper_figure(study, f'force {name}')}. Top: "
        "force, reference and desired force $F_d$. Middle: error to the desired force. Bottom: "
        "error to the output $y_m$ of the reference model, which is what adaptation works on. "
        f"Grey: the start, not judged. {marked}{_largest_errors(study, name)}",
    )
    labels = [f"force {name} (N)", "$y - F_d$ (mN)", "$y - y_m$ (mN)"]
    force, error, model_error = stacked_axes(figure, labels, [1.3, 1, 1])
    for ax in (force, error, model_error):
        ax.axvspan(0, study.scenario.simulation.settling, color="#eef0f2", linewidth=0)
    drawn = []
    for variant, trajectory in study.trajectories.items():
        time, measured = trajectory.time, trajectory["force"][:, axis]
        label = VARIANT_NAMES[variant]
        drawn.append(line(force, time, measured, variant, label))
        for ax, target in ((error, "desired_force"), (model_error, "model_force")):
            difference = MILLI * (measured - trajectory[target][:, axis])
            line(ax, time, difference, variant, label, linewidth=0.9)
    for instant in lost:
        force.axvline(instant, color=COLOURS["limit"], linewidth=0.7, linestyle=":", zorder=0.5)
    desired = trajectory["desired_force"][:, axis]
    reference = trajectory["force_reference"][:, axis]
    lines = [
        line(force, time, reference, "reference", "reference", linewidth=0.8, zorder=1),
        line(force, time, desired, "desired", "desired $F_d$", linestyle=(0, (4, 2))),
    ]
    legend_above(figure, [*lines, *drawn])
    return figure


@styled()
def compensation_figure(study: StudyRecord, variant: str = "adaptive") -> CaptionedFigure:
    """The robot's tip following the heart on each axis (mm)."""
    trajectory, names = study.trajectories[variant], study.robot.force_axes
    figure = new_figure(
        4.2,
        "Tip of the robot and surface of the heart"
        f"{paper_figure(study, 'positions')}, counted from the heart's mean position; the "
        f"distance between the lines is the tissue's compression. Controller: "
        f"{VARIANT_NAMES[variant]}.",
    )
    axes = stacked_axes(figure, [f"{name} (mm)" for name in names], [1] * len(names))
    for i, ax in enumerate(axes):
        lines = draw_compensation(ax, trajectory, i)
    legend_above(figure, lines)
    return figure


@styled()
def torque_figure(study: StudyRecord, variant: str = "adaptive") -> CaptionedFigure:
    """Torque of each motor (N·m), with its limit and the largest torques of every variant."""
    trajectory, limits = study.trajectories[variant], study.robot.motor_torque_limits
    joints = study.robot.joints
    simulation = paper_simulation(study.scenario)
    known = simulation is not None and "torques" in simulation.figures
    said = f" [Z] limits every actuator to {PAPER_TORQUE_LIMIT:g} N·m." if known else ""
    figure = new_figure(
        5.2,
        f"Torque of each motor{paper_figure(study, 'torques')}. Drawn: {VARIANT_NAMES[variant]}; "
        f"above each panel the largest torque of every controller, its start included.{said}",
    )
    labels = [f"{i + 1} (N·m)" for i in range(len(joints))]
    for i, ax in enumerate(stacked_axes(figure, labels, [1] * len(joints))):
        name = joints[i].name
        line(ax, trajectory.time, trajectory["torque"][:, i], variant, name, linewidth=0.9)
        peaks = [f"{VARIANT_NAMES[key]} {own[name]:.3g}" for key, own in study.max_torque.items()]
        ax.set_title(f"{name}, limit ±{limits[i]:g}: at most {', '.join(peaks)}", fontsize=8)
        _mark_limit(ax, float(limits[i]))
    return figure


@styled()
def gains_figure(study: StudyRecord, variant: str = "adaptive") -> CaptionedFigure:
    """Change of the scaled gains from their start over time (–), one panel per force axis."""
    trajectory, names = study.trajectories[variant], study.robot.force_axes
    labels = trajectory.signals["adapted_gains"].labels
    values = trajectory["adapted_gains"]
    figure = new_figure(
        4.2,
        r"Adapted gains: change of $\hat\theta = D^{-1}\theta$ from its start. Controller: "
        f"{VARIANT_NAMES[variant]}.",
    )
    axes = stacked_axes(
        figure, [rf"{name}  $\Delta\hat\theta$ (–)" for name in names], [1] * len(names)
    )
    lines = []
    for ax, name in zip(axes, names, strict=True):
        own = [i for i, label in enumerate(labels) if label.startswith(f"{name} ")]
        for i, colour in zip(own, SERIES_COLOURS, strict=False):
            change = values[:, i] - values[0, i]
            if np.any(change):
                label = labels[i].removeprefix(f"{name} ")
                lines += ax.plot(*thinned(trajectory.time, change), color=colour, label=label)
    legend_above(figure, lines)
    return figure


@styled()
def error_figure(study: StudyRecord) -> CaptionedFigure:
    """Largest force error (% of the largest desired force) and rms error to the model (mN)."""
    simulation = paper_simulation(study.scenario)
    known = simulation is not None and simulation.max_force_error_percent
    said = "; a dash is the figure stated in [Z]" if known else ""
    figure = new_figure(
        2.5,
        "Errors of the three controllers, logarithmic. Left: largest error to the desired force, "
        f"in per cent of the axis's largest desired force{said}. Right: rms error to the output "
        "of the reference model.",
    )
    largest, model = figure.subplots(1, 2)
    names = study.robot.force_axes
    lines = []
    for variant, tracking in study.tracking.items():
        percent = [tracking[name].max_force_error_percent for name in names]
        rms = [MILLI * tracking[name].rms_model_error_N for name in names]
        lines.append(_dots(largest, names, percent, variant))
        _dots(model, names, rms, variant)
    lines += _stated(largest, study)
    largest.set_ylabel("max $|y - F_d|$ (%)")
    model.set_ylabel("rms $(y - y_m)$ (mN)")
    legend_above(figure, lines)
    return figure


@styled()
def overview_figure(study: StudyRecord) -> CaptionedFigure:
    """Force tracking and heart compensation of the last force axis in one picture."""
    axis = len(study.robot.force_axes) - 1
    name = study.robot.force_axes[axis]
    best = study.trajectories["adaptive_inverse"]
    figure = new_figure(
        5.0, f"Force tracking and compensation of the heart's motion, {name} axis.", width=8
    )
    labels = ["position (mm)", "force (N)", "force error (mN)"]
    position, force, error = stacked_axes(figure, labels, [1, 1, 0.9])
    lines = draw_compensation(position, best, axis)
    time, desired = best.time, best["desired_force"][:, axis]
    measured = best["force"][:, axis]
    lines.append(line(force, time, measured, "adaptive_inverse", "force"))
    lines.append(line(force, time, desired, "desired", "desired force", linestyle=(0, (4, 2))))
    for variant, trajectory in study.trajectories.items():
        difference = trajectory["force"][:, axis] - trajectory["desired_force"][:, axis]
        label = f"error, {VARIANT_NAMES[variant]}"
        lines.append(line(error, time, MILLI * difference, variant, label))
    for ax, part in ((position, lines[:2]), (force, lines[2:4]), (error, lines[4:])):
        ax.legend(
            handles=part, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=3, borderaxespad=0.1
        )
    return figure


def _largest_errors(study: StudyRecord, axis: str) -> str:
    """A caption's sentence: largest error on one axis for every variant, beside that of [Z]."""
    ours = [
        f"{VARIANT_NAMES[variant]} {tracking[axis].max_force_error_percent:.3g} %"
        for variant, tracking in study.tracking.items()
    ]
    simulation = paper_simulation(study.scenario)
    stated = paper_error(simulation, axis)
    theirs = [] if simulation is None else [f"[Z] {stated if stated != '–' else 'gives none'}"]
    return f"Largest $|y - F_d|$: {', '.join([*theirs, *ours])}."


def _stated(ax: Axes, study: StudyRecord) -> list[Line2D]:
    """Dashes at the largest errors stated in [Z]; the first of them stands for all in a legend."""
    simulation = paper_simulation(study.scenario)
    stated = {} if simulation is None else simulation.max_force_error_percent
    return [
        ax.plot([i - 0.3, i + 0.3], [stated[name]] * 2, color=COLOURS["limit"], label="[Z]")[0]
        for i, name in enumerate(study.robot.force_axes)
        if name in stated
    ]


def draw_compensation(ax: Axes, trajectory: Trajectory, axis: int) -> list[Line2D]:
    """Heart and tip on one axis (mm), counted from the heart's mean position."""
    heart, tip = trajectory["heart"][:, axis], trajectory["tip"][:, axis]
    centre = heart.mean()
    return [
        line(ax, trajectory.time, MILLI * (heart - centre), "heart", "heart"),
        line(ax, trajectory.time, MILLI * (tip - centre), "tip", "tip of the robot"),
    ]


def _mark_limit(ax: Axes, limit: float) -> None:
    """Draw a limit only where it lies within the data's range; else the data would be flat."""
    low, high = ax.get_ylim()
    for level in (-limit, limit):
        if low <= level <= high:
            ax.axhline(level, color=COLOURS["limit"], linestyle="--", linewidth=0.9)


def _dots(ax: Axes, names: Sequence[str], values: Sequence[float], variant: str) -> Line2D:
    """Values over the axes' names on a logarithmic scale, the variants side by side."""
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=20))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.margins(x=0.2, y=0.15)
    ax.set_xticks(np.arange(len(names)), names)
    positions = np.arange(len(names)) + 0.14 * (list(VARIANT_NAMES).index(variant) - 1)
    name, colour = VARIANT_NAMES[variant], COLOURS[variant]
    return ax.plot(positions, values, "o", color=colour, label=name, markersize=6)[0]
