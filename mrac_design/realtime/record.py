"""What a real-time run measures, and what is told about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.export.c_counts import StepCosts
from mrac_design.realtime.machine import MachineDescription


@dataclass(frozen=True, slots=True, kw_only=True)
class TimePercentiles:
    """Times that were met in a share of the periods; each is a time that occurred."""

    p50: float
    """Half of all periods took no longer (s)."""
    p99: float
    """99 % took no longer (s)."""
    p999: float
    """99.9 % took no longer (s)."""
    maximum: float
    """The longest (s)."""

    def in_microseconds(self) -> tuple[str, ...]:
        """Texts for people, µs: p50, p99, p99.9, maximum."""
        times = (1e6 * t for t in (self.p50, self.p99, self.p999, self.maximum))
        return tuple(f"{t:.0f}" if t >= 100 else f"{t:.2g}" for t in times)


def time_percentiles(times: FloatArray) -> TimePercentiles:
    """Percentiles of `times` (s), shape (N,), N ≥ 1, by nearest rank: none is interpolated."""
    p50, p99, p999 = np.quantile(times, [0.5, 0.99, 0.999], method="inverted_cdf")
    return TimePercentiles(
        p50=float(p50), p99=float(p99), p999=float(p999), maximum=float(np.max(times))
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RealtimeRecord:
    """One run of N periods, as the program wrote it down."""

    period: float
    """Period (s)."""
    wake: FloatArray
    """Wake-up latency: from the beginning of the period to the program running (s), shape (N,)."""
    step: FloatArray
    """Duration of the controller's step, two readings of the clock included (s), shape (N,)."""
    cycle: FloatArray
    """From the beginning of the period to the end of all work, the simulated robot's included
    (s), shape (N,)."""
    torque: FloatArray
    """Joint efforts as computed in each period (N·m or N), shape (N, n)."""
    identity: str
    """What the controller says of itself: version and hashes."""
    memory_lock: str
    """Empty when all memory was locked, else why the system refused."""
    priority: str
    """Empty when real-time priority (SCHED_FIFO) was granted, else why the system refused."""
    clock_cost: float
    """Least time between two readings of the clock (s)."""
    page_faults: int
    """Pages of memory that were fetched during the loop."""
    preemptions: int
    """Times the program lost the processor without asking for it during the loop."""

    def __post_init__(self) -> None:
        for name in ("wake", "step", "cycle"):
            object.__setattr__(self, name, readonly(getattr(self, name), (-1,)))
        object.__setattr__(self, "torque", readonly(self.torque, (self.wake.size, -1)))

    @property
    def response(self) -> FloatArray:
        """From the beginning of the period to the torques being there (s), shape (N,)."""
        return readonly(self.wake + self.step)

    @property
    def missed(self) -> int:
        """Periods that ended before their torques were there."""
        return int(np.sum(self.response > self.period))

    @property
    def overrun(self) -> int:
        """Periods whose work, the simulated robot's included, lasted into the next one."""
        return int(np.sum(self.cycle > self.period))


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueAgreement:
    """Torques of the real-time program against those of the simulation."""

    equal: bool
    """Whether every torque has the same bits."""
    largest_difference: float
    """Largest |difference| as a share of the joint's limit (–)."""
    first_difference: float | None
    """Instant of the first other bit (s); None if there is none."""

    def __str__(self) -> str:
        if self.equal:
            return "bit for bit"
        return f"{self.largest_difference:.2g} of the limit, from {self.first_difference:g} s on"


def torque_agreement(
    measured: FloatArray, simulated: FloatArray, *, limits: FloatArray, period: float
) -> TorqueAgreement:
    """Compare torques (N, n), both in N·m or N; `limits` (n,) are the joints' effort limits."""
    given, expected = (np.ascontiguousarray(values) for values in (measured, simulated))
    other = np.any(given.view(np.int64) != expected.view(np.int64), axis=1)
    return TorqueAgreement(
        equal=not other.any(),
        largest_difference=float(np.max(np.abs(given - expected) / limits)),
        first_difference=float(np.argmax(other) * period) if other.any() else None,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RealtimeRun:
    """One sampling rate."""

    rate: float
    """Sampling rate (Hz)."""
    record: RealtimeRecord
    """What was measured."""
    agreement: TorqueAgreement
    """Its torques against the simulation's."""
    costs: StepCosts
    """What a step costs, in numbers that repeat: operations, instructions, stack."""

    def values(self) -> dict[str, Any]:
        """The run's figures as plain data, SI units."""
        record = self.record
        return {
            "rate_Hz": self.rate,
            "periods": record.wake.size,
            "wake_up_latency_s": asdict(time_percentiles(record.wake)),
            "step_time_s": asdict(time_percentiles(record.step)),
            "response_s": asdict(time_percentiles(record.response)),
            "missed_periods": record.missed,
            "overrun_periods": record.overrun,
            "torque": asdict(self.agreement),
            "operations": self.costs.operations,
            "instructions": self.costs.instructions,
            "stack_bytes": self.costs.stack_bytes,
            "counted_with": self.costs.tools,
            "controller": record.identity,
            "memory_locked": record.memory_lock == "",
            "memory_lock_refusal": record.memory_lock or None,
            "real_time_priority": record.priority == "",
            "priority_refusal": record.priority or None,
            "clock_cost_s": record.clock_cost,
            "page_faults": record.page_faults,
            "preemptions": record.preemptions,
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RealtimeReport:
    """All rates of one controller on one machine."""

    scenario: str
    """Name of the scenario."""
    robot: str
    """Name of the robot."""
    controller: str
    """Which of the study's controllers."""
    real: str
    """Floating-point type it computes in."""
    delay: int
    """Samples between a measurement and its torque acting."""
    duration: float
    """Length of each run (s)."""
    machine: MachineDescription
    """Where it was measured."""
    runs: tuple[RealtimeRun, ...]
    """One a rate, in the order they were asked for."""

    def values(self) -> dict[str, Any]:
        """The report as plain data, SI units."""
        return {
            "scenario": self.scenario,
            "robot": self.robot,
            "controller": self.controller,
            "real": self.real,
            "delay_samples": self.delay,
            "duration_s": self.duration,
            "machine": asdict(self.machine),
            "runs": [run.values() for run in self.runs],
        }

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Texts of a table under `TABLE_HEADER`, times in µs."""
        for run in self.runs:
            record, count = run.record, run.costs.instructions
            yield (
                f"{run.rate:g}",
                ", ".join(time_percentiles(record.wake).in_microseconds()),
                ", ".join(time_percentiles(record.step).in_microseconds()),
                f"{record.missed} of {record.wake.size}",
                "not counted" if count is None else f"{count:.0f}",
                str(run.agreement),
            )

    def _repr_markdown_(self) -> str:
        lines = [TABLE_HEADER, ("---",) * len(TABLE_HEADER), *self.rows()]
        table = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        return f"{table}\n\nMeasured on {self.machine}."


TABLE_HEADER = (
    "rate (Hz)",
    "wake-up latency p50, p99, p99.9, max (µs)",
    "step time p50, p99, p99.9, max (µs)",
    "missed periods",
    "instructions a step",
    "torques equal the simulation's",
)
"""Names of the columns of `RealtimeReport.rows`."""
