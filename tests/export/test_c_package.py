"""The exported C against the simulated controller, bit for bit, and against strict compilers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.controller.robot_step import RobotStep
from mrac_design.errors import FileError
from mrac_design.export import c_counts, c_package
from mrac_design.export.c_expressions import DOUBLE, FLOAT, REAL_TYPES, RealType, operation_count
from mrac_design.export.c_package import CPackage, export_c_package
from mrac_design.export.c_selftest import build_self_test as self_test_of
from mrac_design.export.c_selftest import evaluate_in
from mrac_design.motion.signal import PiecewisePolynomial, quintic_hermite, stack
from mrac_design.robot import inertial_parameters
from mrac_design.simulation.contact import LinearSpring
from mrac_design.simulation.encoder import ExactJoints
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.friction import Frictionless
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.sampled_loop import (
    ComputationalDelay,
    build_sampled_loop,
    resting_start,
)
from mrac_design.simulation.sensor import ForceSensor, UniformQuantiser, gaussian_noise
from mrac_design.simulation.tableau import RK4
from tests.export.c_harness import Controller, build_self_test, command, tool
from tests.robot_steps import STIFFNESS, dynamics_of, robot_step

ROBOT = "d2m2_set_a"


def export(step: RobotStep, folder: Path, number: RealType = DOUBLE) -> CPackage:
    return export_c_package(step, folder, number=number, gains_hash="ab" * 32, title="A controller")


@pytest.fixture(scope="module")
def packages(tmp_path_factory) -> dict[str, CPackage]:
    folder = tmp_path_factory.mktemp("packages")
    return {
        name: export(robot_step(ROBOT), folder / name, number)
        for name, number in REAL_TYPES.items()
    }


@pytest.fixture(scope="module")
def double(packages) -> Controller:
    return Controller.load(robot_step(ROBOT), packages["double"].directory, DOUBLE)


@pytest.fixture(scope="module")
def single(packages) -> Controller:
    return Controller.load(robot_step(ROBOT), packages["float"].directory, FLOAT)


class SimulatedRun:
    """What a simulated controller was given and gave over 3 s; saturated in part."""

    def __init__(self) -> None:
        step, dynamics = robot_step(ROBOT), dynamics_of(ROBOT)
        home, end = dynamics.description.home, 3.0
        t = np.linspace(0.0, end, 301)
        w = 2 * np.pi * 1.2
        wave = 4e-3 * np.array([np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)])
        heart = quintic_hermite(t, *(np.tile(part, (3, 1)) for part in wave))
        tip = dynamics.task_position(home).full().ravel()[:3]
        reference = PiecewisePolynomial(
            breakpoints=np.array([0.0, 0.5, 1.5, end]),
            coefficients=np.tile(np.array([1.0, 2.0, 1.0])[None, :, None], (3, 1, 1)),
        )
        noise = gaussian_noise(deviation=[5e-3] * 3, period=1e-3, duration=end, seed=1)
        inputs = stack(heart.shifted(tip - 1.0 / STIFFNESS), reference, noise)
        sampled = build_sampled_loop(
            dynamics,
            step,
            contact=LinearSpring(STIFFNESS),
            friction=Frictionless(),
            delay=ComputationalDelay(1),
            sensor=ForceSensor(decimation=2, quantiser=UniformQuantiser(resolution=5e-3)),
            joints=ExactJoints(),
        )
        loop = sampled.loop
        self.parameters = step.parameters.pack(
            step.parameters.split(np.array(step.parameter_values))
            | {"effort_limit": 0.15 * step.robot.effort_limits}
        )
        start = resting_start(sampled, posture=home, force=np.ones(3), condition_limit=100.0)
        recording = run(
            build_engine(loop.system, RK4, input_powers=inputs.degree + 1),
            loop.system,
            inputs=inputs,
            parameters=loop.system.parameters.pack(
                loop.system.parameters.split(np.array(loop.parameter_values))
                | {"controller": self.parameters}
            ),
            initial_state=start.state,
            initial_held=start.held,
            settings=RunSettings(duration=end, step=2e-4, record_period=1e-3),
        )
        self.outputs = loop.system.outputs.split(np.asarray(recording.outputs))
        given = ("joint_position", "joint_velocity", "measured_force", "force_reference")
        self.rows = np.hstack([self.outputs[name] for name in given])
        self.torque = self.outputs["computed_effort"]
        self.signals = np.hstack([self.outputs[name] for name, _ in step.signals.blocks])


@pytest.fixture(scope="module")
def simulated() -> SimulatedRun:
    return SimulatedRun()


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", REAL_TYPES)
def test_compiles_without_a_warning_and_passes_its_self_test(packages, tmp_path, name, compiler):
    program = build_self_test(packages[name].directory, tmp_path / "selftest", compiler, "-O1")
    result = command(program, "1")
    assert result.returncode == 0, result.stdout
    assert f"gains {'ab' * 32} parameters {packages[name].parameters_hash} {name}" in result.stdout
    assert "microseconds a step" in result.stdout


@pytest.mark.parametrize("name", REAL_TYPES)
def test_is_clean_under_the_sanitizer(packages, tmp_path, name):
    checked = build_self_test(
        packages[name].directory, tmp_path / "checked", "gcc",
        "-fsanitize=undefined,float-divide-by-zero", "-fno-sanitize-recover=all",
    )  # fmt: skip
    result = command(checked)
    assert result.returncode == 0, result.stdout + result.stderr


def test_is_clean_under_valgrind(packages, tmp_path):
    plain = build_self_test(packages["double"].directory, tmp_path / "plain", "gcc", "-g")
    result = command(tool("valgrind"), "--error-exitcode=9", "--leak-check=full", plain)
    assert result.returncode == 0, result.stderr
    assert "ERROR SUMMARY: 0 errors" in result.stderr


def test_self_test_notices_a_wrong_bit(packages, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    for file in packages["double"].directory.glob("mrac_*"):
        (broken / file.name).write_bytes(file.read_bytes())
    code = (broken / "mrac_controller.c").read_text()
    spoilt = re.sub(r"(\.torque_scale = \{)1\.0", r"\g<1>1.0000000000000002", code)
    assert spoilt != code
    (broken / "mrac_controller.c").write_text(spoilt)
    result = command(build_self_test(broken, tmp_path / "selftest", "cc"))
    assert result.returncode == 1
    assert "FAILED" in result.stdout


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_same_bits_as_the_simulated_controller(packages, simulated, compiler):
    step = robot_step(ROBOT)
    controller = Controller.load(step, packages["double"].directory, DOUBLE, compiler)
    torque, signals, _, finite = controller.run(
        simulated.rows, force=np.ones(3), parameters=simulated.parameters
    )
    assert finite
    limit = 0.15 * step.robot.effort_limits
    share = np.mean(np.any(np.abs(simulated.torque) >= limit, axis=1))
    assert 0.01 < share < 0.9, "saturation has to come and go for this test to mean anything"
    np.testing.assert_array_equal(torque, simulated.torque)
    np.testing.assert_array_equal(signals, simulated.signals)


def test_reset_and_init_give_the_state_at_rest(double):
    step = robot_step(ROBOT)
    level = np.array([1.0, 0.3, 2.0])
    _, _, state, _ = double.run(np.zeros((0, 16)), force=level)
    np.testing.assert_array_equal(state, step.resting_state(level))


def test_float_carries_out_the_same_operations(single):
    """Bit for bit what NumPy gives when it rounds every operation to 32 bits."""
    step = robot_step(ROBOT)
    test = self_test_of(step)
    torque, _, final, _ = single.run(test.inputs, force=test.resting_force)
    (state,) = evaluate_in(step.equilibrium, [test.resting_force, step.parameter_values], FLOAT)
    for row, expected in zip(test.inputs, torque, strict=True):
        parts = np.split(row, [5, 10, 13])
        state, own, _ = evaluate_in(step.step, [state, *parts, step.parameter_values], FLOAT)
        np.testing.assert_array_equal(own, expected)
    np.testing.assert_array_equal(final, state)


def test_float_stays_near_double_from_step_to_step(single, double, simulated):
    """A step in float from the state of double, along a simulated run without saturation."""
    step, state = robot_step(ROBOT), robot_step(ROBOT).resting_state(np.ones(3))
    limit, worst = step.robot.effort_limits, np.zeros(5)
    for row in simulated.rows[:1000, None]:
        narrow, *_ = single.run(row, state=state)
        exact, _, state, _ = double.run(row, state=state)
        worst = np.maximum(worst, np.abs(narrow[0] - exact[0]) / limit)
    # Commands of 1e2 m/s² rounded to 6e-8 some ten times, against limits near 1e2 m/s², are
    # 1e-6; cancellation between the terms of a command costs a few times that. Measured 5e-6.
    assert np.all(worst < 2e-5), worst


def test_closed_loop_with_the_exported_code(single, double):
    """The exported controller on a robot simulated here: what `float` costs in newtons."""
    step, dynamics = robot_step(ROBOT), dynamics_of(ROBOT)
    robot, inertia = step.robot, inertial_parameters(step.robot)
    home = dynamics.task_position(robot.home).full().ravel()[:3]
    forces = {}
    for controller in (single, double):
        q, qd = np.array(robot.home), np.zeros(5)
        state, rows = step.resting_state(np.ones(3)), []
        for k in range(400):
            heart = home - 1.0 / STIFFNESS + 2e-3 * np.sin(7.5e-3 * k)
            force = STIFFNESS * (dynamics.task_position(q).full().ravel()[:3] - heart)
            inputs = np.concatenate([q, qd, force, np.full(3, 1.0 if k < 100 else 1.5)])
            torque, _, state, _ = controller.run(inputs[None, :], state=state)
            J = dynamics.task_jacobian(q).full()[:3]
            effort = torque[0] - J.T @ force
            qd = qd + 1e-3 * dynamics.forward_dynamics(q, qd, effort, inertia).full().ravel()
            q = q + 1e-3 * qd
            rows.append(force)
        forces[controller.number.name] = np.array(rows)
    difference = np.abs(forces["float"] - forces["double"])
    # The force is measured, so it does not suffer from the posture's rounding: an acceleration
    # wrong by 1e-3 m/s² moves the tip by 1e-3/300² m, 1e-5 N. Measured 1.2e-6 N.
    assert 0.0 < difference.max() < 1e-5
    assert np.all(np.abs(forces["double"][-1] - 1.5) < 0.1)


def test_nan_becomes_nan_and_not_full_torque(double):
    row = self_test_of(robot_step(ROBOT)).inputs[:1].copy()
    row[0, 10] = np.nan
    torque, _, _, finite = double.run(row, force=np.ones(3))
    assert not finite
    assert np.any(np.isnan(torque))
    assert not np.any(np.abs(torque) == robot_step(ROBOT).robot.effort_limits)


@pytest.mark.parametrize("name", REAL_TYPES)
def test_instruction_count_does_not_depend_on_the_data(packages, tmp_path, name):
    valgrind, compiler = tool("valgrind"), tool("cc")
    folder, count = packages[name].directory, packages[name].costs.instructions
    assert count is not None
    calm = (folder / "mrac_selftest_vectors.h").read_text()
    random = np.random.default_rng(1).uniform(-1.0, 1.0, (64, 16))
    wild = random * np.repeat([3.0, 5.0, 50.0, 50.0], [5, 5, 3, 3])
    rows = "\n".join(f"{{{', '.join(map(REAL_TYPES[name].literal, row))}}}," for row in wild)
    other = re.sub(r"(test_inputs[^{]*\{).*?\n\};", rf"\g<1>\n{rows}\n}};", calm, flags=re.DOTALL)
    assert other != calm
    flags = ("-O2", "-std=c99", "-ffp-contract=off")
    unit = tmp_path / "controller.o"
    assert command(compiler, *flags, "-c", folder / "mrac_controller.c", "-o", unit).returncode == 0
    (tmp_path / "mrac_selftest_vectors.h").write_text(other)
    main, program = tmp_path / "mrac_selftest.c", tmp_path / "selftest"
    main.write_bytes((folder / main.name).read_bytes())
    built = command(compiler, *flags, f"-I{folder}", main, unit, "-o", program, "-lm")
    assert built.returncode == 0, built.stderr
    result = command(
        valgrind, "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=mrac_step",
        f"--callgrind-out-file={tmp_path / 'counts'}", program,
    )  # fmt: skip
    assert result.returncode == 1, "these inputs give other torques than the self-test's"
    collected = int(re.search(r"Collected\s*:\s*(\d+)", result.stderr).group(1))
    assert collected == 64 * count


def test_needs_only_the_mathematics_library(packages, tmp_path):
    nm = tool("nm")
    compiled = tmp_path / "controller.o"
    source = packages["double"].directory / "mrac_controller.c"
    assert command(tool("cc"), "-std=c99", "-O2", "-c", source, "-o", compiled).returncode == 0
    wanted = set(command(nm, "-u", compiled).stdout.split()) - {"U"}
    # memcpy is how a compiler may copy a struct; floor may be instructions of its own.
    assert wanted <= {"floor", "memcpy", "_GLOBAL_OFFSET_TABLE_"}, wanted


def test_cmake_builds_and_tests_it(packages, tmp_path):
    cmake, ctest = tool("cmake"), tool("ctest")
    tool("cc")
    folder = packages["double"].directory
    for words in (
        (cmake, "-S", folder, "-B", tmp_path),
        (cmake, "--build", tmp_path),
        (ctest, "--test-dir", tmp_path),
    ):
        result = command(*words)
        assert result.returncode == 0, result.stdout + result.stderr


def test_readme_tells_what_the_structs_take(packages):
    for name, package in packages.items():
        header = (package.directory / "mrac_controller.h").read_text()
        size = REAL_TYPES[name].dtype.itemsize
        for struct, told in (
            ("state", package.state_bytes),
            ("parameters", package.parameter_bytes),
        ):
            body = re.search(rf"typedef struct \{{([^}}]*)\}} mrac_{struct};", header).group(1)
            members = re.findall(r"mrac_real \w+(?:\[(\d+)\])?;", body)
            assert told == size * sum(int(length or 1) for length in members)
            assert f"{told} bytes" in (package.directory / "README.md").read_text()
        assert "never published" in header, "the robot's provenance has to show"


def test_without_a_compiler_operations_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(c_counts, "find_compiler", lambda: None)
    package = export(robot_step("planar_2r"), tmp_path / "package")
    assert package.costs.instructions is None
    assert package.costs.operations == operation_count(robot_step("planar_2r").step)
    readme = (tmp_path / "package" / "README.md").read_text()
    assert "counted on the expression graph" in " ".join(readme.split())
    assert "no C compiler was found" in " ".join(readme.split())


def test_hash_tells_parameters_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(c_counts, "find_compiler", lambda: None)
    one = export(robot_step("planar_2r"), tmp_path / "one")
    again = export(robot_step("planar_2r"), tmp_path / "again")
    other = export(robot_step("planar_2r", period=5e-4), tmp_path / "other")
    assert one.parameters_hash == again.parameters_hash != other.parameters_hash
    for file in one.directory.iterdir():
        assert file.read_bytes() == (again.directory / file.name).read_bytes()


def test_other_files_are_never_touched(tmp_path, monkeypatch):
    monkeypatch.setattr(c_counts, "find_compiler", lambda: None)
    step = robot_step("planar_2r")
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "README.md").write_text("mine")
    with pytest.raises(FileError, match="new or an empty folder"):
        export(step, foreign)
    with pytest.raises(FileError, match="is a file"):
        export(step, foreign / "README.md")
    assert (foreign / "README.md").read_text() == "mine"
    package = tmp_path / "package"
    export(step, package)
    (package / "notes.txt").write_text("mine")
    export(step, package, FLOAT)
    assert (package / "notes.txt").read_text() == "mine"
    assert "typedef float mrac_real;" in (package / "mrac_controller.h").read_text()


def test_failure_leaves_nothing_behind(tmp_path, monkeypatch):
    def full_disk(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(c_counts, "find_compiler", lambda: None)
    monkeypatch.setattr(c_package, "publish_folder", full_disk)
    with pytest.raises(FileError, match="No space left on device"):
        export(robot_step("planar_2r"), tmp_path / "package")
    assert list(tmp_path.iterdir()) == []


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_literals_read_back(value):
    text = DOUBLE.literal(value)
    assert float(text) == value
    assert "." in text
    narrow = FLOAT.literal(value)
    with np.errstate(over="ignore"):
        rounded = np.float32(value)
    if np.isfinite(rounded):
        assert narrow.endswith("f")
        assert np.float32(narrow[:-1]) == rounded
    else:
        assert narrow == ("INFINITY" if value > 0 else "-INFINITY")
