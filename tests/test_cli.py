"""The command line: what a newcomer types, and what bad input gets."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from mrac_design.cli import app as cli
from mrac_design.resources import models_directory


@pytest.fixture
def mrac(monkeypatch, capfd):
    """Run `mrac` in this process; returns (exit status, standard output, standard error)."""

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["mrac", *arguments])
        status = 0
        try:
            cli.main()
        except SystemExit as end:
            status = int(end.code or 0)
        out, err = capfd.readouterr()
        return status, out, err

    return run


def track(frames: int = 300, **replaced: str) -> str:
    """A synthetic recording of one point p1; `replaced` puts text into a row's z value."""
    t = np.arange(frames) / 25
    rows = ["frame,p1_x_mm,p1_y_mm,p1_z_mm"]
    for i, s in enumerate(t):
        z = replaced.get(f"row{i}", f"{2 * np.cos(2 * np.pi * s):.6f}")
        rows.append(f"{i},{np.sin(2 * np.pi * s):.6f},{np.sin(np.pi * s):.6f},{z}")
    return "\n".join(rows) + "\n"


MOTION = ("--point", "p1", "--frame-rate", "25")


def test_simulate_prints_errors_and_writes_the_run(mrac, tmp_path):
    motion = tmp_path / "track.csv"
    motion.write_text(track())
    out = tmp_path / "out"
    status, text, _ = mrac(
        "simulate",
        "--motion",
        str(motion),
        *MOTION,
        "--duration",
        "1.5",
        "--out",
        str(out),
        "--json",
    )
    assert status == 0
    values = json.loads(text)
    assert set(values["metrics"]) == {"frozen", "adaptive", "adaptive_inverse"}
    assert values == json.loads((out / "values.json").read_text())
    archive = np.load(out / "adaptive.npz")
    assert archive["force"].shape == (1500, 3)
    assert json.loads(str(archive["units"]))["force"] == "N"


def test_design_prints_gains_poles_and_margins(mrac):
    status, text, _ = mrac("design", "--json")
    result = json.loads(text)
    assert status == 0
    # r1 = 2ξω + ao − K2 with the scenario's numbers.
    assert result["gains"]["r1"]["value"] == pytest.approx(1450.0, rel=1e-12)
    assert result["residual"] <= 1e-12
    assert mrac("design")[0] == 0


def test_check_model_names_what_the_robot_is(mrac):
    status, text, _ = mrac("check-model", "d2m2_set_a", "--json")
    assert status == 0
    assert json.loads(text)["jacobian_condition_at_home"] == pytest.approx(6.7, abs=0.05)
    assert mrac("check-model", "planar_2r")[0] == 0


def test_an_interruption_is_one_sentence(mrac, monkeypatch):
    def interrupted(*arguments, **choices):
        raise KeyboardInterrupt

    monkeypatch.setattr("mrac_design.study.run_study", interrupted)
    status, text, error = mrac("simulate")
    assert (status, text) == (130, "")
    assert error.strip() == "interrupted; nothing half-written was left behind"


COMMANDS = (
    "report", "simulate", "design", "check-model", "export", "certify", "verify", "stability",
    "realtime", "ensemble", "compare", "drift", "paper", "tune",
)  # fmt: skip


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_every_command_explains_itself(mrac, command):
    status, text, _ = mrac(*command, "--help")
    assert status == 0
    assert "Usage" in text
    assert len(text.splitlines()) > 5


BAD_TRACKS = {
    "empty": ("", (), "track.csv"),
    "nan": (track(row7="nan"), (), "track.csv"),
    "text": (track(row7="oops"), (), "track.csv"),
    "too short": (track(frames=20), (), "track.csv"),
    "wrong column": (track(), ("--point", "p9"), "track.csv"),
    "frame rate 0": (track(), ("--frame-rate", "0"), "track.csv"),
    "cutoff above Nyquist": (track(), ("--cutoff", "20"), "cutoff"),
}


