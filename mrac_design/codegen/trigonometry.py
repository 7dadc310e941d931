"""Sine and cosine of the same argument together, from additions and multiplications only.

The mathematics libraries of three machines differ in the last bit, and none of them does eight
numbers at once. This one is the same everywhere: reduction by multiples of π/2 in three parts
(Cody and Waite 1980), then the minimax polynomials of fdlibm (Sun Microsystems 1993), no branch.
The error is below 1.5 units in the last place for |x| < 10⁶; beyond, it grows as the argument's
own rounding would make it, and beyond 10¹⁵ the results are bounded but meaningless.
"""

from __future__ import annotations

from collections import defaultdict

import casadi as ca

from mrac_design.codegen.straight_line import INPUT, Builder, StraightLine

_ROUNDER = 1.5 * 2.0**52
"""Adding and subtracting it rounds to the nearest whole number."""
# π/2 in three parts: the first two have 33 bits, so their products with whole numbers are exact.
_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
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
    one, half = builder.constant(1.0), builder.constant(0.5)
    rounder = builder.constant(_ROUNDER)

    def nearest(x: int) -> int:
        return subtract(add(x, rounder), rounder)

    quarter_turns = nearest(multiply(angle, builder.constant(0.6366197723675814)))
    rest = angle
    for part in _HALF_PI:
        rest = subtract(rest, multiply(quarter_turns, builder.constant(part)))
    # Nothing but a diverged run has an angle whose reduction fails: keep its sine bounded.
    for operation, limit in ((ca.OP_FMIN, 1.0), (ca.OP_FMAX, -1.0)):
        rest = builder.apply(operation, rest, builder.constant(limit))
    square = multiply(rest, rest)
    odd = _horner(builder, _SINE, square)
    sine = add(rest, multiply(multiply(rest, square), odd))
    even = _horner(builder, _COSINE, square)
    cosine = subtract(
        one, subtract(multiply(half, square), multiply(multiply(square, square), even))
    )
    # quarter_turns = 2 f + d with d in (−1, 0, 1); f odd changes both signs.
    f = nearest(multiply(quarter_turns, half))
    d = subtract(quarter_turns, add(f, f))
    even_turn = subtract(one, multiply(d, d))
    g = nearest(multiply(f, half))
    parity = subtract(f, add(g, g))
    parity = multiply(parity, parity)
    sign = subtract(one, add(parity, parity))
    return (
        multiply(sign, add(multiply(even_turn, sine), multiply(d, cosine))),
        multiply(sign, subtract(multiply(even_turn, cosine), multiply(d, sine))),
    )


def _horner(builder: Builder, coefficients: tuple[float, ...], x: int) -> int:
    value = builder.constant(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = builder.add(builder.constant(coefficient), builder.multiply(x, value))
    return value
