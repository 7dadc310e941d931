"""What an exported controller is tested with: inputs, expected outputs, and a bound for `float`.

Expected outputs come from CasADi's own machine in double precision, so neither the C generator
nor a compiler had a hand in them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.robot_step import RobotStep
from mrac_design.export.c_expressions import RealType

_STEPS = 64
_SAFETY = 4.0
"""A compiler may round a `float` sum otherwise than NumPy; the bound leaves room for that."""

_ELEMENTARY: Mapping[int, Callable[..., np.floating]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_INV: np.reciprocal,
    ca.OP_SQRT: np.sqrt,
    ca.OP_FLOOR: np.floor,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_NOT: np.logical_not,
    ca.OP_IF_ELSE_ZERO: lambda a, b: b if a != 0 else np.zeros_like(b),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SelfTest:
    """A sequence of steps from rest, with what they give in double precision."""

    resting_force: FloatArray
    """Force the sequence starts at rest with (N), shape (k,)."""
    inputs: FloatArray
    """Rows (q, qd, force, reference), SI units, shape (steps, 2n + 2k)."""
    torque: FloatArray
    """Joint efforts after each step, shape (steps, n)."""
    final_state: FloatArray
    """State after the last step, shape (state.size,)."""


def build_self_test(step: RobotStep) -> SelfTest:
    """A smooth motion about the home posture, with a blow that saturates the joints."""
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    time = np.arange(_STEPS)[:, None] / _STEPS
    joint_phase, axis_phase = np.arange(n)[None, :], 1.7 * np.arange(k)[None, :]
    q = step.robot.home + 0.02 * np.sin(5 * time + joint_phase)
    qd = 0.1 * np.cos(5 * time + joint_phase)
    force = 1.0 + 0.01 * np.sin(9 * time + axis_phase)
    force[40:43] += 25.0
    reference = np.where(time < 0.3, 1.0, 1.02) + 0.0 * axis_phase
    inputs = np.hstack([q, qd, force, reference])
    resting = np.ones(k)
    torques, state = _replay(step, resting, inputs, _in_casadi)
    return SelfTest(
        resting_force=readonly(resting),
        inputs=readonly(inputs),
        torque=readonly(torques),
        final_state=readonly(state),
    )


def deviation(step: RobotStep, test: SelfTest, number: RealType) -> float:
    """How far the sequence computed in `number` strays from double precision (–).

    The largest of |ΔΓ|/limit over all torques and |Δx|/(1 + |x|) over the final state; measured
    by carrying out the step's operations one by one in that type.
    """
    torque, state = _replay(step, test.resting_force, test.inputs, _in_type(number))
    limit = step.parameters.split(np.asarray(step.parameter_values))["effort_limit"]
    return float(
        max(
            np.max(np.abs(torque - test.torque) / limit),
            np.max(np.abs(state - test.final_state) / (1.0 + np.abs(test.final_state))),
        )
    )


def tolerance(step: RobotStep, test: SelfTest, number: RealType) -> float:
    """Deviation the exported self-test accepts: four times the measured one, in double none."""
    return _SAFETY * deviation(step, test, number)


Evaluate = Callable[[ca.Function, Sequence[FloatArray]], list[FloatArray]]


def _replay(
    step: RobotStep, resting: FloatArray, inputs: FloatArray, evaluate: Evaluate
) -> tuple[FloatArray, FloatArray]:
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    (state,) = evaluate(step.equilibrium, [resting, step.parameter_values])
    torques = []
    for row in inputs:
        parts = np.split(row, [n, 2 * n, 2 * n + k])
        state, torque, _ = evaluate(step.step, [state, *parts, step.parameter_values])
        torques.append(torque)
    return np.array(torques, dtype=np.float64), np.asarray(state, dtype=np.float64)


def _in_casadi(function: ca.Function, arguments: Sequence[FloatArray]) -> list[FloatArray]:
    return [result.full().ravel() for result in function.call(list(arguments))]


def _in_type(number: RealType) -> Evaluate:
    return lambda function, arguments: evaluate_in(function, arguments, number)


def evaluate_in(
    function: ca.Function, arguments: Sequence[FloatArray], number: RealType
) -> list[FloatArray]:
    """Dense vector results of an SX function, every operation rounded to `number`."""
    kind = number.dtype.type
    rows = [function.sparsity_out(i).row() for i in range(function.n_out())]
    columns = [function.sparsity_in(i).row() for i in range(function.n_in())]
    given = [np.asarray(argument).astype(number.dtype) for argument in arguments]
    results = [np.zeros(function.numel_out(i), number.dtype) for i in range(function.n_out())]
    work: dict[int, np.floating] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            results[target[0]][rows[target[0]][target[1]]] = work[source[0]]
        elif operation == ca.OP_INPUT:
            work[target[0]] = given[source[0]][columns[source[0]][source[1]]]
        elif operation == ca.OP_CONST:
            work[target[0]] = kind(function.instruction_constant(k))
        else:
            work[target[0]] = kind(_ELEMENTARY[operation](*(work[i] for i in source)))
    return results