@pytest.mark.parametrize("case", BAD_TRACKS)
@pytest.mark.parametrize("command", ["simulate", "report"])
def test_a_bad_recording_is_one_clear_error(mrac, tmp_path, case, command):
    content, extra, names = BAD_TRACKS[case]
    motion, out = tmp_path / "track.csv", tmp_path / "out"
    motion.write_text(content)
    _refused(
        mrac, out, command, "--motion", str(motion), *MOTION, *extra, "--out", str(out),
        names=names,
    )  # fmt: skip


def test_a_missing_recording_is_one_clear_error(mrac, tmp_path):
    out = tmp_path / "out"
    _refused(
        mrac, out, "simulate", "--motion", "nowhere.csv", "--out", str(out), names="nowhere.csv"
    )


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (("compare", "--motion", "nowhere.csv"), "nowhere.csv"),
        (("paper", "--motion", "nowhere.csv"), "nowhere.csv"),
        (("stability", "--motion", "nowhere.csv"), "nowhere.csv"),
        (("stability", "--k2", "-1"), "velocity gain K2 = -1"),
    ],
)
def test_the_long_commands_refuse_before_they_start(mrac, tmp_path, arguments, names):
    out = tmp_path / "out"
    error = _refused(mrac, out, *arguments, "--out", str(out), names=names)
    assert "cell" not in error  # told by the command, not by a notebook of the report


ROBOT = (models_directory() / "robots" / "d2m2_set_a.toml").read_text("utf-8")
BAD_ROBOTS = {
    "negative mass": (re.sub(r"mass = 18\.0+", "mass = -18.0", ROBOT), "mass"),
    "misspelt key": (ROBOT.replace("drive_inertia", "drive_inerta", 1), "drive_inertia"),
    "singular start": (re.sub(r"home = 1\.2\b", "home = 0.0", ROBOT), "condition number"),
    "no toml": (ROBOT.replace("[units]", "[units", 1), "line"),
}


@pytest.mark.parametrize("case", BAD_ROBOTS)
def test_a_bad_robot_is_one_clear_error(mrac, tmp_path, case):
    content, names = BAD_ROBOTS[case]
    assert content != ROBOT
    robot, out = tmp_path / "robot.toml", tmp_path / "out"
    robot.write_text(content, "utf-8")
    _refused(mrac, out, "simulate", "--robot", str(robot), "--out", str(out), names=names)


def test_an_impossible_inertia_is_one_clear_error(mrac, tmp_path):
    # The second body's Izz raised until the triangle inequality breaks.
    content = ROBOT.replace("0.317887", "0.9")
    assert content != ROBOT
    robot, out = tmp_path / "robot.toml", tmp_path / "out"
    robot.write_text(content, "utf-8")
    _refused(mrac, out, "report", "--robot", str(robot), "--out", str(out), names="triangle")


@pytest.mark.parametrize(
    ("option", "value", "names"),
    [
        ("--k2", "-1", "K2"),
        ("--omega", "0", "bandwidth"),
        ("--omega", "-500", "bandwidth"),
        ("--ao", "nan", "observer"),
        ("--duration", "-3", "duration"),
        ("--stiffness", "0", "stiffness"),
        ("--gain", "-1", "gain"),
        ("--scenario", "nowhere", "nowhere"),
        ("--robot", "nowhere", "nowhere"),
    ],
)
def test_a_bad_number_is_one_clear_error(mrac, tmp_path, option, value, names):
    out = tmp_path / "out"
    _refused(mrac, out, "simulate", option, value, "--out", str(out), names=names)


def _refused(mrac, out, *arguments: str, names: str) -> str:
    status, text, error = mrac(*arguments)
    assert status == 2, (text, error)
    assert text == ""
    assert len([line for line in error.splitlines() if "error:" in line]) == 1, error
    assert "Traceback" not in error
    assert names in error.replace("\n", "")
    assert not out.exists()
    assert not list(out.parent.glob(".mrac-*"))
    return error
