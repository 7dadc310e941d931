"""The order in which a straight-line program is written down.

A processor looks a few hundred operations ahead and does several at once, if the text gives it
several that do not wait for one another. The text is therefore ordered as a machine without
limits to its registers would start the operations, the longest chain first (list scheduling,
Graham 1969); what is of equal urgency stays together, so that few values are kept waiting.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from typing import Protocol

import casadi as ca

from mrac_design.codegen.straight_line import (
    CONSTANT,
    GATHER,
    INPUT,
    LANE,
    LOAD,
    Node,
    StraightLine,
)

_WIDTH = 3
"""Operations begun in a cycle."""
_LATENCY = {ca.OP_DIV: 13, ca.OP_SQRT: 20, ca.OP_NEG: 0, GATHER: 5, LANE: 3}
_USUAL_LATENCY = 4
_LOCALITY = 0.03
"""Urgency (cycles) lost per place in the given order."""
_LARGEST = 6000
"""Operations of the largest program worth ordering; larger ones are bound by memory."""


class Operation(Protocol):
    """A value of a program as far as its order goes."""

    @property
    def operation(self) -> int:
        """Number of the operation."""

    @property
    def arguments(self) -> tuple[int, ...]:
        """Positions of the operands, except of inputs."""


def ordered(program: StraightLine) -> StraightLine:
    """The same operations in an order that keeps a processor busy."""
    if len(program.nodes) > _LARGEST:
        return program
    return _renumbered(program, start_order(program.nodes))


def start_order(nodes: Sequence[Operation]) -> list[int]:
    """Positions in the order in which their operations are to be begun."""
    count = len(nodes)
    operands = [() if n.operation in (INPUT, LOAD) else tuple(set(n.arguments)) for n in nodes]
    latency = [_latency(node) for node in nodes]
    urgency = _urgency(operands, latency)
    followers: list[list[int]] = [[] for _ in range(count)]
    for i, needed in enumerate(operands):
        for j in needed:
            followers[j].append(i)
    missing = [len(needed) for needed in operands]
    ready = [(-urgency[i] + _LOCALITY * i, i) for i in range(count) if not missing[i]]
    heapq.heapify(ready)
    waiting: list[tuple[int, int]] = []
    order: list[int] = []
    cycle = 0
    while ready or waiting:
        while waiting and waiting[0][0] <= cycle:
            _, i = heapq.heappop(waiting)
            heapq.heappush(ready, (-urgency[i] + _LOCALITY * i, i))
        begun = 0
        while ready and begun < _WIDTH:
            _, i = heapq.heappop(ready)
            order.append(i)
            begun += latency[i] > 0
            for follower in followers[i]:
                missing[follower] -= 1
                if not missing[follower]:
                    heapq.heappush(waiting, (cycle + latency[i], follower))
            while waiting and waiting[0][0] <= cycle:
                _, i = heapq.heappop(waiting)
                heapq.heappush(ready, (-urgency[i] + _LOCALITY * i, i))
        cycle += 1
    return order


def _latency(node: Operation) -> int:
    if node.operation in (INPUT, LOAD, CONSTANT):
        return 0
    return _LATENCY.get(node.operation, _USUAL_LATENCY)


def _urgency(operands: list[tuple[int, ...]], latency: list[int]) -> list[int]:
    """Cycles from the beginning of an operation to the end of the longest chain it begins."""
    urgency = list(latency)
    for i in reversed(range(len(operands))):
        for j in operands[i]:
            urgency[j] = max(urgency[j], latency[j] + urgency[i])
    return urgency


def _renumbered(program: StraightLine, order: list[int]) -> StraightLine:
    place = {old: new for new, old in enumerate(order)}
    nodes = []
    for old in order:
        operation, arguments, value = program.nodes[old]
        if operation != INPUT:
            arguments = tuple(place[j] for j in arguments)
        nodes.append(Node(operation, arguments, value))
    return StraightLine(
        program.inputs,
        tuple(nodes),
        tuple((name, tuple(place[i] for i in entries)) for name, entries in program.outputs),
    )
