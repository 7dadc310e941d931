"""Reads a robot file (TOML) strictly: every key known, present, of the right shape and unit."""

from __future__ import annotations

from pathlib import Path

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ModelFileError
from mrac_design.resources import models_directory
from mrac_design.robot.description import RobotDescription
from mrac_design.robot.parts import AXIS_NAMES, Body, Joint, JointType, TaskDefinition
from mrac_design.strict_toml import Table, read_table, shown

_UNITS = {
    "length": "m",
    "angle": "rad",
    "mass": "kg",
    "inertia": "kg·m²",
    "force": "N",
    "torque": "N·m",
    "time": "s",
}
"""The only units read; a file states them so that a reader need not guess."""

_JOINT_NUMBERS = (
    "alpha",
    "d",
    "theta",
    "r",
    "home",
    "drive_inertia",
    "coulomb_friction",
    "viscous_friction",
    "effort_limit",
    "transmission",
)


def available_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _robots_directory().glob("*.toml")))


def load_robot(name_or_path: str | Path) -> RobotDescription:
    """Robot of a packaged name (see `available_robots`) or of a TOML file's path.

    Raises ModelFileError, naming file and key, for anything that is missing, misspelt, of the
    wrong shape or unit, or physically impossible.
    """
    path = _locate(name_or_path)
    root = read_table(path, ModelFileError)
    root.only("name", "provenance", "gravity", "units", "tool", "task", "joint")
    units = root.table("units")
    units.only(*_UNITS)
    for quantity, unit in _UNITS.items():
        if units.text(quantity) != unit:
            raise units.error(quantity, f'is "{units.text(quantity)}": only "{unit}" is read')
    tool = root.table("tool")
    tool.only("tip", "axis")
    tables = root.tables("joint")
    return root.build(
        lambda: RobotDescription(
            name=root.text("name"),
            provenance=root.text("provenance").strip(),
            joints=tuple(_joint(table) for table in tables),
            bodies=tuple(_body(table) for table in tables),
            gravity=_vector(root, "gravity"),
            tool_tip=_vector(tool, "tip"),
            tool_axis=_vector(tool, "axis"),
            task=_task(root.table("task")),
        )
    )


def _joint(table: Table) -> Joint:
    table.only("name", "type", *_JOINT_NUMBERS, "body")
    kind = table.choice("type", {kind.value: kind for kind in JointType})
    numbers = {key: table.number(key) for key in _JOINT_NUMBERS}
    return table.build(lambda: Joint(name=table.text("name"), type=kind, **numbers))


def _body(joint: Table) -> Body:
    table = joint.table("body")
    table.only("name", "mass", "centre_of_mass", "inertia")
    return table.build(
        lambda: Body(
            name=table.text("name"),
            mass=table.number("mass"),
            centre_of_mass=_vector(table, "centre_of_mass"),
            inertia=_matrix(table, "inertia"),
        )
    )


def _task(table: Table) -> TaskDefinition:
    table.only("position", "tool_axis")
    return table.build(
        lambda: TaskDefinition(
            position=_axes(table, "position"), tool_axis=_axes(table, "tool_axis")
        )
    )


def _vector(table: Table, key: str) -> FloatArray:
    return readonly(table.numbers(key, 3))


def _matrix(table: Table, key: str) -> FloatArray:
    value = table.entries[key]
    if (
        not isinstance(value, list)
        or len(value) != 3
        or any(not isinstance(row, list) or len(row) != 3 for row in value)
    ):
        raise table.error(key, f"needs 3 rows of 3 numbers, got {shown(value)}")
    rows = Table(
        path=table.path,
        place=table.place,
        entries={f"{key}[{index}]": row for index, row in enumerate(value, 1)},
        error_type=table.error_type,
    )
    return readonly([rows.numbers(row, 3) for row in rows.entries])


def _axes(table: Table, key: str) -> tuple[int, ...]:
    value = table.entries[key]
    if not isinstance(value, list) or any(entry not in AXIS_NAMES for entry in value):
        raise table.error(key, f'needs a list out of "X", "Y", "Z", got {shown(value)}')
    return tuple(AXIS_NAMES.index(entry) for entry in value)


def _robots_directory() -> Path:
    return models_directory() / "robots"


def _locate(name_or_path: str | Path) -> Path:
    if isinstance(name_or_path, str) and name_or_path in available_robots():
        return _robots_directory() / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if not path.exists():
        names = ", ".join(available_robots())
        raise ModelFileError(path, "", f"no such robot file, nor one of the robots {names}")
    return path
