"""A hybrid system run on CasADi's own machine, step by step from Python."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.codegen.machine import casadi_function
from mrac_design.simulation.emission import simplified
from mrac_design.simulation.event_search import (
    TOLERANCE,
    TURNS_AT_ONE_INSTANT,
    decide_program,
    judge_program,
    registers,
)
from mrac_design.simulation.method import Method
from mrac_design.simulation.schedule import Schedule
from mrac_design.simulation.stepping import (
    Watched,
    finished,
    prepare,
    prepare_watched,
    step_program,
)
from mrac_design.simulation.system import MODES, HybridSystem


class Interpreter:
    """Runs parts of schedules; holds what is the same for all of them."""

    def __init__(self, system: HybridSystem, method: Method, *, input_powers: int) -> None:
        self._outputs = system.outputs.size
        watched = prepare_watched(system) if system.events else None
        rate = prepare(system.rate) if watched is None else watched.rate
        output = prepare(system.output)
        self._rate_setup = casadi_function(rate.setup, "rate_setup")
        self._output_setup = casadi_function(output.setup, "output_setup")
        self._output = casadi_function(finished(output.body), "output")
        self._update = simplified(system.update) if system.update is not None else None
        step = step_program(system, rate, method, input_powers, watched=watched)
        self._step = casadi_function(step, "step")
        self._location = None if watched is None else _Location(system, watched, self._step)

    def run(
        self,
        schedule: Schedule,
        part: slice,
        coefficients: FloatArray,
        parameters: FloatArray,
        state: FloatArray,
        held: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Outputs and events of the part; `state` and `held` are advanced in place."""
        x, z, nothing = ca.DM(state), ca.DM(held), ca.DM()
        prepared = self._rate_setup(nothing, nothing, nothing, parameters)
        ready = self._output_setup(nothing, nothing, nothing, parameters)
        rows: list[FloatArray] = []
        events: list[tuple[float, float, float]] = []
        for i in range(*part.indices(schedule.length.size)):
            segment = coefficients[schedule.segment[i]]
            if schedule.updates[i] or schedule.records[i]:
                inputs = _polynomial(segment, schedule.offset[i])
                if schedule.updates[i] and self._update is not None:
                    z = self._update(x, z, inputs, parameters)
                if schedule.records[i]:
                    rows.append(self._output(x, z, inputs, parameters, ready).full().ravel())
            h = schedule.length[i] / schedule.substeps[i]
            origin = schedule.start[i] - schedule.offset[i]
            for j in range(schedule.substeps[i]):
                start = schedule.offset[i] + j * h
                if self._location is None:
                    x = self._advanced(x, z, segment, start, h, parameters, prepared)
                else:
                    rest = (segment, start, h, origin, parameters, prepared)
                    x, z = self._location.travel(x, z, *rest, events)
        state[:], held[:] = x.full().ravel(), z.full().ravel()
        return np.array(rows).reshape(len(rows), self._outputs), np.array(events).reshape(-1, 3)

    def _advanced(
        self,
        x: ca.DM,
        z: ca.DM,
        segment: FloatArray,
        time: float,
        h: float,
        parameters: FloatArray,
        prepared: ca.DM,
    ) -> ca.DM:
        return self._step(x, z, segment.ravel(), time, h, parameters, prepared)[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Settled:
    """Memory with the modes that belong to an instant, and what is known there."""

    held: ca.DM
    memory: ca.DM
    """`held`, and behind it what is kept of it."""
    slope: ca.DM
    values: ca.DM


class _Location:
    """Steps that end at every event, as `located_program` takes them."""

    def __init__(self, system: HybridSystem, watched: Watched, step: ca.Function) -> None:
        count = len(system.events)
        self._registers = registers(count)
        self._modes = system.held.slices[MODES]
        self._step = step
        self._hold = casadi_function(watched.hold, "hold")
        self._both = casadi_function(watched.both, "both")
        self._events = casadi_function(watched.events, "events")
        self._judge = casadi_function(judge_program(count), "judge")
        self._decide = casadi_function(decide_program(count), "decide")

    def travel(
        self,
        x: ca.DM,
        z: ca.DM,
        segment: FloatArray,
        start: float,
        h: float,
        origin: float,
        parameters: FloatArray,
        prepared: ca.DM,
        events: list[tuple[float, float, float]],
    ) -> tuple[ca.DM, ca.DM]:
        """State and memory after a step of length h from `start`; events are appended."""
        flat, s = ca.DM(segment.ravel()), start
        r = self._registers.pack(
            {name: 0.0 for name, _ in self._registers.blocks}
            | {"rest": h, "reach": h, "tolerance": h * TOLERANCE}
        )
        past = x
        fixed = (parameters, prepared)
        now = self._settled(x, z, _polynomial(segment, s), fixed, origin + s, events)
        while r[0] > 0:
            y, used = self._step(x, now.memory, flat, s, r[1], *fixed, now.slope)
            inputs = _polynomial(segment, s + float(used))
            ahead = self._events(y, now.memory, inputs, *fixed)
            r, moved, accepted, passed, located, given_up = self._decide(
                r, now.values, ahead, now.held[self._modes], used
            )
            r = r.full().ravel()
            past = y if passed else past
            x = past if located else y if accepted else x
            s += float(moved)
            if given_up:
                events.append((origin + s, -1.0, 0.0))
                return x * np.nan, now.held
            if moved > 0:
                inputs = _polynomial(segment, s)
                now = self._settled(x, now.held, inputs, fixed, origin + s, events)
        return x, now.held

    def _settled(
        self,
        x: ca.DM,
        z: ca.DM,
        inputs: FloatArray,
        fixed: tuple[FloatArray, ca.DM],
        time: float,
        events: list[tuple[float, float, float]],
    ) -> _Settled:
        for turn in range(TURNS_AT_ONE_INSTANT + 1):
            memory = ca.vertcat(z, self._hold(x, z, inputs, *fixed))
            slope, values = self._both(x, memory, inputs, *fixed)
            following, changed = self._judge(values, z[self._modes])
            if not changed or turn == TURNS_AT_ONE_INSTANT:
                break
            before, after = z[self._modes].full().ravel(), following.full().ravel()
            if time > 0:
                events += [(time, float(j), after[j]) for j in np.flatnonzero(before != after)]
            z = ca.DM(z)
            z[self._modes] = following
        return _Settled(held=z, memory=memory, slope=slope, values=values)


def _polynomial(coefficients: FloatArray, s: float) -> FloatArray:
    value = coefficients[:, -1]
    for k in range(coefficients.shape[1] - 2, -1, -1):
        value = value * s + coefficients[:, k]
    return value
