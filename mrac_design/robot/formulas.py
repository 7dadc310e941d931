"""A robot's numbers as tables people read: Markdown with LaTeX in it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from mrac_design.robot.parts import Body, Joint, JointType

DH_CONVENTION = (
    r"$T_{j-1,j} = \mathrm{Rot}_x(\alpha_j)\,\mathrm{Trans}_x(d_j)\,"
    r"\mathrm{Rot}_z(\theta_j)\,\mathrm{Trans}_z(r_j)$"
)
"""The modified Denavit-Hartenberg convention, as LaTeX in Markdown."""


def dh_table(joints: Sequence[Joint]) -> str:
    """The modified Denavit-Hartenberg parameters and the home posture, a Markdown table."""
    header = ("j", "joint", "type", r"$\alpha_j$", "$d_j$ (m)", r"$\theta_j$", "$r_j$ (m)", "home")
    rows = []
    for place, joint in enumerate(joints, 1):
        variable = f"$q_{place}$"
        revolute = joint.type is JointType.REVOLUTE
        theta = _plus(variable, _angle(joint.theta)) if revolute else _angle(joint.theta)
        r = number(joint.r) if revolute else _plus(variable, number(joint.r))
        home = f"{_angle(joint.home)} rad" if revolute else f"{number(joint.home)} m"
        rows.append(
            (
                str(place),
                joint.name,
                joint.type.value,
                _angle(joint.alpha),
                number(joint.d),
                theta,
                r,
                home,
            )
        )
    return _table(header, rows)


def inertial_table(bodies: Sequence[Body]) -> str:
    """Mass, centre of mass and inertia at the centre of mass of each body, a Markdown table."""
    tensor = [f"$I_{{{entry}}}$" for entry in ("xx", "yy", "zz", "xy", "xz", "yz")]
    header = ("j", "body", "$m$ (kg)", "$c$ (m)", *tensor)
    rows = []
    for place, body in enumerate(bodies, 1):
        centre = ", ".join(number(value) for value in body.centre_of_mass)
        entries = [body.inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        rows.append(
            (
                str(place),
                body.name,
                number(body.mass),
                f"({centre})",
                *(number(entry) for entry in entries),
            )
        )
    return _table(header, rows) + "\n\nInertias in kg·m², tensor entries at the centre of mass."


def drive_table(joints: Sequence[Joint]) -> str:
    """Drive inertia, friction and limits of each joint, a Markdown table."""
    header = ("j", "$I_a$", "Coulomb", "viscous", "effort limit", "motor torque limit (N·m)")
    rows = []
    for place, joint in enumerate(joints, 1):
        prismatic = joint.type is JointType.PRISMATIC
        inertia, effort = ("kg", "N") if prismatic else ("kg·m²", "N·m")
        viscous = "N·s/m" if prismatic else "N·m·s/rad"
        rows.append(
            (
                str(place),
                f"{number(joint.drive_inertia)} {inertia}",
                f"{number(joint.coulomb_friction)} {effort}",
                f"{number(joint.viscous_friction)} {viscous}",
                f"{number(joint.effort_limit)} {effort}",
                number(joint.motor_torque_limit),
            )
        )
    return _table(header, rows)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def number(value: float) -> str:
    """Six significant digits, no negative zero."""
    return f"{value + 0.0:.6g}"


def _plus(variable: str, offset: str) -> str:
    if offset == "0":
        return variable
    return f"{variable} {offset}" if offset.startswith("-") else f"{variable} + {offset}"


def _angle(value: float) -> str:
    """An angle in rad, as a fraction of π where it is one."""
    ratio = Fraction(value / math.pi).limit_denominator(12)
    if ratio == 0 or not math.isclose(float(ratio) * math.pi, value, rel_tol=1e-12):
        return number(value)
    sign = "-" if ratio < 0 else ""
    top = r"\pi" if abs(ratio.numerator) == 1 else rf"{abs(ratio.numerator)}\pi"
    return f"${sign}{top}$" if ratio.denominator == 1 else f"${sign}{top}/{ratio.denominator}$"
