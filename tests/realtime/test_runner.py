"""The exported step on the clock: its torques, its counts, and what it does when pressed."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from mrac_design.errors import CompilationError, ParameterError, RealtimeError, SimulationError
from mrac_design.export.c_expressions import FLOAT
from mrac_design.realtime import run_realtime
from mrac_design.realtime.exchange import run_program, write_experiment
from mrac_design.realtime.experiment import simulated_torque
from mrac_design.realtime.program import require_compiler
from mrac_design.realtime.record import torque_agreement
from mrac_design.simulation.sampled_loop import SampledStart
from mrac_design.simulation.sampling_choices import (
    EncoderChoice,
    ForceSensorChoice,
    SampledMeasurement,
)
from tests.realtime.small_scenario import DURATION, small_scenario


def test_torques_are_the_simulations_bit_for_bit(report):
    for run in report.runs:
        assert run.agreement.equal, run.agreement
        assert run.agreement.largest_difference == 0.0
        assert np.all(np.ptp(run.record.torque, axis=0) > 0), "a torque that never moves"


def test_every_period_is_recorded(report):
    for run in report.runs:
        record = run.record
        assert record.period == 1 / run.rate
        assert record.wake.shape == (round(DURATION * run.rate),)
        assert record.torque.shape == (record.wake.size, 2)
        # An absolute sleep never ends early; a cycle holds its step; clocks do not run back.
        assert np.all(record.wake >= 0)
        assert np.all(record.step > 0)
        assert np.all(record.cycle >= record.response)
        assert record.clock_cost > 0
        assert record.page_faults >= 0
        assert "parameters" in record.identity


def test_instructions_are_counted_and_repeat(report):
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    one, two = (run.costs for run in report.runs)
    # Straight-line code: at another rate only numbers differ.
    assert one.instructions == two.instructions > one.operations > 0
    assert report.runs[0].record.identity != report.runs[1].record.identity


def test_measurements_like_a_real_robots(uncounted):
    """Encoders, a slow noisy sensor, two samples of delay: the controller is told just those."""
    sensor = ForceSensorChoice(
        noise=5e-3, bias=0.1, resolution=5e-3, decimation=2,
        mode_frequency=400.0, mode_damping=0.02, seed=1,
    )  # fmt: skip
    sampling = SampledMeasurement(
        rate=1000.0,
        delay=2,
        force_sensor=sensor,
        encoder=EncoderChoice(counts_per_turn=2.0**20, velocity_cutoff=1000.0),
    )
    scenario = replace(small_scenario(), sampling=sampling)
    report = run_realtime(scenario, rates=[2000.0])
    assert report.delay == 2
    assert report.runs[0].agreement.equal, report.runs[0].agreement


def test_float_says_how_far_it_is(uncounted):
    agreement = run_realtime(small_scenario(), rates=[1000.0], number=FLOAT).runs[0].agreement
    assert not agreement.equal
    # 6e-8 of relative rounding in some hundred operations, with cancellation: measured 5e-6.
    assert 1e-9 < agreement.largest_difference < 1e-4


def test_comparison_sees_another_start(experiment, own_program):
    """One joint a nanoradian away: the program follows, and only its own simulation agrees."""
    state = np.array(experiment.start.state)
    state[0] += 1e-9
    moved = replace(experiment, start=SampledStart(state=state, held=experiment.start.held))
    record = run_program(own_program, moved)
    limits = experiment.step.robot.effort_limits
    there = torque_agreement(
        record.torque, simulated_torque(moved), limits=limits, period=record.period
    )
    here = torque_agreement(
        record.torque, simulated_torque(experiment), limits=limits, period=record.period
    )
    assert there.equal
    assert not here.equal
    assert here.first_difference == 0.0


def test_overload_changes_no_torque(experiment, own_program, tmp_path):
    """A period of a nanosecond: every period is missed, and every torque the same."""
    inputs, output = tmp_path / "inputs", tmp_path / "record"
    periods = write_experiment(experiment, inputs)
    content = bytearray(inputs.read_bytes())
    content[24:32] = np.float64(1e-9).tobytes()  # after three counts
    inputs.write_bytes(content)
    subprocess.run([own_program, inputs, output], check=True, capture_output=True, timeout=60)
    response = np.fromfile(output, np.int64, 2 * periods).reshape(2, periods).sum(axis=0)
    assert np.all(response > 1)
    torque = np.fromfile(output, np.float64, offset=24 * periods).reshape(periods, -1)
    np.testing.assert_array_equal(torque, simulated_torque(experiment))


def test_nothing_is_allocated_in_the_loop(program):
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("nm is not installed")
    listing = subprocess.run(
        [nm, "-u", program.parent / "realtime_loop.o"], capture_output=True, text=True, check=True
    )
    wanted = set(listing.stdout.split()) - {"U", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    moving = {"memcpy", "memmove", "memset"}
    assert wanted - moving == {"run", "mrac_step", "clock_gettime", "clock_nanosleep"}


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("unit", ["realtime_loop.c", "realtime_main.c"])
def test_strict_compilers_accept_it(program, compiler, unit):
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    folder = program.parent
    words = [
        compiler, "-std=gnu99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fsyntax-only",
        f"-I{folder / 'controller'}", folder / unit,
    ]  # fmt: skip
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


def test_refused_privileges_are_told_and_do_not_matter(experiment, program, tmp_path):
    tools = [shutil.which(name) for name in ("setpriv", "prlimit")]
    if None in tools:
        pytest.skip("setpriv and prlimit are not installed")
    script = tmp_path / "realtime"
    script.write_text(
        f"#!/bin/sh\nexec {tools[0]} --bounding-set -ipc_lock,-sys_nice "
        f'{tools[1]} --memlock=0 --rtprio=0 {program} "$@"\n'
    )
    script.chmod(0o755)
    try:
        record = run_program(script, experiment)
    except RealtimeError as problem:
        pytest.skip(f"privileges cannot be dropped here: {problem}")
    assert record.memory_lock == record.priority == "Operation not permitted"
    np.testing.assert_array_equal(record.torque, simulated_torque(experiment))


def test_no_compiler_is_one_clear_sentence(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(RealtimeError, match=r"install gcc or clang, or name one .* CC$"):
        run_realtime(small_scenario(), rates=[1000.0])


def test_other_systems_are_told_that_linux_is_needed(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(RealtimeError, match="needs Linux and its clock; this is darwin"):
        require_compiler()


def test_a_compiler_that_fails_is_named(monkeypatch):
    monkeypatch.setenv("CC", str(shutil.which("false")))
    with pytest.raises(CompilationError, match="false"):
        run_realtime(small_scenario(), rates=[1000.0])


def test_bad_rates_are_refused():
    for rates in ([], [0.0], [float("nan")], [5.0]):
        with pytest.raises(ParameterError, match="rate"):
            run_realtime(small_scenario(), rates=rates)


def test_torques_that_are_no_numbers_stop_the_program(experiment, own_program):
    broken = replace(
        experiment,
        start=SampledStart(
            state=np.full_like(experiment.start.state, np.nan), held=experiment.start.held
        ),
    )
    with pytest.raises(RealtimeError, match="torques of period 0 are not finite"):
        run_program(own_program, broken)
    with pytest.raises(SimulationError):
        simulated_torque(broken)


def test_a_program_that_cannot_run_is_named(experiment, tmp_path):
    with pytest.raises(RealtimeError, match=r"realtime: No such file"):
        run_program(tmp_path / "realtime", experiment)


def test_a_cut_off_experiment_is_noticed(experiment, own_program, tmp_path):
    inputs = tmp_path / "inputs"
    write_experiment(experiment, inputs)
    inputs.write_bytes(inputs.read_bytes()[:-8])
    result = subprocess.run(
        [own_program, inputs, tmp_path / "record"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    assert result.stderr == "the experiment is cut off\n"
    assert not (tmp_path / "record").exists()
