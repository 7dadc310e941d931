"""Taylor series of straight-line programs: automatic differentiation in time, written out.

Every value becomes its normalised coefficients w_k = w⁽ᵏ⁾ hᵏ / k! for k = 0, 1, ...; the rules are
those of power series (Moore 1966; Jorba and Zou 2005). What does not move has one coefficient
only, so that products with parameters cost one multiplication per order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from mrac_design.codegen.straight_line import CONSTANT, INPUT, Builder, StraightLine
from mrac_design.errors import CodeGenerationError

Series = list[int]
"""Positions of the coefficients known so far; a value that does not move has one."""


class SeriesEvaluator:
    """Coefficients of every value of `program`, one order after the other.

    `inputs` are the series of the program's inputs; those of moving ones may grow between calls of
    `advance`, which is how a solution feeds on itself.
    """

    def __init__(
        self, builder: Builder, program: StraightLine, inputs: Sequence[Sequence[Series]]
    ) -> None:
        self._builder = builder
        self._program = program
        self._inputs = inputs
        self._series: list[Series] = [[] for _ in program.nodes]
        self._moves = [False] * len(program.nodes)
        self._helpers: dict[int, Series] = {}
        self._order = 0
        moving = {
            (i, j)
            for i, entries in enumerate(inputs)
            for j, series in enumerate(entries)
            if len(series) != 1 or series[0] < 0
        }
        for i, node in enumerate(program.nodes):
            if node.operation == INPUT:
                self._moves[i] = node.arguments in moving
            else:
                self._moves[i] = any(self._moves[j] for j in node.arguments)

    def advance(self) -> dict[str, list[int | None]]:
        """Next coefficient of every output; None of one that does not move any more."""
        k = self._order
        for i, node in enumerate(self._program.nodes):
            if k == 0:
                self._series[i].append(self._first(i))
            elif self._moves[i]:
                self._series[i].append(self._next(i, k))
        self._order += 1
        return {
            name: [self._series[i][k] if k < len(self._series[i]) else None for i in entries]
            for name, entries in self._program.outputs
        }
