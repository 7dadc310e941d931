"""Pictures of a simulated study; numbers 5 to 10 are the figures of [Z] drawn anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

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
    """Figure 5 of [Z]: displacement of the heart on each axis (mm) over the simulated time."""
    time = next(iter(study.trajectories.values())).time
    displacement = MILLI * study.motion.displacement(time)[list(study.robot.task.position)]
    names = study.robot.force_axes
    figure = new_figure(
        3.6,
        "Motion of the heart's surface about its mean position ([Z] figure 5). Origin: "
        f"{study.motion.origin.value}.",
    )
    axes = stacked_axes(figure, [f"{name} (mm)" for name in names], [1] * len(names))
    for ax, values in zip(axes, displacement, strict=True):
        line(ax, time, values, "heart", "heart")
    return figure


@styled()
def force_figure(study: StudyRecord, axis: int) -> CaptionedFigure:
    """Figures 6, 7, 8 of [Z]: force on one axis, and its error for every variant.

    `axis` counts the force axes from 0 (X, Y, Z). Below the force (N) stand its error to the
    desired force and to the reference model's output (both mN).
    """
    name = study.robot.force_axes[axis]
    figure = new_figure(
        4.25,
        f"Force on the {name} axis ([Z] figure {6 + axis}). Top: force and desired force $F_d$. "
        "Middle: error to the desired force. Bottom: error to the output $y_m$ of the reference "
        "model, which is what adaptation works on. Grey: the start, not judged.",
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
    """Figure 9 of [Z]: the robot's tip following the heart on each axis (mm)."""
    trajectory, names = study.trajectories[variant], study.robot.force_axes
    figure = new_figure(
        4.2,
        "Tip of the robot and surface of the heart ([Z] figure 9), counted from the heart's "
        "mean position; the distance between the lines is the contact spring's compression "
        f"$F/K_s$. Controller: {VARIANT_NAMES[variant]}.",
    )
    axes = stacked_axes(figure, [f"{name} (mm)" for name in names], [1] * len(names))
    for i, ax in enumerate(axes):
        lines = _draw_compensation(ax, trajectory, i)
    legend_above(figure, lines)
    return figure


@styled()
def torque_figure(study: StudyRecord, variant: str = "adaptive") -> CaptionedFigure:
    """Figure 10 of [Z]: torque of each motor (N·m) with its limit noted."""
    trajectory, limits = study.trajectories[variant], study.robot.motor_torque_limits
    joints = study.robot.joints
    figure = new_figure(
        5.6,
        f"Torque of each motor ([Z] figure 10), with its limit. Controller: "
        f"{VARIANT_NAMES[variant]}.",
    )
    labels = [f"{i + 1} (N·m)" for i in range(len(joints))]
    for i, ax in enumerate(stacked_axes(figure, labels, [1] * len(joints))):
        torque = trajectory["torque"][:, i]
        line(ax, trajectory.time, torque, "adaptive", joints[i].name, linewidth=0.9)
        largest = float(np.max(np.abs(torque)))
        ax.set_title(
            f"motor {i + 1}, {joints[i].name}: at most {largest:.3g} N·m, "
            f"{largest / limits[i]:.1%} of the limit ±{limits[i]:g} N·m",
            fontsize=8,
        )
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
    figure = new_figure(
        2.5,
        "Errors of the three controllers, logarithmic. Left: largest error to the desired force, "
        "in per cent of the axis's largest desired force, beside the figure reported by [Z]. "
        "Right: rms error to the output of the reference model.",
    )
    largest, model = figure.subplots(1, 2)
    names = study.robot.force_axes
    lines = []
    for variant, tracking in study.tracking.items():
        percent = [tracking[name].max_force_error_percent for name in names]
        rms = [MILLI * tracking[name].rms_model_error_N for name in names]
        lines.append(_dots(largest, names, percent, variant))
        _dots(model, names, rms, variant)
    reported = largest.axhline(3, color=COLOURS["limit"], linestyle=(0, (4, 2)), linewidth=0.9)
    reported.set_label("[Z], about 3 %")
    largest.set_ylabel("max $|y - F_d|$ (%)")
    model.set_ylabel("rms $(y - y_m)$ (mN)")
    legend_above(figure, [*lines, reported])
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
    lines = _draw_compensation(position, best, axis)
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


def _draw_compensation(ax: Axes, trajectory: Trajectory, axis: int) -> list[Line2D]:
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
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.margins(x=0.2, y=0.15)
    ax.set_xticks(np.arange(len(names)), names)
    positions = np.arange(len(names)) + 0.14 * (list(VARIANT_NAMES).index(variant) - 1)
    name, colour = VARIANT_NAMES[variant], COLOURS[variant]
    return ax.plot(positions, values, "o", color=colour, label=name, markersize=6)[0]
