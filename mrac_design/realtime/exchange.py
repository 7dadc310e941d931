"""What Python and the real-time program hand each other: an experiment, and a record."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np

from mrac_design.errors import RealtimeError
from mrac_design.realtime.experiment import RealtimeExperiment
from mrac_design.realtime.record import RealtimeRecord

_NANOSECOND = 1e-9
_LEAST_TIME_LIMIT = 60.0


def write_experiment(experiment: RealtimeExperiment, path: Path) -> int:
    """Write what the program runs, in the order it reads; returns the number of periods.

    Raises RealtimeError when the file cannot be written.
    """
    schedule, loop = experiment.schedule(), experiment.sampled.loop
    first = np.append(np.flatnonzero(schedule.updates), schedule.length.size)
    held = experiment.start.held  # what the controller is told comes after it
    coefficients = experiment.inputs.coefficients.transpose(1, 0, 2)
    whole = [[first.size - 1, schedule.length.size, coefficients.size]]
    numbers = [
        *((values, np.int64) for values in whole),
        ([experiment.settings.record_period], np.float64),
        (first, np.int64),
        (schedule.start, np.float64),
        (schedule.length, np.float64),
        (schedule.substeps, np.int64),
        (schedule.segment, np.int64),
        (schedule.offset, np.float64),
        (coefficients, np.float64),
        (loop.parameter_values, np.float64),
        (experiment.start.state, np.float64),
        (np.append(held, np.zeros(experiment.plant.held.size - held.size)), np.float64),
        (experiment.resting_force, np.float64),
    ]
    try:
        with path.open("wb") as file:
            for values, kind in numbers:
                file.write(np.ascontiguousarray(values, kind).tobytes())
    except OSError as problem:
        raise RealtimeError(f"{path}: {problem.strerror or problem}") from problem
    return int(first.size - 1)


def run_program(program: Path, experiment: RealtimeExperiment) -> RealtimeRecord:
    """Run the program beside its files and read what it measured.

    Raises RealtimeError, with the program's own words, when it fails or does not end.
    """
    folder = program.parent
    inputs, output = folder / "experiment.bin", folder / "record.bin"
    periods = write_experiment(experiment, inputs)
    limit = _LEAST_TIME_LIMIT + 10.0 * experiment.settings.duration
    try:
        result = subprocess.run(
            [str(program), str(inputs), str(output)],
            capture_output=True, text=True, check=False, timeout=limit,
            env={**os.environ, "LD_BIND_NOW": "1"},  # the dynamic linker has no place in the loop
        )  # fmt: skip
    except subprocess.TimeoutExpired as problem:
        raise RealtimeError(
            f"the real-time program did not end within {limit:.0f} s: the rate is too high for "
            "this machine"
        ) from problem
    except OSError as problem:
        raise RealtimeError(f"{program}: {problem.strerror or problem}") from problem
    if result.returncode != 0:
        words = result.stderr.strip() or f"it ended with status {result.returncode}"
        raise RealtimeError(f"the real-time program failed: {words}")
    facts = json.loads(result.stdout)
    joints = experiment.step.robot.joint_count
    times = np.fromfile(output, np.int64, 3 * periods).reshape(3, periods) * _NANOSECOND
    torque = np.fromfile(output, np.float64, offset=3 * 8 * periods).reshape(periods, joints)
    return RealtimeRecord(
        period=experiment.settings.record_period,
        wake=times[0],
        step=times[1],
        cycle=times[2],
        torque=torque,
        identity=facts["identity"],
        memory_lock=facts["memory_lock"],
        priority=facts["priority"],
        clock_cost=facts["clock_cost_ns"] * _NANOSECOND,
        page_faults=facts["page_faults"],
        preemptions=facts["preemptions"],
    )
