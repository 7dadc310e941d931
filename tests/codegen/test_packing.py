"""Packed programs against the programs they are made of, to the last bit."""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np
import pytest

from mrac_design.codegen.c_source import c_routine, support
from mrac_design.codegen.packed_source import PACKS, packed_routine
from mrac_design.codegen.packing import pack
from mrac_design.codegen.passes import fuse_products, hoist_settled
from mrac_design.codegen.reading import read_function
from mrac_design.codegen.straight_line import LANE, LOAD, StraightLine
from mrac_design.codegen.trigonometry import lower_trigonometry
from mrac_design.simulation.compilation import compile_library, find_compiler

_CALL = """
void call(const double *x, const double *p, double *y)
{
    double prepared[100];
    setup(p, prepared);
    body(x, p, prepared, y);
}
"""


def programs(function: ca.Function) -> tuple[StraightLine, StraightLine]:
    setup, body = hoist_settled(read_function(function, inputs=("x", "p")), ["p"])
    return setup, fuse_products(lower_trigonometry(body))


def copies_with_a_robot() -> ca.Function:
    """Three equal filters that drive, and are driven by, something they do not share."""
    x, p = ca.SX.sym("x", 10), ca.SX.sym("p", 7)
    turns = [ca.sin(x[i]) * ca.cos(x[i]) for i in range(4)]
    common = turns[0] * turns[1] - turns[2] / (2 + turns[3])
    rates = []
    for axis in range(3):
        a, b = x[4 + 2 * axis], x[5 + 2 * axis]
        force = p[6] * (common - x[axis]) if axis else common * common
        # The second filter's factors stand the other way round.
        product = p[axis] * a if axis != 1 else a * p[axis]
        rates += [product + b * force - ca.fabs(a) * a, force - b / p[3 + axis]]
    return ca.Function("f", [x, p], [ca.vertcat(*rates, common)], ["x", "p"], ["y"])


def compiled(text: str) -> ctypes.CDLL:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    return compile_library("#include <math.h>\n" + support(1) + PACKS + text + _CALL, compiler)


def test_a_packed_program_keeps_every_bit_and_has_fewer_operations():
    setup, body = programs(copies_with_a_robot())
    entries = body.output("y")
    named = [tuple(entries[i] for i in (k, k + 2, k + 4)) for k in range(2)]
    longer, packed = pack(setup, body, named, settled=("p", "prepared"))
    alone = compiled(c_routine(setup, "setup", inputs=["p"]) + c_routine(body, "body"))
    together = compiled(c_routine(longer, "setup", inputs=["p"]) + packed_routine(packed, "body"))
    rng = np.random.default_rng(4)
    for _ in range(200):
        x, p = rng.normal(scale=3, size=10), rng.uniform(0.5, 2, size=7)
        results = np.zeros((2, 7))
        for library, result in zip((alone, together), results, strict=True):
            arrays = (x, p, result)
            library.call(*(a.ctypes.data_as(ctypes.c_void_p) for a in arrays))
        assert np.array_equal(*results)
        assert np.isfinite(results).all()
    arithmetic = body.count().total
    # Four sines with their cosines and three filters: less than half is left.
    vectors = sum(node.wide for node in packed.nodes)
    numbers = sum(not node.wide and node.operation != LANE for node in packed.nodes)
    leaves = sum(node.operation in (ca.OP_INPUT, ca.OP_CONST) for node in packed.nodes)
    assert vectors + numbers - leaves < 0.6 * arithmetic


def test_named_values_that_are_no_copies_stay_alone():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 1)
    entries = ca.vertcat(x[0] + x[1], x[0] * x[2], x[1] - p)
    setup, body = programs(ca.Function("f", [x, p], [entries], ["x", "p"], ["y"]))
    _, packed = pack(setup, body, [body.output("y")], settled=("p", "prepared"))
    assert not any(node.wide for node in packed.nodes)


def test_packs_that_would_wait_for_one_another_come_apart():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 1)
    # Every sum of the first kind needs a product of the second kind, and the other way round.
    a0 = x[0] + p
    b0 = x[1] * a0
    b1 = x[0] * x[2]
    a1 = b1 + p
    b2 = x[2] * x[2]
    a2 = b2 + p
    entries = ca.vertcat(a0, a1, a2, b0, b1, b2)
    setup, body = programs(ca.Function("f", [x, p], [entries], ["x", "p"], ["y"]))
    y = body.output("y")
    _, packed = pack(setup, body, [y[:3], y[3:]], settled=("p", "prepared"))
    assert len(packed.outputs[0][1]) == 6
    assert not all(node.wide for node in packed.nodes)
    made = set()
    for i, node in enumerate(packed.nodes):
        if node.operation not in (ca.OP_INPUT, ca.OP_CONST) and node.arguments:
            assert all(j in made for j in node.arguments) or node.operation == LOAD
        made.add(i)
