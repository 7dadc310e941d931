"""The FMU against CasADi's own machine, driven by FMPy as any simulation tool would."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mrac_design.controller.robot_step import RobotStep
from mrac_design.errors import CompilationError, FileError
from mrac_design.export import fmu as fmu_module
from mrac_design.export.fmu import export_fmu
from mrac_design.export.gain_set import robot_fingerprint
from mrac_design.export.gains import document_of, read_gains, robot_step_of
from mrac_design.time_domain import Discrete
from tests.export.gain_sets import nominal_gain_set

fmpy = pytest.importorskip("fmpy")

PERIOD = 1e-3
# FMPy's own simulation is asked for 1e-9; the same operations in the same order give no error.
TOLERANCE = 1e-9


@dataclass
class Exported:
    step: RobotStep
    path: str
    description: object
    folder: str

    def slave(self):
        """The FMU loaded through FMPy, instantiated and initialised at the given inputs."""
        from fmpy.fmi2 import FMU2Slave

        slave = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="controller",
        )
        slave.instantiate()
        return slave

    @property
    def inputs(self) -> int:
        return 2 * self.step.robot.joint_count + 2 * len(self.step.robot.force_axes)

    def references(self, causality: str) -> list[int]:
        return [
            v.valueReference for v in self.description.modelVariables if v.causality == causality
        ]


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Exported:
    if fmu_module.find_compiler() is None:
        pytest.skip("no C compiler")
    path = tmp_path_factory.mktemp("fmu") / "controller.fmu"
    step = robot_step_of(nominal_gain_set(), "d2m2_set_a", Discrete(PERIOD))
    written = export_fmu(step, path, gains=nominal_gain_set())
    assert written.platform in written.remark
    return Exported(
        step, str(path), fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    )


def rows(step: RobotStep, count: int) -> np.ndarray:
    """Measurements about the home posture with force steps, one blow that saturates joints."""
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    t = np.arange(count)[:, None] * PERIOD
    q = step.robot.home + 0.02 * np.sin(15 * t + np.arange(n))
    qd = 0.3 * np.cos(15 * t + np.arange(n))
    force = 1.0 + 0.2 * np.sin(40 * t + np.arange(k))
    force[count // 2 : count // 2 + 2] += 60.0
    reference = np.where(t < 0.05, 1.0, 1.5) + np.zeros(k)
    return np.hstack([q, qd, force, reference])


def reference_run(step: RobotStep, inputs: np.ndarray):
    """Torques and signals of every sample, computed by CasADi's own machine."""
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    state = step.resting_state(inputs[0, 2 * n : 2 * n + k])
    torques, signals = [], []
    for row in inputs:
        parts = np.split(row, [n, 2 * n, 2 * n + k])
        state, torque, signal = step.step(state, *parts, step.parameter_values)
        torques.append(torque.full().ravel())
        signals.append(signal.full().ravel())
    return np.array(torques), np.array(signals)


def test_fmpy_finds_nothing_wrong(exported):
    from fmpy.validation import validate_fmu

    assert validate_fmu(exported.path) == []


def test_simulated_by_fmpy_it_is_our_own_step(exported):
    step, count = exported.step, 200
    inputs = rows(step, count)
    torques, signals = reference_run(step, inputs)
    limit = step.robot.effort_limits
    assert (np.abs(torques) == limit).any(), "the run must saturate somewhere"
    names = [v.name for v in exported.description.modelVariables]
    measured = names[: exported.inputs]
    given = np.zeros(count, dtype=[("time", float), *((name, float) for name in measured)])
    given["time"] = np.arange(count) * PERIOD
    for name, column in zip(measured, inputs.T, strict=True):
        given[name] = column
    outputs = names[exported.inputs : exported.inputs + step.robot.joint_count + step.signals.size]
    result = fmpy.simulate_fmu(
        exported.path,
        start_values=dict(zip(measured, inputs[0], strict=True)),
        input=given,
        output=outputs,
        stop_time=(count - 1) * PERIOD,
        step_size=PERIOD,
        output_interval=PERIOD,
    )
    ours = np.hstack([torques, signals])
    theirs = np.array([[row[name] for name in outputs] for row in result])
    assert len(theirs) == count
    # What a communication step that begins at t computes is seen at its end.
    scale = np.maximum(np.abs(ours).max(axis=0), 1.0)
    assert (np.abs(theirs[1:] - ours[:-1]) / scale).max() <= TOLERANCE
    np.testing.assert_allclose(theirs[0], ours[0], rtol=TOLERANCE, atol=TOLERANCE)


