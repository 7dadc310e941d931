"""CasADi's own way to speed: a Runge–Kutta step as generated C, loaded and mapped over time."""

from __future__ import annotations

import shlex
import subprocess
import tempfile
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.problem import RECORD, Problem


class CasadiExternal:
    """RK4 of the loop as an external function in `mapaccum`."""

    def __init__(self, problem: Problem, step: float, compiler: str, *, generated: bool) -> None:
        self._problem = problem
        self._substeps = round(RECORD / step)
        count = problem.times.size * self._substeps
        single = _step(problem, step)
        if generated:
            self._folder = tempfile.TemporaryDirectory()
            single = _external(single, Path(self._folder.name), compiler)
        self._run = single.mapaccum("run", count, {"base": 4})
        begin = np.arange(count) * step
        # The end of a step belongs to its own segment, also where the next one begins.
        instants = (begin, begin + step / 2, begin + step * (1 - 1e-9))
        self._inputs = [problem.inputs(instant) for instant in instants]

    def __call__(self) -> np.ndarray:
        problem = self._problem
        states = self._run(problem.state, *self._inputs, problem.parameters).full().T
        return np.vstack([problem.state, states])[:: self._substeps]


def _step(problem: Problem, h: float) -> ca.Function:
    system = problem.system
    x, _, v0, p = system.arguments()
    v1, v2 = system.inputs.symbols("v1"), system.inputs.symbols("v2")
    k1 = system.rate(x, [], v0, p)
    k2 = system.rate(x + h / 2 * k1, [], v1, p)
    k3 = system.rate(x + h / 2 * k2, [], v1, p)
    k4 = system.rate(x + h * k3, [], v2, p)
    following = ca.cse(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return ca.Function("casadi_step", [x, v0, v1, v2, p], [following])


def _external(function: ca.Function, folder: Path, compiler: str) -> ca.Function:
    generator = ca.CodeGenerator("casadi_step.c", {"with_header": False})
    generator.add(function)
    generator.generate(f"{folder}/")
    library = folder / "casadi_step.so"
    flags = ["-O3", "-march=native", "-fPIC", "-shared"]
    source = str(folder / "casadi_step.c")
    subprocess.run([*shlex.split(compiler), *flags, source, "-o", str(library), "-lm"], check=True)
    return ca.external("casadi_step", str(library))
