"""Equal computations side by side: four values of a straight-line program in one vector.

Copies of a controller and sines of several angles are the same operations on other numbers. They
are joined as far down as they agree (superword-level parallelism: Larsen and Amarasinghe 2000).
Every lane goes the way it went alone, so results keep their bits.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from mrac_design.codegen.ordering import start_order
from mrac_design.codegen.reading import call_program
from mrac_design.codegen.straight_line import (
    CONSTANT,
    FMA,
    FMS,
    FNMA,
    GATHER,
    INPUT,
    LANE,
    LOAD,
    Builder,
    StraightLine,
)

WIDTH = 4
"""Lanes of a vector; the last of three values fills two."""
_SWAPPED = (ca.OP_ADD, ca.OP_MUL, FMA, FMS, FNMA)
"""Operations whose first two operands may change places."""
_PACKED = (*_SWAPPED, ca.OP_SUB, ca.OP_DIV, ca.OP_NEG, ca.OP_FABS)
_LEVELS = (1, 2, 4, 8)
"""Levels down to which operands are compared where they can be matched in two ways."""
_DEEP = 8
"""Operations in a row that make equal values worth joining without being told."""

Lanes = tuple[int, ...]
"""Positions of the values that go together."""


class PackedNode(NamedTuple):
    """One value of a packed program, a number or a vector."""

    operation: int
    """CasADi's number of the operation, or one of `straight_line`."""
    arguments: tuple[int, ...]
    """Positions of the operands; of an input, its number and the (first) entry in it."""
    value: float
    """Value of a constant, number of a lane; 0 otherwise."""
    wide: bool
    """Whether it is a vector."""


@dataclass(frozen=True, slots=True)
class PackedLine:
    """A straight-line program some of whose values are vectors of four."""

    inputs: tuple[tuple[str, int], ...]
    """(name, length) of each input."""
    nodes: tuple[PackedNode, ...]
    """Values in order of computation."""
    outputs: tuple[tuple[str, tuple[int, ...]], ...]
    """Name of each output and the positions of its entries, numbers all."""


def pack(
    setup: StraightLine, body: StraightLine, copies: Collection[Lanes], *, settled: Collection[str]
) -> tuple[StraightLine, PackedLine]:
    """`body` with `copies`, three or four of its positions each, side by side.

    Deep computations that are equal to their beginning are found besides. Vectors of what depends
    on the inputs `settled` alone are laid out by `setup`, behind the rest of its output
    `prepared`, which is an input of `body`.
    """
    packs = _Packs(body)
    for lanes in (*copies, *_equal_throughout(body)):
        packs.join(lanes)
    return _Merger(setup, body, packs, settled).finish()


class _Packs:
    """Which values go together."""

    def __init__(self, program: StraightLine) -> None:
        self._nodes = program.nodes
        self._before = _ancestors(program)
        self._levels = _signatures(program)
        self.pack_of: dict[int, Lanes] = {}
        self.operands: dict[Lanes, list[Lanes]] = {}

    def join(self, lanes: Lanes) -> None:
        """Pack these values and, as far as they agree, what they are made of."""
        waiting = [lanes]
        while waiting:
            lanes = waiting.pop()
            if self._fit(lanes):
                self.operands[lanes] = self._matched(lanes)
                self.pack_of.update(dict.fromkeys(lanes, lanes))
                waiting += self.operands[lanes]

    def order(self) -> list[int | Lanes]:
        """Values and packs in order of computation; packs that wait for one another come apart."""
        while True:
            done = self._order()
            stuck = set(self.operands) - set(done)
            if not stuck:
                return done
            for lanes in stuck:
                del self.operands[lanes]
            self.pack_of = {i: lanes for lanes in self.operands for i in lanes}

    def _fit(self, lanes: Lanes) -> bool:
        operation = self._nodes[lanes[0]].operation
        return (
            operation in _PACKED
            and len(set(lanes)) == len(lanes)
            and all(self._nodes[i].operation == operation for i in lanes)
            and not any(i in self.pack_of for i in lanes)
            and not any(self._before[i] >> j & 1 for i in lanes for j in lanes)
        )

    def _matched(self, lanes: Lanes) -> list[Lanes]:
        """Operands lane by lane, swapped to match those of the first."""
        first, *others = (self._nodes[i] for i in lanes)
        rows = [first.arguments]
        for node in others:
            row = node.arguments
            if node.operation in _SWAPPED:
                swapped = (row[1], row[0], *row[2:])
                row = max(row, swapped, key=lambda r: self._likeness(first.arguments, r))
            rows.append(row)
        return list(zip(*rows, strict=True))

    def _likeness(self, one: Lanes, other: Lanes) -> int:
        return sum(
            1 + len(_LEVELS) if a == b else sum(level[a] == level[b] for level in self._levels)
            for a, b in zip(one[:2], other[:2], strict=True)
        )

    def _order(self) -> list[int | Lanes]:
        waits: dict[int | Lanes, int] = defaultdict(int)
        followers: dict[int | Lanes, list[int | Lanes]] = defaultdict(list)
        for i, node in enumerate(self._nodes):
            own = self.pack_of.get(i, i)
            waits[own] += 0
            for j in () if node.operation == INPUT else node.arguments:
                followers[self.pack_of.get(j, j)].append(own)
                waits[own] += 1
        ready = [item for item, count in waits.items() if not count]
        for item in ready:
            for follower in followers[item]:
                waits[follower] -= 1
                if not waits[follower]:
                    ready.append(follower)
        return ready


