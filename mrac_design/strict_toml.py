"""Strict reading of TOML: every key known, present and of the right kind, or one error."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from mrac_design.errors import FileError, ParameterError

_Value = TypeVar("_Value")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table of a file, which knows where it stands and how its kind of file complains."""

    path: Path
    """The file."""
    place: str
    """Dotted key of the table inside the file, "" for the root."""
    entries: Mapping[str, object]
    """Keys and values as parsed."""
    error_type: type[FileError]
    """What is raised."""

    def error(self, key: str, problem: str) -> FileError:
        """An error of this file at `key` of this table."""
        return self.error_type(self.path, f"{self.place}.{key}".strip("."), problem)

    def only(self, *known: str) -> None:
        """Refuse keys outside `known`, then missing ones."""
        for key in self.entries:
            if key not in known:
                import difflib  # for mistakes only

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
        """A finite number."""
        return self._finite(key, self.entries[key])

    def numbers(self, key: str, size: int | None = None) -> list[float]:
        """A list of finite numbers, of the given size if one is given."""
        value = self.entries[key]
        if not isinstance(value, list) or (size is not None and len(value) != size):
            count = "" if size is None else f"{size} "
            raise self.error(key, f"needs a list of {count}numbers, got {shown(value)}")
        return [self._finite(f"{key}[{index}]", entry) for index, entry in enumerate(value, 1)]

    def text(self, key: str) -> str:
        """A text that is not blank."""
        value = self.entries[key]
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"needs a text, got {shown(value)}")
        return value

    def choice(self, key: str, choices: Mapping[str, _Value]) -> _Value:
        """What one of the words in `choices` stands for."""
        word = self.text(key)
        if word not in choices:
            words = " or ".join(f'"{choice}"' for choice in choices)
            raise self.error(key, f'is "{word}", must be {words}')
        return choices[word]

    def table(self, key: str) -> Table:
        """A table inside this one."""
        value = self.entries[key]
        if not isinstance(value, dict):
            raise self.error(key, f"needs a table, got {shown(value)}")
        return Table(
            path=self.path,
            place=f"{self.place}.{key}".strip("."),
            entries=value,
            error_type=self.error_type,
        )

    def tables(self, key: str) -> tuple[Table, ...]:
        """A non-empty array of tables inside this one."""
        value = self.entries[key]
        if (
            not isinstance(value, list)
            or not value
            or not all(isinstance(entry, dict) for entry in value)
        ):
            raise self.error(key, f"needs one or more [[{key}]] tables")
        return tuple(
            Table(
                path=self.path,
                place=f"{self.place}.{key}[{index}]".strip("."),
                entries=entry,
                error_type=self.error_type,
            )
            for index, entry in enumerate(value, 1)
        )

    def _finite(self, key: str, value: object) -> float:
        # bool is a kind of int in Python, but `mass = true` is a mistake.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"needs a number, got {shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"needs a finite number, got {shown(value)}")
        return number


def read_table(path: Path, error_type: type[FileError]) -> Table:
    """The root table of a TOML file; raises `error_type` when it cannot be read or parsed."""
    try:
        entries = tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise error_type(path, "", f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise error_type(
            path, "", f"is not a text file in UTF-8 (byte {error.start}); save it as UTF-8"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise error_type(path, "", f"is not valid TOML: {error}; correct that line") from error
    return Table(path=path, place="", entries=entries, error_type=error_type)


def shown(value: object) -> str:
    """A value as the reader of the error wrote it, cut short."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
