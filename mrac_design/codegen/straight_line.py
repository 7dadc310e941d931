"""Straight-line programs: operations on numbers, each used after it is made, without branches."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

INPUT, CONSTANT = ca.OP_INPUT, ca.OP_CONST
FMA, FMS, FNMA = 1001, 1002, 1003
"""a b + c, a b − c and c − a b rounded once; CasADi has no numbers for them."""
GATHER, LANE, LOAD = 1004, 1005, 1006
"""Of packed programs: a vector of four numbers, a number of a vector, four entries of an input."""
_FREE = (INPUT, CONSTANT, ca.OP_OUTPUT, ca.OP_NEG, ca.OP_ASSIGN)
_SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_TWICE)
_FUSED = (FMA, FMS, FNMA)
_PRODUCTS = (ca.OP_MUL, ca.OP_SQ, *_FUSED)
_QUOTIENTS = (ca.OP_DIV, ca.OP_INV)
_SELECTIONS = (
    ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR,
    ca.OP_NOT, ca.OP_IF_ELSE_ZERO, ca.OP_FABS, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL,
    ca.OP_COPYSIGN,
)  # fmt: skip
_COMMUTATIVE = (ca.OP_ADD, ca.OP_MUL, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR)


class Node(NamedTuple):
    """One value of a program."""

    operation: int
    """CasADi's number of the operation (ca.OP_ADD, ...)."""
    arguments: tuple[int, ...]
    """Positions of the operands; of an input, its number and the entry in it."""
    value: float
    """Value of a constant; 0 otherwise."""


@dataclass(frozen=True, slots=True)
class OperationCount:
    """Arithmetic of a program by kind; inputs, constants and changes of sign are free."""

    sums: int
    """Additions and subtractions."""
    products: int
    """Multiplications."""
    quotients: int
    """Divisions."""
    functions: int
    """Sines, cosines, roots, powers and the like."""
    selections: int
    """Minima, maxima, comparisons and selections."""

    @property
    def total(self) -> int:
        """All of them."""
        return self.sums + self.products + self.quotients + self.functions + self.selections

    def _repr_markdown_(self) -> str:
        return (
            f"{self.total} operations: {self.sums} sums, {self.products} products, "
            f"{self.quotients} quotients, {self.functions} functions, {self.selections} selections"
        )


def count_operations(operations: Iterable[int]) -> OperationCount:
    """Sort operations, given by CasADi's numbers, by kind."""
    counted = [operation for operation in operations if operation not in _FREE]
    kinds = [
        sum(operation in kind for operation in counted)
        for kind in (_SUMS, _PRODUCTS, _QUOTIENTS, _SELECTIONS)
    ]
    sums, products, quotients, selections = kinds
    return OperationCount(
        sums=sums + sum(operation in _FUSED for operation in counted),
        products=products,
        quotients=quotients,
        functions=len(counted) - sum(kinds),
        selections=selections,
    )


@dataclass(frozen=True, slots=True)
class StraightLine:
    """A program of dense vectors in, dense vectors out."""

    inputs: tuple[tuple[str, int], ...]
    """(name, length) of each input."""
    nodes: tuple[Node, ...]
    """Values in order of computation; all are used."""
    outputs: tuple[tuple[str, tuple[int, ...]], ...]
    """Name of each output and the positions of its entries."""

    def count(self) -> OperationCount:
        """How much arithmetic it takes."""
        return count_operations(node.operation for node in self.nodes)

    def output(self, name: str) -> tuple[int, ...]:
        """Positions of the entries of an output."""
        return dict(self.outputs)[name]


