"""Straight-line programs on CasADi's own machine, operation by operation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import casadi as ca

from mrac_design.codegen.straight_line import CONSTANT, FMA, FMS, FNMA, INPUT, StraightLine

_FUSED: dict[int, Callable[[ca.SX, ca.SX], ca.SX]] = {
    FMA: lambda product, c: product + c,
    FMS: lambda product, c: product - c,
    FNMA: lambda product, c: c - product,
}


def casadi_function(program: StraightLine, name: str) -> ca.Function:
    """An SX function with the program's operations in its order; fused ones are rounded twice."""
    arguments = [ca.SX.sym(argument, length) for argument, length in program.inputs]
    entries = [ca.vertsplit(argument) if argument.numel() else [] for argument in arguments]
    values: list[ca.SX] = []
    # CasADi would turn x (1/d) back into x/d, which has other bits.
    with _as_written():
        for operation, operands, value in program.nodes:
            if operation == INPUT:
                values.append(entries[operands[0]][operands[1]])
            elif operation == CONSTANT:
                values.append(ca.SX(value))
            elif operation in _FUSED:
                product = values[operands[0]] * values[operands[1]]
                values.append(_FUSED[operation](product, values[operands[2]]))
            elif len(operands) == 1:
                values.append(ca.SX.unary(operation, values[operands[0]]))
            else:
                values.append(ca.SX.binary(operation, *(values[i] for i in operands)))
        outputs = [
            ca.vertcat(*(values[i] for i in places)) if places else ca.SX(0, 1)
            for _, places in program.outputs
        ]
        return ca.Function(
            name, arguments, [ca.densify(output) for output in outputs],
            [argument for argument, _ in program.inputs],
            [result for result, _ in program.outputs],
        )  # fmt: skip


@contextmanager
def _as_written() -> Iterator[None]:
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(True)
