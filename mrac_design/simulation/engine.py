"""The two machines that run a hybrid system: compiled C, and CasADi's own interpreter."""

from __future__ import annotations

import ctypes
import logging
from typing import Protocol

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import CompilationError
from mrac_design.simulation.compilation import compile_library, find_compiler
from mrac_design.simulation.emission import simplified
from mrac_design.simulation.program import c_program
from mrac_design.simulation.schedule import Schedule
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import ButcherTableau

_LOG = logging.getLogger(__name__)


class Engine(Protocol):
    """Runs intervals of a schedule; `state` and `held` are advanced in place."""

    name: str
    """Shown to people: which machine it is."""

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> FloatArray:
        """Outputs recorded in that part of the schedule, shape (rows, outputs).

        `coefficients` are the inputs' (segments, channels, powers), ascending powers.
        """


def build_engine(system: HybridSystem, method: ButcherTableau, *, input_powers: int) -> Engine:
    """Compiled C where a compiler works, else CasADi's interpreter, with a warning."""
    compiler = find_compiler()
    if compiler is None:
        _LOG.warning("no C compiler found: CasADi's interpreter runs the simulation, slower")
        return InterpretedEngine(system, method, input_powers=input_powers)
    try:
        return CompiledEngine(system, method, input_powers=input_powers, compiler=compiler)
    except CompilationError as problem:
        _LOG.warning("%s; CasADi's interpreter runs the simulation, slower", problem)
        return InterpretedEngine(system, method, input_powers=input_powers)


class CompiledEngine:
    """The C program of the system in a shared library; nothing of Python inside the loop."""

    def __init__(
        self, system: HybridSystem, method: ButcherTableau, *, input_powers: int, compiler: str
    ) -> None:
        self.name = "compiled C"
        self._outputs = system.outputs.size
        library = compile_library(c_program(system, method, input_powers=input_powers), compiler)
        self._run = library.run
        self._run.restype = ctypes.c_long
        self._run.argtypes = [ctypes.c_long] + 11 * [ctypes.c_void_p]

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> FloatArray:
        intervals = [
            np.ascontiguousarray(values[part])
            for values in (
                schedule.length, schedule.substeps, schedule.segment, schedule.offset,
                schedule.records, schedule.updates,
            )
        ]  # fmt: skip
        recorded = np.empty((int(schedule.records[part].sum()), self._outputs))
        arrays = [*intervals, np.ascontiguousarray(coefficients), parameters, state, held, recorded]
        count = self._run(intervals[0].size, *(array.ctypes.data for array in arrays))
        assert count == recorded.shape[0]
        return recorded


_BATCHES = (64, 8, 1)
"""Numbers of steps CasADi's interpreter takes in one call: fewer calls, no step too many."""


class InterpretedEngine:
    """CasADi's own machine, for computers without a compiler: the same operations in order."""

    def __init__(self, system: HybridSystem, method: ButcherTableau, *, input_powers: int) -> None:
        self.name = "CasADi interpreter"
        self._system = system
        self._output = simplified(system.output)
        self._update = simplified(system.update) if system.update is not None else None
        step = _step_function(system, method, input_powers)
        self._steps = {n: step.mapaccum(f"steps_{n}", n, {"base": 4}) for n in _BATCHES}

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> FloatArray:
        rows = []
        for i in range(*part.indices(schedule.length.size)):
            segment = coefficients[schedule.segment[i]]
            if schedule.updates[i] or schedule.records[i]:
                inputs = _polynomial(segment, schedule.offset[i])
                if schedule.updates[i] and self._update is not None:
                    held[:] = self._update(state, held, inputs, parameters).full().ravel()
                if schedule.records[i]:
                    rows.append(self._output(state, held, inputs, parameters).full().ravel())
            self._advance(schedule, i, segment, parameters, state, held)
        return np.array(rows).reshape(len(rows), self._system.outputs.size)

    def _advance(
        self,
        schedule: Schedule,
        i: int,
        segment: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> None:
        count = int(schedule.substeps[i])
        h = schedule.length[i] / count
        first = 0
        while first < count:
            size = next(n for n in _BATCHES if n <= count - first)
            offsets = schedule.offset[i] + np.arange(first, first + size) * h
            result = self._steps[size](
                state, held, segment.ravel(), offsets[None, :], h, parameters
            )
            state[:] = result[:, -1].full().ravel()
            first += size


def _polynomial(coefficients: FloatArray, s: float) -> FloatArray:
    value = coefficients[:, -1]
    for k in range(coefficients.shape[1] - 2, -1, -1):
        value = value * s + coefficients[:, k]
    return value


def _step_function(system: HybridSystem, method: ButcherTableau, input_powers: int) -> ca.Function:
    """One Runge–Kutta step, in the order of operations of the C program."""
    x, z, _, p = system.arguments()
    coefficients = ca.SX.sym("coefficients", system.inputs.size * input_powers)
    s, h = ca.SX.sym("s"), ca.SX.sym("h")
    table = ca.reshape(coefficients, input_powers, system.inputs.size).T
    stages: list[ca.SX] = []
    for row, fraction in zip(method.a, method.c, strict=True):
        time = s + float(fraction) * h
        inputs = table[:, -1]
        for k in range(input_powers - 2, -1, -1):
            inputs = inputs * time + table[:, k]
        stages.append(system.rate(_combine(x, h, stages, row), z, inputs, p))
    following = _combine(x, h, stages, method.b)
    return ca.Function("step", [x, z, coefficients, s, h, p], [following])


def _combine(x: ca.SX, h: ca.SX, stages: list[ca.SX], weights: FloatArray) -> ca.SX:
    terms = [float(w) * k for w, k in zip(weights, stages, strict=False) if w != 0]
    if not terms:
        return x
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return x + h * total