def drive(exported, slave, inputs, sizes):
    """Torques after communication steps of the given sizes, inputs of the sample they begin in."""
    settable = exported.references("input")
    outputs = exported.references("output")
    time, seen = 0.0, []
    for size in sizes:
        row = inputs[min(round(time / PERIOD + 1e-6), len(inputs) - 1)]
        slave.setReal(settable, list(row))
        slave.doStep(time, size)
        time += size
        seen.append(slave.getReal(outputs))
    return np.array(seen)


def start(exported, row):
    slave = exported.slave()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.setReal(exported.references("input"), list(row))
    slave.exitInitializationMode()
    return slave


def test_bits_are_those_of_casadis_machine(exported):
    inputs = rows(exported.step, 60)
    slave = start(exported, inputs[0])
    seen = drive(exported, slave, inputs, [PERIOD] * 60)
    slave.freeInstance()
    assert seen.tobytes() == reference_run(exported.step, inputs)[0].tobytes()


def test_a_step_happens_at_every_sampling_instant_whatever_the_master_does(exported):
    # At rest but for a small step of the reference: no two samples give the same torques.
    n = exported.step.robot.joint_count
    row = np.hstack([exported.step.robot.home, np.zeros(n), np.full(3, 1.0), np.full(3, 1.02)])
    constant = np.tile(row, (40, 1))
    expected = reference_run(exported.step, constant)[0]
    assert len(np.unique(expected, axis=0)) == 40
    # Thirds of a period, whole periods, several at once: 12 + 8 + 20 periods.
    sizes = [PERIOD / 3] * 36 + [PERIOD] * 8 + [4 * PERIOD] * 5
    slave = start(exported, constant[0])
    seen = drive(exported, slave, constant, sizes)
    slave.freeInstance()
    assert seen[-1].tobytes() == expected[39].tobytes()
    assert seen[35].tobytes() == seen[33].tobytes() == expected[11].tobytes()
    assert seen[43].tobytes() == expected[19].tobytes()


def test_a_state_taken_and_put_back_repeats_the_run(exported):
    inputs = rows(exported.step, 40)
    slave = start(exported, inputs[0])
    drive(exported, slave, inputs[:10], [PERIOD] * 10)
    state = slave.getFMUstate()
    stored = slave.serializeFMUstate(state)

    def rest_of_it():
        seen = []
        for i in range(10, 40):
            slave.setReal(exported.references("input"), list(inputs[i]))
            slave.doStep(i * PERIOD, PERIOD)
            seen.append(slave.getReal(exported.references("output")))
        return seen

    first = rest_of_it()
    slave.setFMUstate(state)
    assert rest_of_it() == first
    slave.freeFMUstate(state)
    slave.setFMUstate(slave.deSerializeFMUstate(stored))
    assert rest_of_it() == first
    slave.freeInstance()


def test_parameters_can_be_tuned_and_outputs_cannot_be_set(exported):
    inputs = rows(exported.step, 30)
    names = {v.name: v.valueReference for v in exported.description.modelVariables}
    gains = [reference for name, reference in names.items() if "adaptation_gain" in name]
    slave = start(exported, inputs[0])
    slave.setReal(gains, [0.0] * len(gains))
    drive(exported, slave, inputs, [PERIOD] * 30)
    adapted = [reference for name, reference in names.items() if name.startswith("adapted_gains")]
    start_values = np.tile([*nominal_gain_set().initial_gains, 0.0], 3)
    np.testing.assert_array_equal(slave.getReal(adapted), start_values)
    with pytest.raises(Exception, match="fmi2SetReal"):
        slave.setReal(exported.references("output")[:1], [0.0])
    slave.freeInstance()


