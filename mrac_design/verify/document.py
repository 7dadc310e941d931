"""Reading a certificate: places of values in the file, its seal, and its numbers."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from flint import fmpq

_RATIONAL = re.compile(r"-?[0-9]{1,4000}(/[1-9][0-9]{0,3999})?")


class DocumentError(Exception):
    """A value of the certificate is missing or is not what its place needs."""

    def __init__(self, pointer: str, problem: str) -> None:
        self.pointer = pointer
        self.problem = problem
        super().__init__(f"{pointer}: {problem}")


@dataclass(frozen=True)
class Place:
    """A value in the file."""

    line: int
    """Line it stands on, from 1."""
    text: str
    """The value as text."""


def places(text: str) -> dict[str, Place]:
    """Every leaf of a JSON text by its pointer. Raises ValueError where it is no JSON."""
    json.loads(text)
    leaves = list(_scan(text))
    found = dict(leaves)
    if len(found) != len(leaves):
        raise ValueError("a key occurs twice")
    return found


def _scan(text: str) -> Iterator[tuple[str, Place]]:
    """Walk the tokens of a valid JSON text, keeping the pointer and the line."""
    tokens = re.finditer(r'"(?:[^"\\]|\\.)*"|[\[\]{}:,]|[^\s\[\]{}:,"]+', text)
    path: list[str | int] = []
    kinds: list[str] = []
    expects_key = False
    line, position = 1, 0
    for token in tokens:
        line += text.count("\n", position, token.start())
        position = token.start()
        word = token.group()
        if word in "{[":
            kinds.append(word)
            path.append("" if word == "{" else 0)
            expects_key = word == "{"
        elif word in "}]":
            kinds.pop()
            path.pop()
            expects_key = False
        elif word == ",":
            expects_key = kinds[-1] == "{"
            if kinds[-1] == "[":
                path[-1] = int(path[-1]) + 1
        elif word == ":":
            expects_key = False
        elif expects_key:
            path[-1] = str(json.loads(word))
        else:
            value = json.loads(word)
            yield "".join(f"/{part}" for part in path), Place(line=line, text=str(value))


def broken_seals(found: dict[str, Place]) -> Iterator[tuple[str, str]]:
    """(pointer, problem) of every value whose digest is missing or different."""
    seals = {p.removeprefix("/seal/"): v for p, v in found.items() if p.startswith("/seal/")}
    values = {p: v for p, v in found.items() if not p.startswith("/seal/")}
    for pointer, place in values.items():
        seal = seals.get(pointer)
        digest = hashlib.sha256(f"{pointer}\n{place.text}".encode()).hexdigest()[:16]
        if seal is None:
            yield pointer, "this value is not sealed: it was added or its seal removed"
        elif seal.text != digest:
            yield pointer, f"this value or its seal (line {seal.line}) was altered"
    for pointer in seals.keys() - values.keys():
        yield f"/seal/{pointer}", "a sealed value is missing"


class Reader:
    """Typed access to the values of a certificate by pointer."""

    def __init__(self, document: Any) -> None:
        self.document = document

    def value(self, pointer: str) -> Any:
        """Whatever stands at a pointer. Raises DocumentError where nothing does."""
        node = self.document
        for part in pointer.split("/")[1:]:
            try:
                node = node[int(part)] if isinstance(node, list) else node[part]
            except (KeyError, IndexError, ValueError, TypeError) as error:
                raise DocumentError(pointer, "is missing") from error
        return node

    def rational(self, pointer: str) -> fmpq:
        """The rational number at a pointer."""
        value = self.value(pointer)
        if not isinstance(value, str) or not _RATIONAL.fullmatch(value):
            raise DocumentError(pointer, "is not a rational number in a string")
        above, _, below = value.partition("/")
        return fmpq(int(above), int(below or "1"))

    def rationals(self, pointer: str, count: int) -> list[fmpq]:
        """A list of rational numbers of known length."""
        value = self.value(pointer)
        if not isinstance(value, list) or len(value) != count:
            raise DocumentError(pointer, f"needs {count} numbers")
        return [self.rational(f"{pointer}/{k}") for k in range(count)]

    def matrix(self, pointer: str, rows: int, columns: int) -> list[list[fmpq]]:
        """A matrix of known size."""
        value = self.value(pointer)
        if not isinstance(value, list) or len(value) != rows:
            raise DocumentError(pointer, f"needs {rows} rows")
        return [self.rationals(f"{pointer}/{k}", columns) for k in range(rows)]
