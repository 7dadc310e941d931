"""Straight-line programs against CasADi's evaluation, closed forms and other libraries."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.codegen.machine import casadi_function
from mrac_design.codegen.ordering import ordered
from mrac_design.codegen.passes import fuse_products, hoist_settled, share_reciprocals
from mrac_design.codegen.reading import operations_as_written, read_function
from mrac_design.codegen.straight_line import Builder
from mrac_design.codegen.taylor import SeriesEvaluator
from mrac_design.codegen.trigonometry import lower_trigonometry
from mrac_design.errors import CodeGenerationError

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


SERIES = {
    "product": lambda t: (1 + t) * ca.sin(2 * t),
    "square": lambda t: (1 + t + ca.cos(t)) ** 2,
    "quotient": lambda t: (1 + t) / (2 + t * t),
    "inverse of a constant": lambda t: t / ca.SX(3.0),
    "root": lambda t: ca.sqrt(2 + t),
    "exponential": lambda t: ca.exp(-t) * t,
    "logarithm": lambda t: ca.log(3 + t),
    "tan": lambda t: ca.tan(0.3 + t),
    "tanh": lambda t: ca.tanh(0.4 + 2 * t),
    "atan": lambda t: ca.atan(0.2 + t),
    "power": lambda t: (2 + t) ** 1.7,
    "minimum": lambda t: ca.fmin(1 + t, 5 - t * t) + ca.fmax(ca.sin(t), t - 4),
    "absolute value": lambda t: ca.fabs(t - 1) * t,
    "choice": lambda t: ca.if_else(t < 1, t * t, ca.exp(t)),
    "negative": lambda t: -(t * t) - 3,
}


@pytest.mark.parametrize("name", SERIES)
def test_taylor_coefficients_are_the_derivatives(name):
    order, at = 7, 0.3
    t = ca.SX.sym("t")
    value = SERIES[name](t)
    program = read_function(ca.Function("f", [t], [value], ["t"], ["y"]))
    builder = Builder()
    place = builder.input("t", 1)[0]
    moving = [place, builder.constant(1.0)]
    evaluator = SeriesEvaluator(builder, program, [[moving]], moving=[True])
    terms = [evaluator.advance()["y"][0] for _ in range(order + 1)]
    series = casadi_function(builder.finish({"y": terms}), "y")(at).full().ravel()
    expected, factor = [], 1.0
    for k in range(order + 1):
        expected.append(float(ca.Function("d", [t], [value])(at)) / factor)
        value, factor = ca.jacobian(value, t), factor * (k + 1)
    np.testing.assert_allclose(series, expected, rtol=1e-11, atol=1e-13)


def test_operation_without_a_series_says_so():
    t = ca.SX.sym("t")
    program = read_function(ca.Function("f", [t], [ca.atan2(t, 1 + t)], ["t"], ["y"]))
    builder = Builder()
    moving = [builder.input("t", 1)[0], builder.constant(1.0)]
    evaluator = SeriesEvaluator(builder, program, [[moving]], moving=[True])
    evaluator.advance()
    with pytest.raises(CodeGenerationError, match="Runge–Kutta"):
        evaluator.advance()
