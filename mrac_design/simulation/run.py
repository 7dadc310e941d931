"""Running a hybrid system over a schedule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import SimulationError
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.engine import Engine
from mrac_design.simulation.schedule import Schedule, build_schedule
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.trajectory import Occurrence

Progress = Callable[[float], None]
"""Called with the finished fraction of a run, 0 to 1; may raise to cancel it."""

_PART = 20_000
"""Integration steps between two looks at progress and interruptions: about 20 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How a run is stepped and recorded."""

    duration: float
    """Length of the run (s)."""
    step: float
    """Largest integration step (s)."""
    record_period: float
    """Time between recorded samples (s)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Raw outputs of a run, one row a recording instant."""

    time: FloatArray
    """Recording instants (s), shape (N,)."""
    outputs: FloatArray
    """Outputs in the system's layout, shape (N, outputs.size)."""
    final_state: FloatArray
    """State at the end of the run, shape (state.size,)."""
    final_held: FloatArray
    """Held memory at the end of the run, shape (held.size,): where another run goes on."""
    events: tuple[Occurrence, ...] = ()
    """Events met, in order of time."""


def run(
    engine: Engine,
    system: HybridSystem,
    *,
    inputs: PiecewisePolynomial,
    parameters: FloatArray,
    initial_state: FloatArray,
    settings: RunSettings,
    initial_held: FloatArray | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Integrate `system` on `engine` from `initial_state` under `inputs`.

    `initial_held` is the memory before the first update; without it the memory starts at zero.
    Raises SimulationError, naming the instant, when a recorded output is no longer finite or
    events follow one another without end.
    """
    schedule = build_schedule(
        inputs,
        duration=settings.duration,
        step=settings.step,
        record_period=settings.record_period,
        sampling_period=system.sampling_period,
        spanning=engine.spanning,
    )
    coefficients = np.ascontiguousarray(inputs.coefficients.transpose(1, 0, 2))
    state, held = np.array(initial_state, dtype=float), np.zeros(system.held.size)
    if initial_held is not None:
        held[:] = initial_held
    time = schedule.start[schedule.records]
    rows: list[FloatArray] = []
    events: list[Occurrence] = []
    for first, last in pairwise(_edges(schedule)):
        records = engine.run(schedule, slice(first, last), coefficients, parameters, state, held)
        rows.append(records.outputs)
        events += _occurrences(system, records.events)
        _require_finite(rows, time, state)
        if progress is not None:
            progress(last / schedule.length.size)
    # Records are megabytes: no copy of what is already whole.
    outputs = rows[0] if len(rows) == 1 else np.vstack(rows)
    outputs.setflags(write=False)
    return Recording(
        time=readonly(time),
        outputs=outputs,
        final_state=readonly(state),
        final_held=readonly(held),
        events=tuple(events),
    )


def _edges(schedule: Schedule) -> NDArray[np.int64]:
    """Intervals that parts of a run begin with, and the end; none cuts a step."""
    parts = max(1, int(schedule.substeps.sum()) // _PART)
    beginnings = np.append(np.flatnonzero(schedule.substeps), schedule.length.size)
    return beginnings[np.linspace(0, beginnings.size - 1, parts + 1).astype(int)]


def _occurrences(system: HybridSystem, rows: FloatArray) -> list[Occurrence]:
    found: list[Occurrence] = []
    for time, number, mode in rows.tolist():
        if number < 0:
            last = f" ({found[-1].event.name} {found[-1].change})" if found else ""
            raise SimulationError(
                f"too many events follow one another near t = {time:.6g} s{last}: the loop "
                "chatters between two modes and cannot be simulated as it is"
            )
        event = system.events[int(number)]
        found.append(Occurrence(time=time, event=event, rises=mode > 0))
    return found


def _require_finite(rows: list[FloatArray], time: FloatArray, state: FloatArray) -> None:
    if np.isfinite(rows[-1]).all() and np.isfinite(state).all():
        return
    finite: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(rows[-1]), axis=1)
    done = sum(len(part) for part in rows[:-1])
    index = done + (int(np.argmin(finite)) if not finite.all() else len(finite) - 1)
    raise SimulationError(
        f"the simulation left the range of finite numbers near t = {time[index]:.4g} s: the loop "
        "is unstable, or the integration step is too long for it"
    )
