"""Deciding a certificate: seal, gains, enclosures, and each matrix inequality at each corner."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from flint import fmpq, fmpq_mat

from mrac_design.verify.document import DocumentError, Reader, broken_seals, places
from mrac_design.verify.loop import Corner, Loop, corners, read_loop

FORMAT = "mrac-design stability certificate 2"
OUTPUTS = {"energy of force": "force", "energy of linearised command": "command"}


@dataclass(frozen=True)
class Finding:
    """Something that makes a certificate unacceptable."""

    line: int
    """Line of the file, from 1; 0 for the file as a whole."""
    pointer: str
    """JSON pointer of the value."""
    problem: str
    """What is wrong with it."""


@dataclass(frozen=True)
class Report:
    """The outcome of a check."""

    findings: tuple[Finding, ...]
    """Everything that is wrong; empty for an accepted certificate."""
    statements: tuple[str, ...]
    """What was proved anew, in sentences."""

    @property
    def accepted(self) -> bool:
        """Whether nothing is wrong and something was proved."""
        return not self.findings and bool(self.statements)


def verify_certificate(path: Path | str) -> Report:
    """Check a certificate file. Raises OSError when it cannot be read."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        found = places(text)
        document = json.loads(text)
    except ValueError as error:
        line = getattr(error, "lineno", 0)
        return Report((Finding(line, "", f"not a JSON text: {error}"),), ())
    findings = [
        Finding(found[pointer].line if pointer in found else 0, pointer, problem)
        for pointer, problem in broken_seals(found)
    ]
    if findings:
        # What is claimed is unclear once a value was altered, so nothing is decided about it.
        return Report(tuple(sorted(findings, key=lambda f: (f.line, f.pointer))), ())
    statements: tuple[str, ...] = ()
    try:
        statements = tuple(_proved(Reader(document)))
    except DocumentError as error:
        lines = [p.line for key, p in found.items() if key.startswith(error.pointer)]
        findings.append(Finding(min(lines, default=0), error.pointer, error.problem))
    return Report(tuple(findings), statements)


def _proved(reader: Reader) -> Iterator[str]:
    """One sentence for every claim decided; DocumentError at the first that fails."""
    if reader.value("/format") != FORMAT:
        raise DocumentError("/format", f"must be '{FORMAT}'; make the certificate again")
    _check_gains_hash(reader)
    loop = read_loop(reader)
    polytope = corners(reader, loop)
    claims = reader.value("/claims")
    if not isinstance(claims, list) or not claims:
        raise DocumentError("/claims", "needs a list of claims")
    for index in range(len(claims)):
        yield _decide(reader, f"/claims/{index}", loop, polytope)


def _check_gains_hash(reader: Reader) -> None:
    loop = reader.value("/loop")
    if not isinstance(loop, dict):
        raise DocumentError("/loop", "must be an object")
    text = "".join(f"{name}={_joined(loop[name])}\n" for name in sorted(loop))
    if hashlib.sha256(text.encode()).hexdigest() != reader.value("/gains_hash"):
        raise DocumentError("/gains_hash", "is not the hash of the gains in /loop")


