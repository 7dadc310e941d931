"""A robot's numbers as tables people read: Markdown with LaTeX in it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from mrac_design.robot.description import AXIS_NAMES, JointType, RobotDescription

DH_CONVENTION = (
    r"$T_{j-1,j} = \mathrm{Rot}_x(\alpha_j)\,\mathrm{Trans}_x(d_j)\,"
    r"\mathrm{Rot}_z(\theta_j)\,\mathrm{Trans}_z(r_j)$"
)
"""The modified Denavit-Hartenberg convention, as LaTeX in Markdown."""


def describe(description: RobotDescription) -> str:
    """Name, provenance, tool and all tables of a robot, in Markdown."""
    tip = ", ".join(_number(value) for value in description.tool_tip)
    axis = ", ".join(_number(value) for value in description.tool_axis)
    task = [AXIS_NAMES[component] for component in description.task.position]
    held = [AXIS_NAMES[component] for component in description.task.tool_axis]
    task_text = f"tip {', '.join(task)}" + (f"; tool axis {', '.join(held)}" if held else "")
    return "\n\n".join(
        (
            f"**{description.name}**",
            description.provenance,
            f"Modified Denavit-Hartenberg, {DH_CONVENTION}:",
            dh_table(description),
            inertial_table(description),
            drive_table(description),
            f"Tool tip ({tip}) m and tool axis ({axis}) in the last frame. Task: {task_text}.",
        )
    )


def dh_table(description: RobotDescription) -> str:
    """The modified Denavit-Hartenberg parameters and the home posture, a Markdown table."""
    header = ("j", "joint", "type", r"$\alpha_j$", "$d_j$ (m)", r"$\theta_j$", "$r_j$ (m)", "home")
    rows = []
    for number, joint in enumerate(description.joints, 1):
        variable = f"$q_{number}$"
        revolute = joint.type is JointType.REVOLUTE
        theta = _plus(variable, _angle(joint.theta)) if revolute else _angle(joint.theta)
        r = _number(joint.r) if revolute else _plus(variable, _number(joint.r))
        home = f"{_angle(joint.home)} rad" if revolute else f"{_number(joint.home)} m"
        rows.append(
            (
                str(number),
                joint.name,
                joint.type.value,
                _angle(joint.alpha),
                _number(joint.d),
                theta,
                r,
                home,
            )
        )
    return _table(header, rows)


def inertial_table(description: RobotDescription) -> str:
    """Mass, centre of mass and inertia at the centre of mass of each body, a Markdown table."""
    tensor = [f"$I_{{{entry}}}$" for entry in ("xx", "yy", "zz", "xy", "xz", "yz")]
    header = ("j", "body", "$m$ (kg)", "$c$ (m)", *tensor)
    rows = []
    for number, body in enumerate(description.bodies, 1):
        centre = ", ".join(_number(value) for value in body.centre_of_mass)
        entries = [body.inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        rows.append(
            (
                str(number),
                body.name,
                _number(body.mass),
                f"({centre})",
                *(_number(entry) for entry in entries),
            )
        )
    return _table(header, rows) + "\n\nInertias in kg·m², tensor entries at the centre of mass."


def drive_table(description: RobotDescription) -> str:
    """Drive inertia, friction and limits of each joint, a Markdown table."""
    header = ("j", "$I_a$", "Coulomb", "viscous", "effort limit", "motor torque limit (N·m)")
    rows = []
    for number, joint in enumerate(description.joints, 1):
        prismatic = joint.type is JointType.PRISMATIC
        inertia, effort = ("kg", "N") if prismatic else ("kg·m²", "N·m")
        viscous = "N·s/m" if prismatic else "N·m·s/rad"
        rows.append(
            (
                str(number),
                f"{_number(joint.drive_inertia)} {inertia}",
                f"{_number(joint.coulomb_friction)} {effort}",
                f"{_number(joint.viscous_friction)} {viscous}",
                f"{_number(joint.effort_limit)} {effort}",
                _number(joint.motor_torque_limit),
            )
        )
    return _table(header, rows)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _number(value: float) -> str:
    return f"{value + 0.0:.6g}"


def _plus(variable: str, offset: str) -> str:
    if offset == "0":
        return variable
    return f"{variable} {offset}" if offset.startswith("-") else f"{variable} + {offset}"


def _angle(value: float) -> str:
    """An angle in rad, as a fraction of π where it is one."""
    ratio = Fraction(value / math.pi).limit_denominator(12)
    if ratio == 0 or not math.isclose(float(ratio) * math.pi, value, rel_tol=1e-12):
        return _number(value)
    sign = "-" if ratio < 0 else ""
    top = r"\pi" if abs(ratio.numerator) == 1 else rf"{abs(ratio.numerator)}\pi"
    return f"${sign}{top}$" if ratio.denominator == 1 else f"${sign}{top}/{ratio.denominator}$"