class Builder:
    """Collects operations; equal ones are made once, trivial ones not at all.

    Simplifications keep the value of every finite result: constants are folded as IEEE
    arithmetic gives them, x + 0, 1 x, −(−x) and the like disappear, 0 x becomes 0.
    """

    def __init__(self) -> None:
        self._nodes: list[Node] = []
        self._known: dict[Node, int] = {}
        self._inputs: list[tuple[str, int]] = []

    def input(self, name: str, length: int) -> list[int]:
        """Positions of the entries of a new input."""
        number = len(self._inputs)
        self._inputs.append((name, length))
        return [self._make(INPUT, (number, entry)) for entry in range(length)]

    def constant(self, value: float) -> int:
        """Position of a constant."""
        return self._make(CONSTANT, (), float(value))

    def value_of(self, position: int) -> float | None:
        """Value of a constant, None of anything else."""
        node = self._nodes[position]
        return node.value if node.operation == CONSTANT else None

    def apply(self, operation: int, *arguments: int) -> int:
        """Position of an operation's result."""
        rewrite = _REWRITES.get(operation)
        if rewrite is not None:
            result = rewrite(self, *arguments)
            if result is not None:
                return result
        if operation in _COMMUTATIVE and arguments[0] > arguments[1]:
            arguments = arguments[::-1]
        return self._make(operation, arguments)

    def add(self, a: int, b: int) -> int:
        """a + b."""
        return self.apply(ca.OP_ADD, a, b)

    def subtract(self, a: int, b: int) -> int:
        """a − b."""
        return self.apply(ca.OP_SUB, a, b)

    def multiply(self, a: int, b: int) -> int:
        """a b."""
        return self.apply(ca.OP_MUL, a, b)

    def divide(self, a: int, b: int) -> int:
        """a / b."""
        return self.apply(ca.OP_DIV, a, b)

    def finish(self, outputs: Mapping[str, Sequence[int]]) -> StraightLine:
        """The program that computes `outputs`, without anything they do not need."""
        needed = set()
        stack = [position for entries in outputs.values() for position in entries]
        while stack:
            position = stack.pop()
            if position not in needed:
                needed.add(position)
                if self._nodes[position].operation != INPUT:
                    stack.extend(self._nodes[position].arguments)
        place = {old: new for new, old in enumerate(sorted(needed))}
        nodes = []
        for old in sorted(needed):
            operation, arguments, value = self._nodes[old]
            if operation != INPUT:
                arguments = tuple(place[argument] for argument in arguments)
            nodes.append(Node(operation, arguments, value))
        return StraightLine(
            inputs=tuple(self._inputs),
            nodes=tuple(nodes),
            outputs=tuple(
                (name, tuple(place[position] for position in entries))
                for name, entries in outputs.items()
            ),
        )

    def _make(self, operation: int, arguments: tuple[int, ...], value: float = 0.0) -> int:
        node = Node(operation, arguments, value)
        position = self._known.get(node)
        if position is None:
            position = self._known[node] = len(self._nodes)
            self._nodes.append(node)
        return position

    def _negated(self, position: int) -> int | None:
        node = self._nodes[position]
        return node.arguments[0] if node.operation == ca.OP_NEG else None

    def _fold(self, operation: Callable[[float, float], float], a: int, b: int) -> int | None:
        left, right = self.value_of(a), self.value_of(b)
        if left is None or right is None:
            return None
        try:
            return self.constant(operation(left, right))
        except (ZeroDivisionError, OverflowError):
            return None

    def _sum(self, a: int, b: int) -> int | None:
        if self.value_of(a) == 0:
            return b
        if self.value_of(b) == 0:
            return a
        opposite = self._negated(b)
        if opposite is not None:
            return self.subtract(a, opposite)
        opposite = self._negated(a)
        if opposite is not None:
            return self.subtract(b, opposite)
        return self._fold(lambda x, y: x + y, a, b)

    def _difference(self, a: int, b: int) -> int | None:
        if self.value_of(b) == 0:
            return a
        if self.value_of(a) == 0:
            return self.apply(ca.OP_NEG, b)
        opposite = self._negated(b)
        if opposite is not None:
            return self.add(a, opposite)
        return self._fold(lambda x, y: x - y, a, b)

    def _product(self, a: int, b: int) -> int | None:
        for one, other in ((a, b), (b, a)):
            value = self.value_of(one)
            if value == 0:
                return self.constant(0.0)
            if value == 1:
                return other
            if value == -1:
                return self.apply(ca.OP_NEG, other)
        for one, other in ((a, b), (b, a)):
            opposite = self._negated(one)
            if opposite is not None:
                return self.apply(ca.OP_NEG, self.multiply(opposite, other))
        return self._fold(lambda x, y: x * y, a, b)

    def _quotient(self, a: int, b: int) -> int | None:
        value = self.value_of(b)
        if value == 1:
            return a
        if value == -1:
            return self.apply(ca.OP_NEG, a)
        if value and math.frexp(value)[0] == 0.5:
            return self.multiply(a, self.constant(1 / value))
        if self.value_of(a) == 0:
            return self.constant(0.0)
        return self._fold(lambda x, y: x / y, a, b)

    def _negative(self, a: int) -> int | None:
        value = self.value_of(a)
        return self._negated(a) if value is None else self.constant(-value)


_REWRITES: dict[int, Callable[..., int | None]] = {
    ca.OP_ASSIGN: lambda builder, a: a,
    ca.OP_ADD: Builder._sum,
    ca.OP_SUB: Builder._difference,
    ca.OP_MUL: Builder._product,
    ca.OP_DIV: Builder._quotient,
    ca.OP_NEG: Builder._negative,
    ca.OP_SQ: lambda builder, a: builder.multiply(a, a),
    ca.OP_TWICE: lambda builder, a: builder.add(a, a),
    ca.OP_INV: lambda builder, a: builder.divide(builder.constant(1.0), a),
    ca.OP_CONSTPOW: lambda builder, a, b: builder.apply(ca.OP_POW, a, b),
}
