"""Tables of tracked points: CSV and MATLAB files checked cell by cell."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import MotionFileError

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
"""Units a column name may end in, in metres."""

_FRAME = "frame"
_COLUMN = re.compile(r"(?P<point>.+?)_(?P<axis>[xyz])(?:_(?P<unit>[A-Za-z]+))?")

Cells = Sequence[object]
"""One column as found in the file: texts of a CSV, numbers of a MATLAB vector."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Positions of one tracked point, one row a camera frame."""

    position: FloatArray
    """x, y, z in the camera frame, m, (frames, 3)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", readonly(self.position, (-1, 3)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Table:
    """The columns of a file by name, all of one length."""

    columns: Mapping[str, Cells]
    first_row: int
    """What people call the first row of numbers: 2 under a CSV's header, 1 in a vector."""


def read_track(path: Path, *, point: str, unit: str | None = None) -> Track:
    """Positions of `point` in a .csv or .mat file, in metres.

    A CSV has a header row with `<point>_<x|y|z>_<unit>`; a .mat file has vectors of these
    names (MATLAB files up to version 7). A `frame` column, if there is one, must count up by
    ones. `unit` (m, cm, mm, um) states the unit of columns whose names carry none. Raises
    MotionFileError naming row and column.
    """
    readers = {".csv": _read_csv, ".mat": _read_mat}
    if not path.exists():
        raise MotionFileError(path, "", "no such file")
    if not path.is_file():
        raise MotionFileError(path, "", "is not a file")
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise MotionFileError(
            path, "suffix", f"'{path.suffix}' is not supported: give a .csv or .mat file"
        )
    if path.stat().st_size == 0:
        raise MotionFileError(path, "", "the file is empty")
    table = reader(path)
    if _FRAME in table.columns:
        _check_frames(path, table)
    position = [
        _numbers(path, table, name) * METRES[_unit(path, name, unit)]
        for name in _point_columns(path, table, point)
    ]
    if position[0].size == 0:
        raise MotionFileError(path, "", "holds a header but no frames")
    return Track(position=np.stack(position, axis=1))


def _read_csv(path: Path) -> _Table:
    """The cells of a comma-separated file as texts."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = [row for row in csv.reader(stream) if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as problem:
        raise MotionFileError(path, "", f"is not a CSV text file ({problem})") from problem
    except OSError as problem:
        raise MotionFileError(path, "", f"cannot be read ({problem.strerror})") from problem
    if not rows:
        raise MotionFileError(path, "", "the file is empty")
    header = [cell.strip() for cell in rows[0]]
    twice = sorted({name for name in header if header.count(name) > 1})
    if twice:
        raise MotionFileError(path, "header", f"column '{twice[0]}' appears more than once")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise MotionFileError(
                path, f"row {number}", f"has {len(row)} cells, the header has {len(header)}"
            )
    columns = {name: [row[index] for row in rows[1:]] for index, name in enumerate(header)}
    return _Table(columns=columns, first_row=2)


def _read_mat(path: Path) -> _Table:
    """The vectors of a MATLAB file; other variables are left alone."""
    # Most runs read no MATLAB file, and the import is slow.
    from scipy.io import loadmat

    try:
        content = loadmat(path)
    # The reader fails in many ways on a damaged or newer file; all mean the same to a user.
    except Exception as problem:
        raise MotionFileError(
            path, "", f"is not a MATLAB file up to version 7, save with -v7 ({problem})"
        ) from problem
    vectors: dict[str, Cells] = {}
    for name, value in content.items():
        if isinstance(value, np.ndarray) and value.ndim == 2 and min(value.shape) <= 1:
            vectors[name] = list(value.ravel())
    return _Table(columns=vectors, first_row=1)


def _point_columns(path: Path, table: _Table, point: str) -> list[str]:
    """Names of the x, y, z columns of `point`."""
    found: dict[str, str] = {}
    points: set[str] = set()
    for name in table.columns:
        match = _COLUMN.fullmatch(name)
        if match is None:
            continue
        points.add(match["point"])
        if match["point"] == point:
            found[match["axis"]] = name
    missing = [axis for axis in "xyz" if axis not in found]
    if missing:
        offered = f"points {', '.join(sorted(points))}" if points else "no tracked point"
        listed = ", ".join(name for name in table.columns if not name.startswith("__"))
        raise MotionFileError(
            path,
            f"point {point}",
            f"no column {point}_{missing[0]}_<unit>; the file has {offered} "
            f"(columns: {listed or 'none'})",
        )
    names = [found[axis] for axis in "xyz"]
    lengths = {name: len(table.columns[name]) for name in names}
    if len(set(lengths.values())) > 1:
        raise MotionFileError(path, f"point {point}", f"columns differ in length: {lengths}")
    return names


def _unit(path: Path, name: str, stated: str | None) -> str:
    """Unit of a column from its name, or else as stated."""
    match = _COLUMN.fullmatch(name)
    suffix = match["unit"] if match else None
    unit = suffix or stated
    if unit is None:
        raise MotionFileError(
            path, f"column {name}", f"carries no unit: state one of {', '.join(METRES)}"
        )
    if unit not in METRES:
        raise MotionFileError(
            path, f"column {name}", f"unit '{unit}' is unknown: use {', '.join(METRES)}"
        )
    if suffix and stated and suffix != stated:
        raise MotionFileError(path, f"column {name}", f"is not in {stated}, the unit stated")
    return unit


def _numbers(path: Path, table: _Table, name: str) -> FloatArray:
    """One column as finite numbers."""
    values = np.empty(len(table.columns[name]))
    for index, cell in enumerate(table.columns[name]):
        place = f"row {table.first_row + index}, column {name}"
        text = str(cell).strip()
        try:
            # Python would read the typing error 1_2 as twelve.
            values[index] = float(text.replace("_", "?"))
        except ValueError as problem:
            shown = f"'{text}'" if text else "an empty cell"
            raise MotionFileError(path, place, f"{shown} is not a number") from problem
        if not np.isfinite(values[index]):
            raise MotionFileError(path, place, f"{text} is not a finite number; fill the gap first")
    return values


def _check_frames(path: Path, table: _Table) -> None:
    """Frame numbers must count up by ones: a gap would shift everything after it in time."""
    numbers = _numbers(path, table, _FRAME)
    wrong = np.flatnonzero(np.diff(numbers) != 1.0)
    if wrong.size:
        index = int(wrong[0])
        raise MotionFileError(
            path,
            f"row {table.first_row + index + 1}, column {_FRAME}",
            f"frame {numbers[index + 1]:g} after frame {numbers[index]:g}: frames must count up "
            "by one, without gaps",
        )