def test_a_measurement_that_is_no_number_stops_the_master(exported):
    inputs = rows(exported.step, 2)
    slave = start(exported, inputs[0])
    broken = inputs[1].copy()
    broken[2 * exported.step.robot.joint_count] = np.nan
    slave.setReal(exported.references("input"), list(broken))
    with pytest.raises(Exception, match="fmi2DoStep"):
        slave.doStep(0.0, PERIOD)
    slave.freeInstance()


def test_units_and_starts_are_in_the_description(exported):
    variables = {v.name: v for v in exported.description.modelVariables}
    assert (variables["q[0]"].unit, variables["q[1]"].unit) == ("m", "rad")
    assert (variables["torque[0]"].unit, variables["torque[1]"].unit) == ("N", "N.m")
    assert float(variables["q[2]"].start) == exported.step.robot.home[2]
    assert float(variables["X_b0"].start) == 800.0
    assert variables["X_b0"].unit == "N/m"
    blocks = exported.step.parameters
    starts = [float(variables[name].start) for name in blocks.entry_names]
    assert np.array(starts).tobytes() == exported.step.parameter_values.tobytes()


def test_the_gains_travel_inside(exported, tmp_path):
    with zipfile.ZipFile(exported.path) as archive:
        (tmp_path / "gains.json").write_bytes(archive.read("resources/gains.json"))
        source = archive.read("sources/mrac_controller_fmi2.c").decode()
    assert read_gains(tmp_path / "gains.json") == nominal_gain_set()
    assert document_of(nominal_gain_set())["hash"] in source


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_source_compiles_without_a_warning(exported, compiler, tmp_path):
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    with zipfile.ZipFile(exported.path) as archive:
        source = archive.extract("sources/mrac_controller_fmi2.c", tmp_path)
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    for prefix in ([], ["-DFMI2_FUNCTION_PREFIX=mrac_controller_"]):
        result = subprocess.run(
            [compiler, "-std=c99", *warnings, *prefix, "-c", source, "-o", tmp_path / "x.o"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert result.returncode == 0, result.stderr


@pytest.fixture(scope="module")
def small_step():
    gains = replace(nominal_gain_set(), robot=robot_fingerprint("planar_2r"))
    return gains, robot_step_of(gains, "planar_2r", Discrete(PERIOD))


def test_the_same_controller_gives_the_same_file(small_step, tmp_path):
    gains, step = small_step
    for name in ("a.fmu", "b.fmu"):
        export_fmu(step, tmp_path / name, gains=gains)
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()


def test_without_a_compiler_sources_travel_and_one_sentence_says_so(
    small_step, tmp_path, monkeypatch
):
    gains, step = small_step
    monkeypatch.setattr(fmu_module, "find_compiler", lambda: None)
    written = export_fmu(step, tmp_path / "a.fmu", gains=gains)
    assert written.platform is None
    assert "no C compiler was found" in written.remark
    names = zipfile.ZipFile(written.path).namelist()
    assert "sources/mrac_controller_fmi2.c" in names
    assert not [name for name in names if name.startswith("binaries")]


def test_a_platform_fmi_has_no_name_for_gets_sources(small_step, tmp_path, monkeypatch):
    gains, step = small_step
    monkeypatch.setattr(fmu_module.platform, "machine", lambda: "riscv64")
    written = export_fmu(step, tmp_path / "a.fmu", gains=gains)
    assert written.platform is None
    assert "riscv64" in written.remark


def test_a_compiler_that_fails_leaves_nothing(small_step, tmp_path, monkeypatch):
    gains, step = small_step
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho 'cc: out of order' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    with pytest.raises(CompilationError, match="out of order"):
        export_fmu(step, tmp_path / "a.fmu", gains=gains)
    assert [path.name for path in tmp_path.iterdir()] == ["cc"]


def test_a_place_that_cannot_be_written_is_one_error(small_step, tmp_path):
    gains, step = small_step
    (tmp_path / "a.fmu").mkdir()
    with pytest.raises(FileError, match="cannot be written"):
        export_fmu(step, tmp_path / "a.fmu", gains=gains)
