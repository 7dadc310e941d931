"""Eight runs at once: one program on vectors of eight doubles, in lockstep over one schedule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.compilation import compile_library
from mrac_design.simulation.engine import Engine, run_entry, run_part
from mrac_design.simulation.method import Method, spans_records
from mrac_design.simulation.program import c_program
from mrac_design.simulation.reduction import Reduction
from mrac_design.simulation.schedule import Schedule
from mrac_design.simulation.system import HybridSystem

LANES = 8
"""Runs that go together: as many doubles as the widest vectors of today's processors."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """What one run of an ensemble has of its own."""

    parameters: FloatArray
    """Parameters of the system, shape (parameters.size,)."""
    initial_state: FloatArray
    """State at time 0, shape (state.size,)."""
    inputs: PiecewisePolynomial
    """Inputs over the run; cases with the same breakpoints can share vectors."""
    held: FloatArray | None = None
    """Memory before the first update, shape (held.size,); None is zero."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", readonly(self.parameters, (-1,)))
        object.__setattr__(self, "initial_state", readonly(self.initial_state, (-1,)))
        if self.held is not None:
            object.__setattr__(self, "held", readonly(self.held, (-1,)))

    def memory(self, size: int) -> FloatArray:
        """A copy of the initial memory, shape (size,)."""
        return np.zeros(size) if self.held is None else np.array(self.held)


class GroupEngine(Protocol):
    """Runs cases that share a schedule."""

    spanning: bool
    """Whether it takes schedules whose steps span several records."""

    def accumulate(self, schedule: Schedule, cases: Sequence[Case]) -> FloatArray:
        """Accumulators of every case, shape (cases, k); NaN where a run left the numbers."""


class LaneEngine:
    """Generated C on vectors: each lane has the bits of a run of its own."""

    def __init__(
        self,
        system: HybridSystem,
        method: Method,
        reduction: Reduction,
        *,
        input_powers: int,
        compiler: str,
        lanes: int = LANES,
    ) -> None:
        source = c_program(
            system,
            method,
            input_powers=input_powers,
            lanes=lanes,
            reduction=reduction.over(system),
        )
        self.spanning = spans_records(method)
        self._run = run_entry(compile_library(source, compiler).run)
        self._system = system
        self._reduction = reduction
        self._lanes = lanes
        self._powers = input_powers

    def accumulate(self, schedule: Schedule, cases: Sequence[Case]) -> FloatArray:
        """See `GroupEngine`."""
        return np.vstack([self._group(schedule, group) for group in _batches(cases, self._lanes)])

    def _group(self, schedule: Schedule, cases: Sequence[Case]) -> FloatArray:
        count = len(cases)
        filled = [*cases, *[cases[-1]] * (self._lanes - count)]
        state = _interleaved([case.initial_state for case in filled])
        parameters = _interleaved([case.parameters for case in filled])
        coefficients = _interleaved([_by_segment(case.inputs, self._powers) for case in filled])
        held = _interleaved([case.memory(self._system.held.size) for case in filled])
        sums = _interleaved([self._reduction.initial] * self._lanes)
        run_part(self._run, schedule, slice(None), coefficients, parameters, state, held, sums)
        return _judged(sums.T[:count], state.T[:count])


class RecordingEngine:
    """Any single-run engine, its records folded afterwards: where no C compiler is."""

    def __init__(
        self, system: HybridSystem, reduction: Reduction, engine: Engine, *, input_powers: int
    ) -> None:
        self.spanning = engine.spanning
        self._system = system
        self._reduction = reduction
        self._engine = engine
        self._powers = input_powers

    def accumulate(self, schedule: Schedule, cases: Sequence[Case]) -> FloatArray:
        """See `GroupEngine`."""
        times = schedule.start[schedule.records]
        fold = self._reduction.fold.mapaccum("folds", times.size, {"base": 8})
        rows = []
        for case in cases:
            state, held = np.array(case.initial_state), case.memory(self._system.held.size)
            coefficients = np.ascontiguousarray(_by_segment(case.inputs, self._powers))
            outputs = self._engine.run(
                schedule, slice(None), coefficients, case.parameters, state, held
            ).outputs
            sums = fold(self._reduction.initial, outputs.T, times[None, :])[:, -1]
            rows.append(_judged(ca.DM(sums).full().T, state[None, :]))
        return np.vstack(rows)


def _batches(cases: Sequence[Case], size: int) -> Iterator[Sequence[Case]]:
    for first in range(0, len(cases), size):
        yield cases[first : first + size]


def _by_segment(inputs: PiecewisePolynomial, powers: int) -> FloatArray:
    """Coefficients as programs read them, (segments, channels, powers)."""
    missing = powers - inputs.coefficients.shape[2]
    padded = np.pad(inputs.coefficients, ((0, 0), (0, 0), (0, missing)))
    return padded.transpose(1, 0, 2)


def _interleaved(arrays: Sequence[FloatArray]) -> FloatArray:
    """Arrays of one shape (...,) side by side as (..., lanes), aligned for vector loads."""
    result = _aligned((*arrays[0].shape, len(arrays)))
    for lane, array in enumerate(arrays):
        result[..., lane] = array
    return result


def _aligned(shape: tuple[int, ...]) -> FloatArray:
    """Zeros that begin at a multiple of 64 bytes."""
    size = int(np.prod(shape))
    raw = np.zeros(size + 8)
    first = (-raw.ctypes.data // 8) % 8
    return raw[first : first + size].reshape(shape)


def _judged(sums: FloatArray, states: FloatArray) -> FloatArray:
    """Copies with NaN in the rows of runs whose state is no longer finite."""
    finite: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(states), axis=1)
    return np.where(finite[:, None], sums, np.nan)
