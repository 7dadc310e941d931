"""Optimisations of straight-line programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

import casadi as ca

from mrac_design.codegen.straight_line import (
    CONSTANT,
    FMA,
    FMS,
    FNMA,
    INPUT,
    Builder,
    StraightLine,
)

_LEAD = 3
"""Operations a divisor has to be ahead of its dividend so that nothing waits for a division."""


def share_reciprocals(program: StraightLine, *, settled: Collection[str] = ()) -> StraightLine:
    """Quotients by the same divisor as products with its reciprocal, made once.

    So are quotients by what depends on the inputs `settled` alone, whose reciprocal
    `hoist_settled` then moves out of the loop, and quotients whose divisor is known long before
    the dividend. Changes results in the last place.
    """
    constant = _settled_positions(program, settled)
    depth = _depths(program)
    uses = Counter(node.arguments[1] for node in program.nodes if node.operation == ca.OP_DIV)
    builder = Builder()
    inputs = [builder.input(name, length) for name, length in program.inputs]
    place: list[int] = []
    for operation, arguments, value in program.nodes:
        if operation == INPUT:
            place.append(inputs[arguments[0]][arguments[1]])
        elif operation == CONSTANT:
            place.append(builder.constant(value))
        elif operation == ca.OP_DIV and (
            uses[arguments[1]] > 1
            or arguments[1] in constant
            or depth[arguments[1]] + _LEAD <= depth[arguments[0]]
        ):
            reciprocal = builder.divide(builder.constant(1.0), place[arguments[1]])
            place.append(builder.multiply(place[arguments[0]], reciprocal))
        else:
            place.append(builder.apply(operation, *(place[i] for i in arguments)))
    return builder.finish({n: [place[i] for i in entries] for n, entries in program.outputs})


def fuse_products(program: StraightLine) -> StraightLine:
    """Sums with a product that nothing else uses as one rounded operation.

    Processors do it in the time of the product alone, and it is more accurate. Where a processor
    cannot, generated code falls back to two roundings.
    """
    uses = Counter(j for node in program.nodes if node.operation != INPUT for j in node.arguments)
    uses.update(i for _, entries in program.outputs for i in entries)

    def product(i: int) -> tuple[int, ...] | None:
        node = program.nodes[i]
        return node.arguments if node.operation == ca.OP_MUL and uses[i] == 1 else None

    builder = Builder()
    inputs = [builder.input(name, length) for name, length in program.inputs]
    place: list[int] = []
    for operation, arguments, value in program.nodes:
        fused = None
        if operation in (ca.OP_ADD, ca.OP_SUB):
            left, right = product(arguments[0]), product(arguments[1])
            if right is not None:
                fused = (FMA if operation == ca.OP_ADD else FNMA, *right, arguments[0])
            elif left is not None:
                fused = (FMA if operation == ca.OP_ADD else FMS, *left, arguments[1])
        if operation == INPUT:
            place.append(inputs[arguments[0]][arguments[1]])
        elif operation == CONSTANT:
            place.append(builder.constant(value))
        elif fused is not None:
            place.append(builder.apply(fused[0], *(place[i] for i in fused[1:])))
        else:
            place.append(builder.apply(operation, *(place[i] for i in arguments)))
    return builder.finish({n: [place[i] for i in entries] for n, entries in program.outputs})


def hoist_settled(
    program: StraightLine, settled: Collection[str]
) -> tuple[StraightLine, StraightLine]:
    """Split off what depends on the inputs `settled` alone.

    Returns (setup, body): setup computes the output `prepared` from the settled inputs, body is
    the program with one more input, `prepared`.
    """
    constant = _settled_positions(program, settled)
    kept = [i for i in range(len(program.nodes)) if i not in constant]
    needed = {j for i in kept if program.nodes[i].operation != INPUT
              for j in program.nodes[i].arguments}  # fmt: skip
    needed |= {i for _, entries in program.outputs for i in entries}
    moved = sorted(
        i for i in needed & constant if program.nodes[i].operation not in (INPUT, CONSTANT)
    )
    places, builder = _copy(program, ready=None)
    first = builder.finish({"prepared": [places[i] for i in moved]})
    places, builder = _copy(program, ready=moved)
    body = builder.finish({n: [places[i] for i in entries] for n, entries in program.outputs})
    return first, body


def _copy(program: StraightLine, *, ready: list[int] | None) -> tuple[list[int], Builder]:
    """Copy with the values at `ready`, if any are given, read from one more input."""
    builder = Builder()
    inputs = [builder.input(name, length) for name, length in program.inputs]
    given: dict[int, int] = {}
    if ready is not None:
        given = dict(zip(ready, builder.input("prepared", len(ready)), strict=True))
    place: list[int] = []
    for i, (operation, arguments, value) in enumerate(program.nodes):
        if i in given:
            place.append(given[i])
        elif operation == INPUT:
            place.append(inputs[arguments[0]][arguments[1]])
        elif operation == CONSTANT:
            place.append(builder.constant(value))
        else:
            place.append(builder.apply(operation, *(place[j] for j in arguments)))
    return place, builder


def _depths(program: StraightLine) -> list[int]:
    """Length of the longest chain of operations that ends at each value."""
    depth: list[int] = []
    for operation, arguments, _ in program.nodes:
        known = operation in (INPUT, CONSTANT)
        depth.append(0 if known else 1 + max(depth[j] for j in arguments))
    return depth


def _settled_positions(program: StraightLine, settled: Collection[str]) -> set[int]:
    numbers = {i for i, (name, _) in enumerate(program.inputs) if name in settled}
    positions: set[int] = set()
    for i, (operation, arguments, _) in enumerate(program.nodes):
        if operation == CONSTANT or (
            arguments[0] in numbers
            if operation == INPUT
            else all(j in positions for j in arguments)
        ):
            positions.add(i)
    return positions
