"""From CasADi SX functions to straight-line programs and into one another."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mrac_design.codegen.straight_line import (
    INPUT,
    Builder,
    OperationCount,
    StraightLine,
    count_operations,
)


def read_function(function: ca.Function, *, inputs: Sequence[str] | None = None) -> StraightLine:
    """The program of an SX `function`: common subexpressions shared, trivial operations gone.

    Its operations are CasADi's in CasADi's order. `inputs` renames the function's inputs.
    """
    builder = Builder()
    names = function.name_in() if inputs is None else inputs
    arguments = [builder.input(name, function.numel_in(i)) for i, name in enumerate(names)]
    outputs = call_function(builder, function, arguments)
    return builder.finish(dict(zip(function.name_out(), outputs, strict=True)))


def call_function(
    builder: Builder, function: ca.Function, arguments: Sequence[Sequence[int]]
) -> list[list[int]]:
    """Copy an SX function into a program under construction; returns its dense outputs."""
    rows = [_dense_places(function.sparsity_in(i)) for i in range(function.n_in())]
    places = [_dense_places(function.sparsity_out(i)) for i in range(function.n_out())]
    zero = builder.constant(0.0)
    outputs = [[zero] * function.numel_out(i) for i in range(function.n_out())]
    work: dict[int, int] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            outputs[target[0]][places[target[0]][target[1]]] = work[source[0]]
        elif operation == ca.OP_INPUT:
            work[target[0]] = arguments[source[0]][rows[source[0]][source[1]]]
        elif operation == ca.OP_CONST:
            work[target[0]] = builder.constant(_snapped(function.instruction_constant(k)))
        else:
            work[target[0]] = builder.apply(operation, *(work[i] for i in source))
    return outputs


def call_program(
    builder: Builder, program: StraightLine, arguments: Sequence[Sequence[int]]
) -> dict[str, list[int]]:
    """Copy a program into another one under construction; returns its outputs."""
    place: list[int] = []
    for operation, operands, value in program.nodes:
        if operation == INPUT:
            place.append(arguments[operands[0]][operands[1]])
        elif operation == ca.OP_CONST:
            place.append(builder.constant(value))
        else:
            place.append(builder.apply(operation, *(place[i] for i in operands)))
    return {name: [place[i] for i in entries] for name, entries in program.outputs}


def operations_as_written(function: ca.Function) -> OperationCount:
    """Arithmetic of an SX function before anything is shared or simplified."""
    return count_operations(function.instruction_id(k) for k in range(function.n_instructions()))


def _snapped(value: float) -> float:
    """Constants meant to be 0, 1 or −1, made so: cos(π/2), sin(π), a product of such.

    Rounding leaves them within two units in the last place of 1; smaller numbers were meant.
    """
    for exact in (0.0, 1.0, -1.0):
        if 1e-17 < abs(value - exact) < 2.5e-16:
            return exact
    return value


def _dense_places(sparsity: ca.Sparsity) -> list[int]:
    """Column-major places of the nonzeros."""
    rows, columns = sparsity.get_triplet()
    return [row + column * sparsity.size1() for row, column in zip(rows, columns, strict=True)]
