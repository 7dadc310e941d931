"""Gains as files: JSON, TOML, ROS 2 parameter YAML and MATLAB, all with the same content.

Floats are written as their shortest decimal (or as the eight bytes they are), so reading any of
the files gives the same `GainSet`, bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from mrac_design.errors import GainFileError, ParameterError
from mrac_design.export.gain_document import document_of, gains_of
from mrac_design.export.gain_set import GainSet
from mrac_design.export.writing import written_whole

_MATLAB_NAME = "mrac_gains"
_MATLAB_HEADER = b"mrac_design gains; SHA-256 of what follows: "
_MATLAB_HEADER_SIZE = 116


@dataclass(frozen=True, slots=True)
class _Format:
    encode: Callable[[Mapping[str, Any]], bytes]
    """Document → content of the file."""
    decode: Callable[[bytes], Any]
    """Content of the file → document; raises _MalformedError."""


class _MalformedError(Exception):
    """The content is not of its format; the text says where."""


def write_gains(gains: GainSet, path: Path) -> None:
    """Write gains in the format of the file's suffix: .json, .toml, .yaml, .yml or .mat.

    The file appears whole or not at all. Raises ParameterError for another suffix or a law that
    has no form in a file, FileError when the file cannot be written.
    """
    content = _format(path).encode(document_of(gains))
    with written_whole(path) as staged:
        staged.write_bytes(content)


def read_gains(path: Path) -> GainSet:
    """Read gains in the format of the file's suffix, strictly.

    Raises GainFileError, naming file and key, for a file that cannot be read, an unknown or missing
    key, another unit, a changed digit, or gains that are none; ParameterError for another suffix.
    """
    form = _format(path)
    try:
        document = form.decode(path.read_bytes())
    except OSError as problem:
        raise GainFileError(path, "", f"cannot be read: {problem.strerror}") from problem
    except _MalformedError as problem:
        raise GainFileError(path, "", str(problem)) from problem
    if not isinstance(document, Mapping):
        raise GainFileError(path, "", "holds no table of gains")
    return gains_of(document, path)


def require_gains_suffix(path: Path) -> None:
    """Raise ParameterError when gains cannot be written to a file of this suffix."""
    _format(path)


def _format(path: Path) -> _Format:
    found = _FORMATS.get(path.suffix.lower())
    if found is None:
        raise ParameterError("gains file", path, f"must end in {', '.join(_FORMATS)}")
    return found


def _to_json(document: Mapping[str, Any]) -> bytes:
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def _from_json(content: bytes) -> Any:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table = dict(pairs)
        if len(table) != len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise _MalformedError(f'holds the key "{twice}" twice in one table')
        return table

    try:
        return json.loads(_text(content), object_pairs_hook=unique)
    except (ValueError, RecursionError) as problem:
        raise _MalformedError(f"is not valid JSON: {problem}") from problem


def _to_toml(document: Mapping[str, Any]) -> bytes:
    return tomli_w.dumps(document).encode()


def _from_toml(content: bytes) -> Any:
    try:
        return tomllib.loads(_text(content))
    except (tomllib.TOMLDecodeError, RecursionError) as problem:
        raise _MalformedError(f"is not valid TOML: {problem}") from problem


def _to_ros(document: Mapping[str, Any]) -> bytes:
    """Parameters of any ROS 2 node; nested names become `design.stiffness.value` there."""
    lines = ["# Load with: ros2 run PACKAGE NODE --ros-args --params-file THIS_FILE"]
    lines += ["/**:", "  ros__parameters:", *_yaml_lines(document, 4)]
    return ("\n".join(lines) + "\n").encode()


def _yaml_lines(table: Mapping[str, Any], indent: int) -> list[str]:
    lines = []
    for key, value in table.items():
        head = f"{' ' * indent}{key}:"
        if isinstance(value, Mapping):
            lines += [head, *_yaml_lines(value, indent + 2)]
        else:
            lines.append(f"{head} {_yaml_value(value)}")
    return lines


def _yaml_value(value: str | float | list[float]) -> str:
    if isinstance(value, str):
        plain = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in value)
        return f'"{"".join(plain)}"'
    if isinstance(value, list):
        return f"[{', '.join(map(_yaml_value, value))}]"
    # YAML 1.1 takes 1e-05 for a text, and ROS takes 500 for an integer.
    mantissa, mark, exponent = repr(float(value)).partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def _from_ros(content: bytes) -> Any:
    try:
        import yaml
    except ImportError as problem:
        raise _MalformedError(
            "is YAML, and PyYAML is not installed: pip install 'mrac-design[interop]'"
        ) from problem

    class UniqueKeys(yaml.SafeLoader):
        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
            names = [self.construct_object(key, deep=True) for key, _ in node.value]
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise _MalformedError(
                    f'holds the key "{twice[0]}" twice (line {node.start_mark.line + 1} on)'
                )
            return dict(super().construct_mapping(node, deep))

    try:
        document = yaml.load(_text(content), UniqueKeys)
    except (yaml.YAMLError, TypeError, RecursionError) as problem:
        raise _MalformedError(f"is not valid YAML: {' '.join(str(problem).split())}") from problem
    nodes = list(document.values()) if isinstance(document, dict) else []
    if len(nodes) != 1 or not isinstance(nodes[0], dict) or list(nodes[0]) != ["ros__parameters"]:
        raise _MalformedError("needs one node with ros__parameters and nothing else")
    return nodes[0]["ros__parameters"]


def _to_matlab(document: Mapping[str, Any]) -> bytes:
    from scipy.io import savemat

    stream = BytesIO()
    savemat(stream, {_MATLAB_NAME: document}, long_field_names=True, oned_as="row")
    # The header is free text, by default the time of writing.
    content = stream.getvalue()[_MATLAB_HEADER_SIZE:]
    return _matlab_header(content) + content


def _matlab_header(content: bytes) -> bytes:
    digest = hashlib.sha256(content).hexdigest().encode()
    return (_MATLAB_HEADER + digest).ljust(_MATLAB_HEADER_SIZE)


def _from_matlab(content: bytes) -> Any:
    from scipy.io import loadmat

    # SciPy's reader can crash the interpreter on a damaged file, so none gets that far.
    header, rest = content[:_MATLAB_HEADER_SIZE], content[_MATLAB_HEADER_SIZE:]
    if header != _matlab_header(rest):
        raise _MalformedError(
            "is not a MATLAB file as mrac_design wrote it (the SHA-256 in its header does not "
            "fit); export the gains again"
        )
    return _from_cells(loadmat(BytesIO(content), simplify_cells=True)[_MATLAB_NAME])


def _from_cells(value: Any, key: str = "") -> Any:
    if isinstance(value, dict):
        return {name: _from_cells(entry, name) for name, entry in value.items()}
    if key == "values":  # a single number comes back as a scalar
        return [entry.item() for entry in np.atleast_1d(value)]
    return value.item() if isinstance(value, np.generic) else value


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise _MalformedError(f"is not a text in UTF-8 (byte {problem.start})") from problem


_FORMATS: Mapping[str, _Format] = {
    ".json": _Format(_to_json, _from_json),
    ".toml": _Format(_to_toml, _from_toml),
    ".yaml": _Format(_to_ros, _from_ros),
    ".yml": _Format(_to_ros, _from_ros),
    ".mat": _Format(_to_matlab, _from_matlab),
}
