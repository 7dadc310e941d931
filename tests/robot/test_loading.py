"""The robot file reader: what it accepts, and one clear error for each mistake."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mrac_design.errors import ModelFileError
from mrac_design.resources import models_directory
from mrac_design.robot import JointType, available_robots, load_robot
from tests.robot.conftest import ROBOTS

TEXT = (models_directory() / "robots" / "d2m2_set_a.toml").read_text("utf-8")


def test_packaged_robots_load() -> None:
    assert set(ROBOTS) <= set(available_robots())
    for name in available_robots():
        robot = load_robot(name)
        assert robot.name == name
        assert robot.joint_count == robot.task.size


def test_stand_ins_say_so() -> None:
    for name in ("d2m2_set_a", "d2m2_set_b"):
        assert "Stand-in, not identified D2M2 values" in load_robot(name).provenance
    assert "assumed" in load_robot("planar_2r").provenance


def test_set_a_is_read_as_written() -> None:
    robot = load_robot("d2m2_set_a")
    assert [joint.type for joint in robot.joints] == [JointType.PRISMATIC] + [
        JointType.REVOLUTE
    ] * 4
    np.testing.assert_array_equal(robot.home, [0, -0.6, 1.2, np.pi / 2, 0])
    np.testing.assert_array_equal(robot.effort_limits, [3750, 150, 150, 20, 10])
    np.testing.assert_array_equal(robot.motor_torque_limits, [150, 150, 150, 20, 10])
    assert robot.bodies[1].inertia[0, 2] == -0.040385
    assert robot.force_axes == ("X", "Y", "Z")
    assert robot.task.tool_axis == (0, 1)


def test_a_path_is_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(TEXT, "utf-8")
    assert load_robot(path).name == load_robot(str(path)).name == "d2m2_set_a"


MISTAKES = [
    # (text in the file, what it is replaced by, place the error names, what it says)
    ("mass = 13.0", "mass = -13.0", "joint[2].body.mass", "must be positive"),
    ("mass = 13.0", "mass = 0.0", "joint[2].body.mass", "must be positive"),
    ("mass = 13.0", "mas = 13.0", "joint[2].body.mas", 'did you mean "mass"?'),
    ("mass = 13.0\n", "", "joint[2].body.mass", "is missing"),
    ("mass = 13.0", 'mass = "13"', "joint[2].body.mass", "needs a number, got '13'"),
    ("mass = 13.0", "mass = true", "joint[2].body.mass", "needs a number, got True"),
    ("mass = 13.0", "mass = nan", "joint[2].body.mass", "finite"),
    ("mass = 13.0", "mass = inf", "joint[2].body.mass", "finite"),
    ("mass = 13.0", f"mass = 1{'0' * 400}", "joint[2].body.mass", "finite"),
    ("[0.037619, 0.0,", "[0.9, 0.0,", "joint[2].body.inertia", "triangle inequality"),
    ("[0.037619, 0.0,", "[-0.1, 0.0,", "joint[2].body.inertia", "negative principal moment"),
    ("[0.037619, 0.0,", "[0.037619, 0.01,", "joint[2].body.inertia", "must be symmetric"),
    ("[0.037619, 0.0,", "[0.037619,", "joint[2].body.inertia", "3 rows of 3 numbers"),
    ("[0.037619, 0.0,", "[inf, 0.0,", "joint[2].body.inertia[1][1]", "finite"),
    ("[0.2423, 0.0, 0.0288]", "[0.2423, 0.0]", "joint[2].body.centre_of_mass", "3 numbers"),
    ("[0.2423, 0.0, 0.0288]", "0.2423", "joint[2].body.centre_of_mass", "list of 3 numbers"),
    ("d = 0.35", "dd = 0.35", "joint[3].dd", 'did you mean "d"?'),
    ("d = 0.35", "d = 0.35\nzzz = 1", "joint[3].zzz", "known keys: name, type, alpha"),
    ("d = 0.35", 'd = "0.35"', "joint[3].d", "needs a number"),
    ("drive_inertia = 0.01 ", "drive_inertia = -0.01 ", "joint[3].drive_inertia", "zero or pos"),
    ("coulomb_friction = 0.5 ", "coulomb_friction = -0.5 ", "joint[3].coulomb_friction", "zero"),
    ("effort_limit = 20.0", "effort_limit = 0", "joint[4].effort_limit", "must be positive"),
    ('type = "prismatic"', 'type = "linear"', "joint[1].type", '"prismatic" or "revolute"'),
    ('name = "elbow"', 'name = "shoulder"', "joints", "names must differ"),
    ('name = "elbow"', 'name = " "', "joint[3].name", "needs a text"),
    ('length = "m"', 'length = "mm"', "units.length", 'only "m" is read'),
    ('length = "m"\n', "", "units.length", "is missing"),
    ("tip = [", "tips = [", "tool.tips", 'did you mean "tip"?'),
    ("axis = [-1.0, 0.0, 0.0]", "axis = [-1.0, 1.0, 0.0]", "tool_axis", "length 1.41421"),
    ('tool_axis = ["X", "Y"]', 'tool_axis = ["X"]', "task", "must be square"),
    ('tool_axis = ["X", "Y"]', 'tool_axis = ["X", "X"]', "task.tool_axis", "different"),
    ('tool_axis = ["X", "Y"]', 'tool_axis = ["X", "W"]', "task.tool_axis", '"X", "Y", "Z"'),
    ('position = ["X", "Y", "Z"]', "position = []", "task.position", "at least one"),
    ("gravity = [0.0, 0.0, -9.81]", "gravity = -9.81", "gravity", "list of 3 numbers"),
    ("[units]", "[unit]", "unit", 'did you mean "units"?'),
]


@pytest.mark.parametrize(("old", "new", "place", "problem"), MISTAKES)
def test_each_mistake_is_one_clear_error(
    tmp_path: Path, old: str, new: str, place: str, problem: str
) -> None:
    assert old in TEXT
    path = tmp_path / "robot.toml"
    path.write_text(TEXT.replace(old, new), "utf-8")
    with pytest.raises(ModelFileError) as caught:
        load_robot(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {place}: ")
    assert problem in message
    assert "\n" not in message


def test_broken_toml_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(TEXT.replace("mass = 13.0", "mass 13.0"), "utf-8")
    line = 1 + next(i for i, text in enumerate(TEXT.splitlines()) if text == "mass = 13.0")
    with pytest.raises(ModelFileError, match=re.escape(f"line {line}")):
        load_robot(path)


def test_a_misspelt_list_of_joints(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    text = TEXT.replace("[[joint]]", "[[joints]]").replace("[joint.body]", "[joints.body]")
    path.write_text(text, "utf-8")
    with pytest.raises(
        ModelFileError, match=re.escape('joints: unknown key; did you mean "joint"?')
    ):
        load_robot(path)


def test_missing_file_lists_the_robots(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="d2m2_set_a, d2m2_set_b, planar_2r"):
        load_robot(tmp_path / "none.toml")
    with pytest.raises(ModelFileError, match="no such robot file"):
        load_robot("d2m2_set_c")


def test_a_folder_and_binary_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="cannot be read"):
        load_robot(tmp_path)
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelFileError, match="UTF-8"):
        load_robot(path)
    path.write_bytes(b"")
    with pytest.raises(ModelFileError, match="name: is missing"):
        load_robot(path)
    path.write_text("joint = 3\n" + TEXT.split("[[joint]]")[0], "utf-8")
    with pytest.raises(ModelFileError, match=re.escape("one or more [[joint]] tables")):
        load_robot(path)
