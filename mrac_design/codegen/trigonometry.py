"""Sine and cosine of the same argument together, from additions and multiplications only.

The mathematics libraries of three machines differ in the last bit, and none of them does eight
numbers at once. This one is the same everywhere: reduction by multiples of π/2 in two parts
(Cody and Waite 1980), then the minimax polynomials of fdlibm (Sun Microsystems 1993), no branch.
The error is below 1.5 units in the last place for |x| < 10⁶; beyond, it grows as the argument's
own rounding would make it, and from 2⁵⁰ on, where only a diverged run has angles, the results
are no numbers. Right-hand sides wait for their sines, so the chains of operations are kept short.
"""

from __future__ import annotations

import math
from collections import defaultdict

import casadi as ca

from mrac_design.codegen.straight_line import INPUT, Builder, StraightLine

_ROUNDER = 1.5 * 2.0**52
"""Adding and subtracting it rounds to the nearest whole number."""
_TOO_LARGE = 2.0**974
"""It takes magnitudes from 2⁵⁰ on to infinity, and infinity less infinity is no number."""
# π/2 in two parts: the first has 33 bits, so its products with whole numbers are exact.
_HALF_PI = (1.57079632673412561417e00, 6.07710050650619224932e-11)
_SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
_COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip


def lower_trigonometry(program: StraightLine) -> StraightLine:
    """The same program with sines and cosines written out, one reduction per argument."""
    wanted = defaultdict(set)
    for node in program.nodes:
        if node.operation in (ca.OP_SIN, ca.OP_COS):
            wanted[node.arguments[0]].add(node.operation)
    builder = Builder()
    inputs = [builder.input(name, length) for name, length in program.inputs]
    pairs: dict[int, tuple[int, int]] = {}
    place: list[int] = []
    for operation, arguments, value in program.nodes:
        if operation == INPUT:
            place.append(inputs[arguments[0]][arguments[1]])
        elif operation == ca.OP_CONST:
            place.append(builder.constant(value))
        elif operation in (ca.OP_SIN, ca.OP_COS):
            angle = arguments[0]
            if angle not in pairs:
                pairs[angle] = sine_and_cosine(builder, place[angle])
            place.append(pairs[angle][operation == ca.OP_COS])
        else:
            place.append(builder.apply(operation, *(place[i] for i in arguments)))
    return builder.finish({n: [place[i] for i in entries] for n, entries in program.outputs})


def sine_and_cosine(builder: Builder, angle: int) -> tuple[int, int]:
    """Positions of sin and cos of the value at `angle`."""
    add, subtract, multiply = builder.add, builder.subtract, builder.multiply
    rounder = builder.constant(_ROUNDER)

    def nearest(x: int, factor: float) -> int:
        return subtract(add(multiply(x, builder.constant(factor)), rounder), rounder)

    turns = nearest(angle, 2 / math.pi)
    rest = angle
    for part in _HALF_PI:
        rest = subtract(rest, multiply(turns, builder.constant(part)))
    square = multiply(rest, rest)
    fourth = multiply(square, square)
    odd = _polynomial(builder, _SINE, square, fourth)
    sine = add(rest, multiply(multiply(rest, square), odd))
    even = _polynomial(builder, _COSINE, square, fourth)
    falling = subtract(builder.constant(1.0), multiply(builder.constant(0.5), square))
    cosine = add(falling, multiply(fourth, even))
    # Quarter turns beyond whole ones, −2 to 2: their cosine is 1 − |m|, their sine m (2 − |m|).
    whole = nearest(turns, 0.25)
    m = subtract(turns, multiply(builder.constant(4.0), whole))
    size = builder.apply(ca.OP_FABS, m)
    too_large = multiply(angle, builder.constant(_TOO_LARGE))
    one = add(builder.constant(1.0), subtract(too_large, too_large))
    turned_cosine = subtract(one, size)
    turned_sine = multiply(m, subtract(builder.constant(2.0), size))
    return (
        add(multiply(turned_cosine, sine), multiply(turned_sine, cosine)),
        subtract(multiply(turned_cosine, cosine), multiply(turned_sine, sine)),
    )


def _polynomial(builder: Builder, coefficients: tuple[float, ...], x: int, square: int) -> int:
    """Value by pairs of terms (Estrin 1960): half as long a chain as Horner's."""
    pairs = [
        builder.add(builder.constant(low), builder.multiply(builder.constant(high), x))
        for low, high in zip(coefficients[::2], coefficients[1::2], strict=True)
    ]
    value = pairs[-1]
    for pair in pairs[-2::-1]:
        value = builder.add(pair, builder.multiply(square, value))
    return value