class _Merger:
    """Writes the packed program."""

    def __init__(
        self, setup: StraightLine, body: StraightLine, packs: _Packs, settled: Collection[str]
    ) -> None:
        self._setup, self._body, self._packs = setup, body, packs
        self._names = [name for name, _ in body.inputs]
        self._settled = {self._names.index(name) for name in settled}
        self._nodes: list[PackedNode] = []
        self._known: dict[PackedNode, int] = {}
        self._place: dict[int | Lanes, int] = {}
        self._laid_out: dict[Lanes, int] = {}

    def finish(self) -> tuple[StraightLine, PackedLine]:
        for item in self._packs.order():
            if isinstance(item, int):
                operation, arguments, value = self._body.nodes[item]
                if operation != INPUT:
                    arguments = tuple(self._number(i) for i in arguments)
                self._place[item] = self._make(operation, arguments, value=value)
            else:
                operation = self._body.nodes[item[0]].operation
                operands = [self._vector(lanes) for lanes in self._packs.operands[item]]
                self._place[item] = self._make(operation, tuple(operands), wide=True)
        outputs = [(n, [self._number(i) for i in entries]) for n, entries in self._body.outputs]
        order = start_order(self._nodes)
        place = {old: new for new, old in enumerate(order)}
        nodes = (self._nodes[old] for old in order)
        leaves = (INPUT, LOAD)
        program = PackedLine(
            self._body.inputs,
            tuple(
                n if n.operation in leaves
                else n._replace(arguments=tuple(place[i] for i in n.arguments))
                for n in nodes
            ),
            tuple((name, tuple(place[i] for i in entries)) for name, entries in outputs),
        )  # fmt: skip
        return self._extended_setup(), program

    def _make(
        self, operation: int, arguments: Lanes, *, value: float = 0.0, wide: bool = False
    ) -> int:
        node = PackedNode(operation, arguments, value, wide)
        if node not in self._known:
            self._known[node] = len(self._nodes)
            self._nodes.append(node)
        return self._known[node]

    def _number(self, i: int) -> int:
        lanes = self._packs.pack_of.get(i)
        if lanes is None:
            return self._place[i]
        return self._make(LANE, (self._place[lanes],), value=float(lanes.index(i)))

    def _vector(self, lanes: Lanes) -> int:
        if lanes in self._packs.operands:
            return self._place[lanes]
        nodes = [self._body.nodes[i] for i in lanes]
        if all(node.operation == CONSTANT and node == nodes[0] for node in nodes):
            return self._place[lanes[0]]
        filled = lanes + lanes[-1:] * (WIDTH - len(lanes))
        if not all(self._is_settled(i) for i in lanes):
            return self._make(GATHER, tuple(self._number(i) for i in filled), wide=True)
        first = len(self._setup.output("prepared")) + WIDTH * len(self._laid_out)
        entry = self._laid_out.setdefault(filled, first)
        return self._make(LOAD, (self._names.index("prepared"), entry), wide=True)

    def _is_settled(self, i: int) -> bool:
        operation, arguments, _ = self._body.nodes[i]
        return operation == CONSTANT or (operation == INPUT and arguments[0] in self._settled)

    def _extended_setup(self) -> StraightLine:
        builder = Builder()
        known = {name: builder.input(name, length) for name, length in self._setup.inputs}
        known |= call_program(builder, self._setup, list(known.values()))
        added = []
        for lanes in self._laid_out:
            for operation, arguments, value in (self._body.nodes[i] for i in lanes):
                added.append(
                    builder.constant(value)
                    if operation == CONSTANT
                    else known[self._names[arguments[0]]][arguments[1]]
                )
        return builder.finish({"prepared": [*known["prepared"], *added]})


def _ancestors(program: StraightLine) -> list[int]:
    """For each value, the set of those it is made of, as bits."""
    before: list[int] = []
    for operation, arguments, _ in program.nodes:
        bits = 0
        for j in () if operation == INPUT else arguments:
            bits |= before[j] | 1 << j
        before.append(bits)
    return before


def _signatures(program: StraightLine) -> list[list[int]]:
    """Numbers that agree, for each of `_LEVELS`, where values are made alike so far down."""
    leaf = [
        hash((n.operation, n.arguments[0] if n.operation == INPUT else n.value))
        for n in program.nodes
    ]
    current, levels = leaf, []
    for level in range(1, _LEVELS[-1] + 1):
        current = [
            leaf[i] if n.operation in (INPUT, CONSTANT) else _signature(n, current)
            for i, n in enumerate(program.nodes)
        ]
        if level in _LEVELS:
            levels.append(current)
    return levels


def _signature(node: tuple[int, Lanes, float], below: list[int]) -> int:
    operation, arguments, _ = node
    operands = [below[j] for j in arguments]
    if operation in _SWAPPED:
        operands[:2] = sorted(operands[:2])
    return hash((operation, *operands))


def _equal_throughout(program: StraightLine) -> Iterator[Lanes]:
    """Values, latest first, whose operations agree down to the inputs, in threes and fours."""
    alike: list[int] = []
    depth: list[int] = []
    groups = defaultdict(list)
    for i, node in enumerate(program.nodes):
        leaf = node.operation in (INPUT, CONSTANT)
        alike.append(hash(node.operation) if leaf else _signature(node, alike))
        depth.append(0 if leaf else 1 + max(depth[j] for j in node.arguments))
        if depth[i] >= _DEEP:
            groups[alike[i]].append(i)
    for group in sorted(groups.values(), key=lambda group: -group[-1]):
        for first in range(0, len(group) - 2, WIDTH):
            yield tuple(group[first : first + WIDTH])
