"""Reads a robot file (TOML) strictly: every key known, present, of the right shape and unit."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ModelFileError, ParameterError
from mrac_design.resources import models_directory
from mrac_design.robot.description import (
    AXIS_NAMES,
    Body,
    Joint,
    JointType,
    RobotDescription,
    TaskDefinition,
)

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

_Value = TypeVar("_Value")


def available_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _robots_directory().glob("*.toml")))


def load_robot(name_or_path: str | Path) -> RobotDescription:
    """Robot of a packaged name (see `available_robots`) or of a TOML file's path.

    Raises ModelFileError, naming file and key, for anything that is missing, misspelt, of the
    wrong shape or unit, or physically impossible.
    """
    path = _locate(name_or_path)
    root = _Table(path=path, place="", entries=_parse(path))
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
            gravity=root.vector("gravity"),
            tool_tip=tool.vector("tip"),
            tool_axis=tool.vector("axis"),
            task=_task(root.table("task")),
        )
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Table:
    """One table of the file, which knows where it stands."""

    path: Path
    place: str
    entries: Mapping[str, object]

    def error(self, key: str, problem: str) -> ModelFileError:
        return ModelFileError(self.path, f"{self.place}.{key}".strip("."), problem)

    def only(self, *known: str) -> None:
        """Refuse keys outside `known`, then missing ones."""
        for key in self.entries:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
                hint = f'did you mean "{close[0]}"?' if close else f"known keys: {', '.join(known)}"
                raise self.error(key, f"unknown key; {hint}")
        for key in known:
            if key not in self.entries:
                raise self.error(key, "is missing; add it (no key has a default)")

    def build(self, constructor: Callable[[], _Value]) -> _Value:
        """Call a constructor; what it finds wrong becomes an error of this file."""
        try:
            return constructor()
        except ParameterError as error:
            raise self.error(error.name, f"{error.value}: {error.requirement}") from error

    def number(self, key: str) -> float:
        return self._finite(key, self.entries[key])

    def vector(self, key: str) -> FloatArray:
        value = self.entries[key]
        if not isinstance(value, list) or len(value) != 3:
            raise self.error(key, f"needs a list of 3 numbers, got {_shown(value)}")
        return readonly(
            [self._finite(f"{key}[{index}]", entry) for index, entry in enumerate(value, 1)]
        )

    def matrix(self, key: str) -> FloatArray:
        value = self.entries[key]
        if (
            not isinstance(value, list)
            or len(value) != 3
            or any(not isinstance(row, list) or len(row) != 3 for row in value)
        ):
            raise self.error(key, f"needs 3 rows of 3 numbers, got {_shown(value)}")
        return readonly(
            [
                [self._finite(f"{key}[{i}][{j}]", entry) for j, entry in enumerate(row, 1)]
                for i, row in enumerate(value, 1)
            ]
        )

    def text(self, key: str) -> str:
        value = self.entries[key]
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"needs a text, got {_shown(value)}")
        return value

    def axes(self, key: str) -> tuple[int, ...]:
        value = self.entries[key]
        if not isinstance(value, list) or any(entry not in AXIS_NAMES for entry in value):
            raise self.error(key, f'needs a list out of "X", "Y", "Z", got {_shown(value)}')
        return tuple(AXIS_NAMES.index(entry) for entry in value)

    def table(self, key: str) -> _Table:
        value = self.entries[key]
        if not isinstance(value, dict):
            raise self.error(key, f"needs a table, got {_shown(value)}")
        return _Table(path=self.path, place=f"{self.place}.{key}".strip("."), entries=value)

    def tables(self, key: str) -> tuple[_Table, ...]:
        value = self.entries[key]
        if (
            not isinstance(value, list)
            or not value
            or not all(isinstance(entry, dict) for entry in value)
        ):
            raise self.error(key, f"needs one [[{key}]] table per joint")
        return tuple(
            _Table(path=self.path, place=f"{key}[{index}]", entries=entry)
            for index, entry in enumerate(value, 1)
        )

    def _finite(self, key: str, value: object) -> float:
        # bool is a kind of int in Python, but `mass = true` is a mistake.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"needs a number, got {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"needs a finite number, got {_shown(value)}")
        return number


def _joint(table: _Table) -> Joint:
    table.only("name", "type", *_JOINT_NUMBERS, "body")
    kinds = [kind.value for kind in JointType]
    if table.text("type") not in kinds:
        shown = " or ".join(f'"{kind}"' for kind in kinds)
        raise table.error("type", f'is "{table.text("type")}", must be {shown}')
    numbers = {key: table.number(key) for key in _JOINT_NUMBERS}
    return table.build(
        lambda: Joint(name=table.text("name"), type=JointType(table.text("type")), **numbers)
    )


def _body(joint: _Table) -> Body:
    table = joint.table("body")
    table.only("name", "mass", "centre_of_mass", "inertia")
    return table.build(
        lambda: Body(
            name=table.text("name"),
            mass=table.number("mass"),
            centre_of_mass=table.vector("centre_of_mass"),
            inertia=table.matrix("inertia"),
        )
    )


def _task(table: _Table) -> TaskDefinition:
    table.only("position", "tool_axis")
    return table.build(
        lambda: TaskDefinition(position=table.axes("position"), tool_axis=table.axes("tool_axis"))
    )


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


def _parse(path: Path) -> Mapping[str, object]:
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise ModelFileError(path, "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ModelFileError(
            path, "", f"is not a text file in UTF-8 (byte {error.start}); save it as UTF-8"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise ModelFileError(path, "", f"is not valid TOML: {error}; correct that line") from error


def _shown(value: object) -> str:
    """A value as the reader of the error wrote it, cut short."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
