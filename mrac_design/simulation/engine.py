"""The machines that run a hybrid system: compiled C, LLVM, and CasADi's own interpreter."""

from __future__ import annotations

import ctypes
import logging
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.codegen.llvm_machine import LlvmModule, llvm_available
from mrac_design.errors import CompilationError
from mrac_design.simulation.compilation import compile_library, find_compiler
from mrac_design.simulation.kept_program import kept_c_program
from mrac_design.simulation.method import Method, spans_records
from mrac_design.simulation.schedule import Schedule
from mrac_design.simulation.system import HybridSystem

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Records:
    """What a part of a run brings back."""

    outputs: FloatArray
    """Recorded outputs, shape (rows, outputs)."""
    events: FloatArray
    """Rows (instant s, number of the event, its new mode), in order of time; the number -1 says
    that there were too many at that instant."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "events", readonly(self.events, (-1, 3)))


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
    ) -> Records:
        """Outputs recorded and events met in that part of the schedule.

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

    def __init__(self, entry: Any, system: HybridSystem, *, powers: int) -> None:
        self._run = entry
        self._outputs = system.outputs.size
        self._events = len(system.events)
        self._powers = powers

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> Records:
        assert coefficients.shape[2] == self._powers, "inputs of another degree"
        recorded = np.empty((int(schedule.records[part].sum()), self._outputs))
        arrays = [coefficients, parameters, state, held, recorded]
        log = np.zeros((1, 3))
        if self._events:
            log = empty_log(schedule, part)
            arrays.append(log)
        rows = run_part(self._run, schedule, part, *arrays)
        assert rows == recorded.shape[0]
        return Records(outputs=recorded, events=log[1 : 1 + int(log[0, 0])])


class CompiledEngine(NativeEngine):
    """The C program of the system in a shared library."""

    name = "compiled C"

    def __init__(
        self, system: HybridSystem, method: Method, *, input_powers: int, compiler: str
    ) -> None:
        self.spanning = spans_records(method)
        source = kept_c_program(system, method, input_powers=input_powers)
        library = compile_library(source, compiler)
        super().__init__(run_entry(library.run), system, powers=input_powers)


class LlvmEngine(NativeEngine):
    """The same program compiled inside the process by LLVM: no compiler needed."""

    name = "LLVM"

    def __init__(self, system: HybridSystem, method: Method, *, input_powers: int) -> None:
        # Loaded where it is used: with a C compiler it never is.
        from mrac_design.simulation.llvm_program import llvm_program

        self._module = LlvmModule(llvm_program(system, method, input_powers=input_powers))
        entry = ctypes.CFUNCTYPE(ctypes.c_long)(self._module.address("run"))
        super().__init__(run_entry(entry), system, powers=input_powers)


def run_entry(address: Any) -> Any:
    """The foreign function `run` of a generated program, ready to be called."""
    address.restype = ctypes.c_long
    return address


def run_part(entry: Any, schedule: Schedule, part: slice, *arrays: FloatArray) -> int:
    """Run part of a schedule on a generated program; returns how many records it met.

    `arrays` are coefficients, parameters, state, held memory, the records or accumulators and,
    where the program has one, the log; all but the first two are written.
    """
    intervals = [
        np.ascontiguousarray(values[part])
        for values in (
            schedule.start, schedule.length, schedule.substeps, schedule.segment, schedule.offset,
            schedule.records, schedule.updates,
        )
    ]  # fmt: skip
    assert all(array.flags.c_contiguous for array in arrays)
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (*intervals, *arrays))
    return int(entry(ctypes.c_long(intervals[0].size), *pointers))


def empty_log(schedule: Schedule, part: slice) -> FloatArray:
    """A log for two events a step and some besides; more are too many."""
    capacity = 2 * int(schedule.substeps[part].sum()) + 128
    log = np.empty((1 + capacity, 3))
    log[0] = 0.0, capacity, 0.0
    return log


class InterpretedEngine:
    """CasADi's own machine, the last resort: the same operations, but none fused."""

    def __init__(self, system: HybridSystem, method: Method, *, input_powers: int) -> None:
        # Loaded where it is used: with a C compiler or LLVM it never is.
        from mrac_design.simulation.interpretation import Interpreter

        self.name = "CasADi interpreter"
        self.spanning = False
        self._interpreter = Interpreter(system, method, input_powers=input_powers)

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> Records:
        outputs, events = self._interpreter.run(
            schedule, part, coefficients, parameters, state, held
        )
        return Records(outputs=outputs, events=events)
