"""heyoka (LLVM, adaptive Taylor series) on the same equations."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from benchmarks.problem import RECORD, Problem
from mrac_design.codegen.straight_line import CONSTANT, INPUT

Expression = Any


def heyoka_equations(problem: Problem, *, fold: bool) -> list[tuple[Expression, Expression]]:
    """Right-hand side in heyoka's expressions; inputs are polynomials with parameters.

    With `fold` the loop's own parameters are numbers in the code, which is faster.
    """
    import heyoka as hy

    powers, channels = problem.inputs.degree + 1, problem.inputs.channels
    states = hy.make_vars(*[f"x{i}" for i in range(problem.system.state.size)])
    inputs = []
    for channel in range(channels):
        value = hy.par[channel * powers + powers - 1]
        for k in range(powers - 2, -1, -1):
            value = value * hy.time + hy.par[channel * powers + k]
        inputs.append(value)
    first = channels * powers
    numbers = problem.parameters
    given = {
        "x": lambda i: states[i],
        "v": lambda i: inputs[i],
        "p": lambda i: hy.expression(float(numbers[i])) if fold else hy.par[first + i],
    }
    program = problem.rate_program()
    values: list[Expression] = []
    for operation, arguments, number in program.nodes:
        if operation == INPUT:
            values.append(given[program.inputs[arguments[0]][0]](arguments[1]))
        elif operation == CONSTANT:
            values.append(hy.expression(number))
        else:
            values.append(_OPERATIONS[operation](hy, *(values[i] for i in arguments)))
    return [(states[i], values[j]) for i, j in enumerate(program.output("rate"))]


_OPERATIONS = {
    ca.OP_ADD: lambda hy, a, b: a + b,
    ca.OP_SUB: lambda hy, a, b: a - b,
    ca.OP_MUL: lambda hy, a, b: a * b,
    ca.OP_DIV: lambda hy, a, b: a / b,
    ca.OP_NEG: lambda hy, a: -a,
    ca.OP_SIN: lambda hy, a: hy.sin(a),
    ca.OP_COS: lambda hy, a: hy.cos(a),
    ca.OP_FMIN: lambda hy, a, b: hy.select(hy.lt(a, b), a, b),
    ca.OP_FMAX: lambda hy, a, b: hy.select(hy.gt(a, b), a, b),
}


class HeyokaRun:
    """One run, restarted at every breakpoint of the inputs, states on the records' grid."""

    def __init__(self, problem: Problem, tolerance: float, *, fold: bool) -> None:
        import heyoka as hy

        self._problem = problem
        self._integrator = hy.taylor_adaptive(
            heyoka_equations(problem, fold=fold), list(problem.state), tol=tolerance
        )
        self._own = problem.inputs.channels * (problem.inputs.degree + 1)
        if not fold:
            self._integrator.pars[self._own :] = problem.parameters[: self._used()]

    def _used(self) -> int:
        """Parameters heyoka knows of: up to the last that the equations name."""
        return len(self._integrator.pars) - self._own

    def __call__(self) -> np.ndarray:
        inputs, integrator = self._problem.inputs, self._integrator
        integrator.state[:] = self._problem.state
        rows = []
        for index, grid, keep in segments(self._problem):
            integrator.pars[: self._own] = inputs.coefficients[:, index, :].ravel()
            integrator.time = 0.0
            rows.append(np.asarray(integrator.propagate_grid(grid)[5])[keep])
        return np.vstack(rows)


class HeyokaBatch:
    """As many runs at once as the processor has lanes, with their own parameters."""

    def __init__(self, problem: Problem, tolerance: float, lanes: int) -> None:
        import heyoka as hy

        self._problem, self._lanes = problem, lanes
        start = np.repeat(problem.state[:, None], lanes, axis=1)
        self._start = start
        self._integrator = hy.taylor_adaptive_batch(
            heyoka_equations(problem, fold=False), np.array(start), tol=tolerance
        )

    def __call__(self, parameters: np.ndarray) -> np.ndarray:
        """States (records, states, lanes) for parameters (parameters, lanes)."""
        inputs, integrator = self._problem.inputs, self._integrator
        integrator.state[:] = self._start
        count = inputs.channels * (inputs.degree + 1)
        integrator.pars[count:] = parameters[: len(integrator.pars) - count]
        rows = []
        for index, grid, keep in segments(self._problem):
            integrator.pars[:count] = inputs.coefficients[:, index, :].reshape(-1, 1)
            integrator.set_time(0.0)
            grids = np.repeat(grid[:, None], self._lanes, axis=1)
            found = integrator.propagate_grid(grids)
            rows.append(np.asarray(found[1] if isinstance(found, tuple) else found)[keep])
        return np.concatenate(rows)


def segments(problem: Problem):
    """(segment, its grid from 0 to its length, which of the grid are records)."""
    borders = problem.inputs.breakpoints
    for index in range(problem.inputs.segments):
        start, end = borders[index], min(borders[index + 1], problem.duration)
        if start >= problem.duration - 1e-12:
            return
        first, last = (int(np.ceil(t / RECORD - 1e-9)) for t in (start, end))
        records = np.maximum(np.arange(first, last) * RECORD - start, 0.0)
        starts_on_record = records.size > 0 and records[0] < 1e-12
        inner = records[1:] if starts_on_record else records
        grid = np.concatenate([[0.0], inner, [end - start]])
        yield index, grid, slice(0 if starts_on_record else 1, len(grid) - 1)
