"""Sine and cosine as plain arithmetic, so that a controller gives the same bits everywhere.

C libraries differ in the last bits of `sin` and `cos` and branch on the angle. Written out as
additions, multiplications and `floor`, the two are part of the expression itself: CasADi's own
machine, the simulation's compiled code and the exported C compute the same bits, whatever library
the robot's computer has, with an instruction count that does not depend on the angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca

_HALF_PI = (
    float.fromhex("0x1.921fap+0"),
    float.fromhex("0x1.54442p-20"),
    float.fromhex("0x1.a308d313198a3p-41"),
)
"""π/2 in three parts (Cody & Waite 1980). The first two have 20 bits, so that their products
with a quadrant number are exact: below 2³³ quadrants in double, below 16 in float."""

_SINE = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
    -1.66666666666666324348e-01,
)
"""(sin r − r)/r³ in r² on |r| ≤ π/4, highest power first (Sun's fdlibm, k_sin.c)."""

_COSINE = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)
"""(cos r − 1 + r²/2)/r⁴ in r² on |r| ≤ π/4, highest power first (Sun's fdlibm, k_cos.c)."""


def sine_cosine(angle: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(sin, cos) of a scalar angle in rad, wrong by at most 1.5 units in the last place (–).

    Measured in double up to a million turns; in float good for |angle| up to four turns.
    """
    quadrant = ca.floor(angle * (2 / math.pi) + 0.5)
    rest = angle
    for part in _HALF_PI:
        rest = rest - quadrant * part
    square = rest * rest
    sine = rest + rest * square * _horner(_SINE, square)
    cosine = 1 - (0.5 * square - square * square * _horner(_COSINE, square))
    # All factors below are exactly −1, 0 or 1: selecting by multiplication rounds nothing.
    half_turns = ca.floor(0.5 * quadrant)
    swapped = quadrant - 2 * half_turns
    kept = 1 - swapped
    sign = 1 - 2 * (half_turns - 2 * ca.floor(0.5 * half_turns))
    return (
        sign * (kept * sine + swapped * cosine),
        sign * (kept * cosine - swapped * sine),
    )


def with_portable_trigonometry(function: ca.Function) -> ca.Function:
    """The same SX function with every sine and cosine written out by `sine_cosine`."""
    arguments = function.sx_in()
    work: dict[int, ca.SX] = {}
    results = [ca.SX(function.sparsity_out(i)) for i in range(function.n_out())]
    entries: list[list[ca.SX]] = [[ca.SX(0)] * result.nnz() for result in results]
    known: dict[int, tuple[ca.SX, ca.SX]] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            entries[target[0]][target[1]] = work[source[0]]
        elif operation == ca.OP_INPUT:
            work[target[0]] = arguments[source[0]].nz[source[1]]
        elif operation == ca.OP_CONST:
            work[target[0]] = ca.SX(function.instruction_constant(k))
        elif operation in (ca.OP_SIN, ca.OP_COS):
            angle = work[source[0]]
            key = angle.element_hash()
            if key not in known:
                known[key] = sine_cosine(angle)
            work[target[0]] = known[key][0 if operation == ca.OP_SIN else 1]
        else:
            work[target[0]] = _apply(operation, [work[i] for i in source])
    outputs = [
        ca.SX(function.sparsity_out(i), ca.vertcat(*own)) if own else results[i]
        for i, own in enumerate(entries)
    ]
    return ca.Function(function.name(), arguments, outputs, function.name_in(), function.name_out())


def _apply(operation: int, operands: Sequence[ca.SX]) -> ca.SX:
    if len(operands) == 1:
        return ca.SX.unary(operation, operands[0])
    return ca.SX.binary(operation, *operands)


def _horner(coefficients: Sequence[float], x: ca.SX) -> ca.SX:
    value = ca.SX(coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value
