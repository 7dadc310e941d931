"""python-control's simulation of the loop with its right-hand side in NumPy numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np

from benchmarks.problem import RECORD, Problem
from mrac_design.codegen.straight_line import CONSTANT, INPUT

_WRITTEN = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_FMIN: "minimum({0}, {1})",
    ca.OP_FMAX: "maximum({0}, {1})",
}


class PythonControl:
    """`control.input_output_response` with SciPy's RK45."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        import control

        self._problem, self._tolerance = problem, tolerance
        rate = _numpy_function(problem)
        parameters, inputs = problem.parameters, problem.inputs

        def derivative(t: float, x: np.ndarray, u: np.ndarray, params: object) -> np.ndarray:
            v = inputs(min(max(t, 0.0), inputs.end))[:, 0]
            return rate(x, v, parameters)

        self._system = control.nlsys(
            derivative, None, inputs=1, states=problem.system.state.size, name="loop"
        )

    def __call__(self) -> np.ndarray:
        import control

        grid = np.append(self._problem.times, self._problem.duration)
        response = control.input_output_response(
            self._system,
            grid,
            np.zeros((1, grid.size)),
            self._problem.state,
            solve_ivp_kwargs={"rtol": self._tolerance, "atol": self._tolerance * RECORD},
        )
        return response.states.T


def _numpy_function(problem: Problem):
    program = problem.rate_program()
    shown, lines = [], ["def rate(x, v, p):"]
    for i, (operation, arguments, number) in enumerate(program.nodes):
        if operation == INPUT:
            shown.append(f"{program.inputs[arguments[0]][0]}[{arguments[1]}]")
        elif operation == CONSTANT:
            shown.append(repr(number))
        else:
            written = _WRITTEN[operation].format(*(shown[j] for j in arguments))
            lines.append(f"    w{i} = {written}")
            shown.append(f"w{i}")
    slopes = ", ".join(shown[i] for i in program.output("rate"))
    lines.append(f"    return array([{slopes}])")
    space = {name: getattr(np, name) for name in ("sin", "cos", "minimum", "maximum", "array")}
    exec("\n".join(lines), space)
    return space["rate"]
