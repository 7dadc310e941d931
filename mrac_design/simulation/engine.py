"""The machines that run a hybrid system: compiled C, LLVM, and CasADi's own interpreter."""

from __future__ import annotations

import ctypes
import logging
from typing import Any, Protocol

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.codegen.llvm_machine import LlvmModule, llvm_available
from mrac_design.codegen.machine import casadi_function
from mrac_design.errors import CompilationError
from mrac_design.simulation.compilation import compile_library, find_compiler
from mrac_design.simulation.emission import simplified
from mrac_design.simulation.llvm_program import llvm_program
from mrac_design.simulation.method import Method, spans_records
from mrac_design.simulation.program import c_program
from mrac_design.simulation.schedule import Schedule
from mrac_design.simulation.stepping import finished, prepare, step_program
from mrac_design.simulation.system import HybridSystem

_LOG = logging.getLogger(__name__)


class Engine(Protocol):
    """Runs intervals of a schedule; `state` and `held` are advanced in place."""

    name: str
    """Shown to people: which machine it is."""
    spanning: bool
    """Whether it takes schedules whose steps span several records."""

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


def build_engine(system: HybridSystem, method: Method, *, input_powers: int) -> Engine:
    """Compiled C where a compiler works, else LLVM, else CasADi's interpreter, with a warning."""
    compiler = find_compiler()
    try:
        if compiler is not None:
            return CompiledEngine(system, method, input_powers=input_powers, compiler=compiler)
        problem = "no C compiler found"
    except CompilationError as error:
        problem = str(error)
    if llvm_available():
        _LOG.warning("%s: LLVM compiles the simulation instead", problem)
        return LlvmEngine(system, method, input_powers=input_powers)
    _LOG.warning(
        "%s: CasADi's interpreter runs the simulation, hundreds of times slower; install a C "
        "compiler or llvmlite",
        problem,
    )
    return InterpretedEngine(system, method, input_powers=input_powers)


class NativeEngine:
    """A program in machine code; nothing of Python inside the loop."""

    name: str
    """Shown to people."""
    spanning = False
    """Whether it takes schedules whose steps span several records."""

    def __init__(self, entry: Any, *, outputs: int, powers: int) -> None:
        self._run = entry
        self._outputs = outputs
        self._powers = powers

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> FloatArray:
        assert coefficients.shape[2] == self._powers, "inputs of another degree"
        recorded = np.empty((int(schedule.records[part].sum()), self._outputs))
        arrays = (coefficients, parameters, state, held, recorded)
        rows = run_part(self._run, schedule, part, *arrays)
        assert rows == recorded.shape[0]
        return recorded


class CompiledEngine(NativeEngine):
    """The C program of the system in a shared library."""

    name = "compiled C"

    def __init__(
        self, system: HybridSystem, method: Method, *, input_powers: int, compiler: str
    ) -> None:
        self.spanning = spans_records(method)
        library = compile_library(c_program(system, method, input_powers=input_powers), compiler)
        super().__init__(run_entry(library.run), outputs=system.outputs.size, powers=input_powers)


class LlvmEngine(NativeEngine):
    """The same program compiled inside the process by LLVM: no compiler needed."""

    name = "LLVM"

    def __init__(self, system: HybridSystem, method: Method, *, input_powers: int) -> None:
        self._module = LlvmModule(llvm_program(system, method, input_powers=input_powers))
        entry = ctypes.CFUNCTYPE(ctypes.c_long)(self._module.address("run"))
        super().__init__(run_entry(entry), outputs=system.outputs.size, powers=input_powers)


def run_entry(address: Any) -> Any:
    """The foreign function `run` of a generated program, ready to be called."""
    address.restype = ctypes.c_long
    address.argtypes = [ctypes.c_long] + 12 * [ctypes.c_void_p]
    return address


def run_part(entry: Any, schedule: Schedule, part: slice, *arrays: FloatArray) -> int:
    """Run part of a schedule on a generated program; returns how many records it met.

    `arrays` are coefficients, parameters, state, held memory and the records or accumulators;
    state, memory and the last are written.
    """
    intervals = [
        np.ascontiguousarray(values[part])
        for values in (
            schedule.start, schedule.length, schedule.substeps, schedule.segment, schedule.offset,
            schedule.records, schedule.updates,
        )
    ]  # fmt: skip
    assert all(array.flags.c_contiguous for array in arrays)
    pointers = (array.ctypes.data for array in (*intervals, *arrays))
    return int(entry(intervals[0].size, *pointers))


class InterpretedEngine:
    """CasADi's own machine, the last resort: the same operations, but none fused."""

    def __init__(self, system: HybridSystem, method: Method, *, input_powers: int) -> None:
        self.name = "CasADi interpreter"
        self.spanning = False
        self._outputs = system.outputs.size
        rate, output = prepare(system.rate), prepare(system.output)
        self._rate_setup = casadi_function(rate.setup, "rate_setup")
        self._output_setup = casadi_function(output.setup, "output_setup")
        self._output = casadi_function(finished(output.body), "output")
        self._update = simplified(system.update) if system.update is not None else None
        self._step = casadi_function(step_program(system, rate, method, input_powers), "step")

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> FloatArray:
        x, z, nothing = ca.DM(state), ca.DM(held), ca.DM()
        prepared = self._rate_setup(nothing, nothing, nothing, parameters)
        ready = self._output_setup(nothing, nothing, nothing, parameters)
        rows = []
        for i in range(*part.indices(schedule.length.size)):
            segment = coefficients[schedule.segment[i]]
            if schedule.updates[i] or schedule.records[i]:
                inputs = _polynomial(segment, schedule.offset[i])
                if schedule.updates[i] and self._update is not None:
                    z = self._update(x, z, inputs, parameters)
                if schedule.records[i]:
                    rows.append(self._output(x, z, inputs, parameters, ready).full().ravel())
            flat = ca.DM(segment.ravel())
            h = schedule.length[i] / schedule.substeps[i]
            for j in range(schedule.substeps[i]):
                time, rest = schedule.offset[i] + j * h, h
                while rest > 0:
                    x, used = self._step(x, z, flat, time, rest, parameters, prepared)
                    time, rest = time + float(used), rest - float(used)
        state[:], held[:] = x.full().ravel(), z.full().ravel()
        return np.array(rows).reshape(len(rows), self._outputs)


def _polynomial(coefficients: FloatArray, s: float) -> FloatArray:
    value = coefficients[:, -1]
    for k in range(coefficients.shape[1] - 2, -1, -1):
        value = value * s + coefficients[:, k]
    return value
