"""Picture of a robot's posture: the chain of its link frames seen from the side and from above."""

from __future__ import annotations

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.report.style import COLOURS, CaptionedFigure, legend_above, new_figure, styled
from mrac_design.robot import AXIS_NAMES, JointType, RobotDescription

_VIEWS = ((0, 2), (0, 1))
"""Base-frame components drawn against each other: from the side, from above."""


@styled()
def posture_figure(robot: RobotDescription) -> CaptionedFigure:
    """The robot at its home posture (m): joints, links, tool and tip."""
    figure = new_figure(
        2.8, f"{robot.name} at its home posture, from the side (left) and from above (right)."
    )
    points = home_points(robot)
    chain, frames, tool = points[:-1], points[1:-1], points[-2:]
    sliding = np.array([joint.type is JointType.PRISMATIC for joint in robot.joints])
    for ax, (i, j) in zip(figure.subplots(1, 2), _VIEWS, strict=True):
        arm = {"color": "#9fb6c6", "linewidth": 5, "solid_capstyle": "round", "label": "links"}
        ax.plot(chain[:, i], chain[:, j], **arm)
        ax.plot(tool[:, i], tool[:, j], color=COLOURS["frozen"], linewidth=2, label="tool")
        for kind, marker, name in (
            (sliding, "s", "sliding joint"),
            (~sliding, "o", "turning joint"),
        ):
            if kind.any():
                dots = {"color": COLOURS["desired"], "markersize": 5 if marker == "o" else 9}
                ax.plot(
                    frames[kind, i], frames[kind, j], marker, fillstyle="none", label=name, **dots
                )
        ax.plot(*tool[1, [i, j]], "o", color=COLOURS["heart"], label="tool tip")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel(f"{AXIS_NAMES[i]} (m)")
        ax.set_ylabel(f"{AXIS_NAMES[j]} (m)")
    legend_above(figure, figure.axes[0].get_legend_handles_labels()[0])
    return figure


def home_points(robot: RobotDescription) -> FloatArray:
    """Base, link-frame origins and tool tip at the home posture (m), shape (n + 2, 3)."""
    pose = np.eye(4)
    points = [pose[:3, 3]]
    for joint in robot.joints:
        sliding = joint.type is JointType.PRISMATIC
        theta = joint.theta + (0 if sliding else joint.home)
        r = joint.r + (joint.home if sliding else 0)
        pose = pose @ _screw(0, joint.alpha, joint.d) @ _screw(2, theta, r)
        points.append(pose[:3, 3])
    points.append(pose[:3, :3] @ robot.tool_tip + pose[:3, 3])
    return np.array(points)


def _screw(axis: int, angle: float, distance: float) -> FloatArray:
    """Turn about and slide along a coordinate axis, shape (4, 4)."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    pose = np.eye(4)
    pose[first, first] = pose[second, second] = np.cos(angle)
    pose[second, first] = np.sin(angle)
    pose[first, second] = -np.sin(angle)
    pose[axis, 3] = distance
    return pose
