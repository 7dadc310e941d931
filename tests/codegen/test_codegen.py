"""Straight-line programs against CasADi's evaluation, closed forms and other libraries."""

from __future__ import annotations

import casadi as ca
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.codegen.machine import casadi_function
from mrac_design.codegen.ordering import ordered
from mrac_design.codegen.passes import fuse_products, hoist_settled, share_reciprocals
from mrac_design.codegen.reading import operations_as_written, read_function
from mrac_design.codegen.trigonometry import lower_trigonometry

x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
EXPRESSION = ca.vertcat(
    ca.sin(x[0]) * ca.cos(x[0]) / (p[0] + p[1]) + x[1] / (1 + x[2] ** 2),
    x[2] / (1 + x[2] ** 2) - ca.sin(x[0]) ** 2 + 2 * x[1],
    ca.fmin(x[0], p[0]) + ca.if_else(x[1] > 0, x[2], ca.tanh(x[0])),
)
FUNCTION = ca.Function("f", [x, p], [EXPRESSION], ["x", "p"], ["y"])
numbers = st.floats(-3, 3).filter(lambda value: abs(value) > 1e-3)


def evaluated(program, *arguments):
    return casadi_function(program, "g")(*arguments).full().ravel()


@given(st.lists(numbers, min_size=3, max_size=3), st.lists(st.floats(0.1, 3), min_size=2,
       max_size=2))  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_every_pass_keeps_the_value(values, parameters):
    expected = FUNCTION(values, parameters).full().ravel()
    program = read_function(FUNCTION)
    # Reading shares and folds only; the other passes round differently.
    assert np.array_equal(evaluated(program, values, parameters), expected)
    for change in (share_reciprocals, lower_trigonometry, fuse_products):
        program = change(program)
        np.testing.assert_allclose(
            evaluated(program, values, parameters), expected, rtol=1e-12, atol=1e-14
        )
    again = ordered(program)
    assert again.count() == program.count()
    assert np.array_equal(
        evaluated(again, values, parameters), evaluated(program, values, parameters)
    )
    setup, body = hoist_settled(program, ["p"])
    prepared = casadi_function(setup, "s")(values, parameters)
    joined = casadi_function(body, "b")(values, parameters, prepared).full().ravel()
    np.testing.assert_allclose(joined, expected, rtol=1e-12, atol=1e-14)


def test_operations_are_counted_before_and_after():
    before, after = operations_as_written(FUNCTION), read_function(FUNCTION).count()
    # sin x0 and 1 + x2² are written twice and needed once.
    assert (before.functions, after.functions) == (4, 3)
    assert before.total > after.total
    shared = share_reciprocals(read_function(FUNCTION), settled=["p"]).count()
    assert shared.quotients == 2
    assert "operations" in after._repr_markdown_()


def test_constants_meant_to_be_zero_or_one_vanish():
    a = ca.SX.sym("a")
    rotated = ca.Function("r", [a], [np.cos(np.pi / 2) * ca.sin(a) + np.sin(np.pi / 2) * a])
    assert read_function(rotated).count().total == 0


def test_sine_and_cosine_are_within_two_units_in_the_last_place():
    import math

    angle = ca.SX.sym("angle")
    program = lower_trigonometry(
        read_function(ca.Function("t", [angle], [ca.vertcat(ca.sin(angle), ca.cos(angle))]))
    )
    assert program.count().functions == 0
    rng = np.random.default_rng(1)
    samples = np.concatenate(
        [rng.uniform(-10, 10, 4000), rng.uniform(-1e6, 1e6, 4000), np.arange(-50, 51) * np.pi / 4]
    )
    result = casadi_function(program, "t").map(samples.size)(samples[None, :]).full()
    for row, function in zip(result, (math.sin, math.cos), strict=True):
        exact = np.array([function(value) for value in samples])
        # The libraries' own error is half a unit; near a zero of the function the reduction's
        # absolute error of 1e-16 per turn counts instead.
        units = np.abs(row - exact) / np.spacing(np.abs(exact))
        assert units[np.abs(exact) > 1e-3].max() <= 2.0
        assert np.abs(row - exact).max() < 1e-15
    # A run that diverged is not to go on with numbers that mean nothing.
    huge = casadi_function(program, "t").map(4)(np.array([[2.0**50, -1e17, 1e300, np.inf]]))
    assert np.isnan(huge.full()).all()
