"""Sine and cosine in plain arithmetic against the C library in extended precision."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from mrac_design.controller.portable_math import sine_cosine, with_portable_trigonometry
from mrac_design.export.c_expressions import FLOAT
from mrac_design.export.c_selftest import evaluate_in

X = ca.SX.sym("x")
SINE_COSINE = ca.Function("sine_cosine", [X], list(sine_cosine(X)))


@pytest.mark.parametrize("reach", [0.8, 3.2, 100.0, 6e6])
def test_double_precision(reach):
    angles = np.random.default_rng(1).uniform(-reach, reach, 20_000)
    computed = [row.full().ravel() for row in SINE_COSINE.map(angles.size)(angles)]
    extended = angles.astype(np.longdouble)
    for value, exact in zip(computed, (np.sin(extended), np.cos(extended)), strict=True):
        # 1.5 units in the last place of double: rounding of the argument, the kernel, the sum.
        assert np.all(np.abs(value - exact) <= 1.5 * np.spacing(np.abs(exact.astype(float))))


@pytest.mark.parametrize("angle", [0.0, 1e-300, -0.7853981633974483, np.pi / 2, -np.pi, 7.0])
def test_special_angles(angle):
    # Near a zero the 2e-28 that the three parts of π/2 leave show.
    sine, cosine = (float(part) for part in SINE_COSINE(angle))
    assert sine == pytest.approx(np.sin(angle), rel=4e-16, abs=1e-27)
    assert cosine == pytest.approx(np.cos(angle), rel=4e-16, abs=1e-27)


def test_single_precision():
    angles = np.random.default_rng(2).uniform(-25, 25, 300).astype(np.float32)
    for angle in angles:
        sine, cosine = evaluate_in(SINE_COSINE, [np.array([angle])], FLOAT)
        # Two units in the last place of float at 1.
        assert sine[0] == pytest.approx(np.sin(np.float64(angle)), abs=2.4e-7)
        assert cosine[0] == pytest.approx(np.cos(np.float64(angle)), abs=2.4e-7)


def test_other_operations_stay_as_they_are():
    y = ca.SX.sym("y", 2)
    original = ca.Function(
        "f",
        [X, y],
        [ca.vertcat(0, ca.fmax(X, y[0]) / y[1], ca.sqrt(ca.fabs(X))), ca.sin(X) * ca.cos(y[1])],
        ["x", "y"],
        ["plain", "angular"],
    )
    rewritten = with_portable_trigonometry(original)
    assert rewritten.name_in() == original.name_in()
    assert rewritten.name_out() == original.name_out()
    operations = {rewritten.instruction_id(k) for k in range(rewritten.n_instructions())}
    assert not operations & {ca.OP_SIN, ca.OP_COS}
    for arguments in np.random.default_rng(3).normal(size=(20, 3)):
        before = original(arguments[0], arguments[1:])
        after = rewritten(arguments[0], arguments[1:])
        np.testing.assert_array_equal(after[0].full(), before[0].full())
        # One product of two values within 1.5 units each.
        assert float(after[1]) == pytest.approx(float(before[1]), rel=1e-15)