def _joined(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _decide(reader: Reader, pointer: str, loop: Loop, polytope: list[Corner]) -> str:
    name = reader.value(f"{pointer}/claim")
    size = loop.size
    P = fmpq_mat(reader.matrix(f"{pointer}/P", size, size))
    if P.transpose() != P or not _positive(P):
        raise DocumentError(f"{pointer}/P", "is not symmetric and positive definite")
    if name == "decay":
        rate = _positive_number(reader, f"{pointer}/rate")
        blocks = ((c, _change(loop, P, c.A, None) + rate * P) for c in polytope)
        _all_negative(pointer, blocks)
        return f"V decreases by at least {rate} V per {loop.unit} at {len(polytope)} corners"
    gain = _positive_number(reader, f"{pointer}/gain")
    if name in OUTPUTS:
        _all_negative(pointer, _energy_blocks(loop, P, polytope, OUTPUTS[name], gain))
        return f"energy of the {OUTPUTS[name]} at most ({gain})² times that of the disturbance"
    if name == "peak of force":
        rate = _positive_number(reader, f"{pointer}/rate")
        _all_negative(pointer, _invariance_blocks(loop, P, polytope, rate, gain))
        _all_negative(pointer, _peak_blocks(P, polytope))
        return f"force at most {gain} times the largest disturbance"
    raise DocumentError(f"{pointer}/claim", f"unknown claim {name!r}")


def _energy_blocks(
    loop: Loop, P: fmpq_mat, polytope: list[Corner], output: str, gain: fmpq
) -> Iterator[tuple[Corner, fmpq_mat]]:
    if output == "command" and loop.sampled:
        raise DocumentError("/timing/kind", "this claim is for continuous loops")
    for corner in polytope:
        row = corner.command if output == "command" else corner.force[0]
        width = loop.energy_input.ncols()
        block = _change(loop, P, corner.A, loop.energy_input)
        yield corner, block + _diagonal(row.transpose() * row, -(gain**2), width)


def _invariance_blocks(
    loop: Loop, P: fmpq_mat, polytope: list[Corner], rate: fmpq, gain: fmpq
) -> Iterator[tuple[Corner, fmpq_mat]]:
    """Where V = xᵀPx exceeds gain² it falls, whatever the disturbance within ±1."""
    for corner, column in product(polytope, loop.disturbances):
        change = _change(loop, P, corner.A, corner.held(column))
        yield corner, change + _diagonal(rate * P, -rate * gain**2, 1)


def _peak_blocks(P: fmpq_mat, polytope: list[Corner]) -> Iterator[tuple[Corner, fmpq_mat]]:
    """The squared force is at most V."""
    for corner in polytope:
        for row in corner.force:
            yield corner, row.transpose() * row - P


def _change(loop: Loop, P: fmpq_mat, A: fmpq_mat, B: fmpq_mat | None) -> fmpq_mat:
    """Quadratic form of the change of xᵀPx: its derivative, or its difference over a sample."""
    if loop.sampled:
        joined = A if B is None else _beside(A, B)
        width = 0 if B is None else B.ncols()
        return joined.transpose() * P * joined - _diagonal(P, fmpq(0), width)
    square = A.transpose() * P + P * A
    if B is None:
        return square
    coupling = P * B
    upper = _beside(square, coupling).tolist()
    lower = _beside(coupling.transpose(), fmpq_mat(B.ncols(), B.ncols())).tolist()
    return fmpq_mat(upper + lower)


def _beside(a: fmpq_mat, b: fmpq_mat) -> fmpq_mat:
    return fmpq_mat([x + y for x, y in zip(a.tolist(), b.tolist(), strict=True)])


def _diagonal(block: fmpq_mat, value: fmpq, width: int) -> fmpq_mat:
    """The block with `width` further diagonal entries `value`."""
    n = block.nrows()
    rows = [row + [fmpq(0)] * width for row in block.tolist()]
    rows += [[value if j == n + k else fmpq(0) for j in range(n + width)] for k in range(width)]
    return fmpq_mat(rows)


def _all_negative(pointer: str, blocks: Iterator[tuple[Corner, fmpq_mat]]) -> None:
    for corner, block in blocks:
        if not _positive(-block):
            raise DocumentError(pointer, f"the inequality fails at {corner.name}")


def _positive(matrix: fmpq_mat) -> bool:
    """Sylvester's criterion: every leading principal minor is positive."""
    rows = matrix.tolist()
    return all(fmpq_mat([row[:k] for row in rows[:k]]).det() > 0 for k in range(1, len(rows) + 1))


def _positive_number(reader: Reader, pointer: str) -> fmpq:
    value = reader.rational(pointer)
    if value <= 0:
        raise DocumentError(pointer, "must be positive")
    return value
