"""Robots as data: what is built in, and what is said of files that are wrong."""

import numpy as np
import pytest

from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import RobotFileError

GOOD = """
name = "Two"
source = "invented"

[[joints]]
name = "q1"
origin_m = [0.0, 0.0, 0.5]
rpy_deg = [0, 90, 0]
axis = [0, 0, 2]
limits_deg = [-90, 180]

[[joints]]
name = "slide"
kind = "prismatic"
origin_m = [0.0, 0.0, 0.0]
axis = [1, 0, 0]
limits_m = [0.0, 0.25]
"""

WRONG = {
    "bad TOML": ("name = ", "name ", "line 2"),
    "unknown key of a joint": (
        "axis = [0, 0, 2]",
        "axis = [0, 0, 2]\ncolour = 1",
        "joints.0.colour",
    ),
    "unknown key of the robot": ('source = "invented"', 'source = "invented"\nmass = 1', "mass"),
    "missing key": ('source = "invented"', "", "source"),
    "no joints": (GOOD, 'name = "x"\nsource = "y"\njoints = []', "joints"),
    "limits of the wrong kind": (
        "limits_deg = [-90, 180]",
        "limits_m = [-1, 1]",
        "a revolute joint takes limits_deg",
    ),
    "prismatic in degrees": (
        "limits_m = [0.0, 0.25]",
        "limits_deg = [0, 1]",
        "a prismatic joint takes limits_m",
    ),
    "both limits": (
        "limits_m = [0.0, 0.25]",
        "limits_m = [0.0, 0.25]\nlimits_deg = [0, 1]",
        "no other limits",
    ),
    "no limits": ("limits_m = [0.0, 0.25]", "", "a prismatic joint takes limits_m"),
    "zero axis": (
        "axis = [0, 0, 2]",
        "axis = [0, 0, 0]",
        "joint q1: the axis must be a non-zero vector",
    ),
    "short axis": ("axis = [0, 0, 2]", "axis = [0, 1]", "joints.0.axis"),
    "infinite origin": (
        "origin_m = [0.0, 0.0, 0.5]",
        "origin_m = [0.0, 0.0, inf]",
        "joints.0.origin_m",
    ),
    "nan limit": ("limits_deg = [-90, 180]", "limits_deg = [nan, 180]", "joints.0.limits_deg"),
    "reversed limits": (
        "[-90, 180]",
        "[180, -90]",
        "joint q1: the lower limit must lie below the upper one",
    ),
    "unknown kind": ('"prismatic"', '"helical"', "joints.1.kind"),
    "repeated name": ('"slide"', '"q1"', "a joint before has the name 'q1' too"),
}


def refusal(name, folder=None):
    """The message of the error, asserted to be one line."""
    with pytest.raises(RobotFileError) as caught:
        load_robot(name, folder)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message


def test_file_becomes_the_robot_that_it_describes(tmp_path):
    """Degrees become radians, metres stay, and a relative path is relative to the folder."""
    (tmp_path / "two.toml").write_text(GOOD)
    robot = load_robot("two.toml", tmp_path)
    assert (robot.name, robot.joint_names, robot.source) == ("Two", ("q1", "slide"), "invented")
    np.testing.assert_allclose(robot.limits, [[-np.pi / 2, 0.0], [np.pi, 0.25]])
    T = robot.forward([0.0, 0.1])
    np.testing.assert_allclose(T[:3, 3], [0.0, 0.0, 0.4], atol=1e-15)
    np.testing.assert_array_equal(load_robot(str(tmp_path / "two.toml")).forward([0.0, 0.1]), T)


@pytest.mark.parametrize("case", WRONG)
def test_wrong_file_is_one_line_that_says_where(tmp_path, case):
    """Each kind of error in a robot file gives one line with the file and the key or joint."""
    old, new, expected = WRONG[case]
    assert old in GOOD
    (tmp_path / "bad.toml").write_text(GOOD.replace(old, new, 1))
    message = refusal("bad.toml", tmp_path)
    assert message.startswith("robot bad.toml: ")
    assert expected in message


def test_unknown_robot_lists_what_there_is():
    """The message for an unknown name lists the built-in robots and mentions files."""
    paths = "or give a path to a .toml, .urdf or .xacro file"
    names = "kuka_kr270, kuka_kr270_compensator, palletiser"
    assert refusal("r2d2") == f"unknown robot 'r2d2'; built in: {names}; {paths}"


def test_absent_file_is_named(tmp_path):
    """A path that does not exist, or is a folder, is one line with the path."""
    (tmp_path / "folder.toml").mkdir()
    for name in ("absent.toml", "folder.toml"):
        assert refusal(name, tmp_path).startswith(f"robot file {tmp_path / name}")


def test_file_that_is_no_text_is_one_line(tmp_path):
    """Bytes that are not UTF-8 are a RobotFileError too."""
    (tmp_path / "binary.toml").write_bytes(b'name = "\xff\xfe"')
    assert "binary.toml" in refusal("binary.toml", tmp_path)


def test_a_study_is_told_from_a_robot(tmp_path):
    """Its keys are not listed as wrong ones; the robot that it names is said."""
    (tmp_path / "study.toml").write_text('robot = "arm.urdf"\n[tool]\nposition_mm = [0, 0, 1]')
    with pytest.raises(RobotFileError, match=r"this is a study; its robot is arm\.urdf; expected"):
        load_robot(str(tmp_path / "study.toml"))
    (tmp_path / "study.toml").write_text('[robot]\nname = "arm"')
    with pytest.raises(RobotFileError, match="this is a study; expected a robot's file"):
        load_robot(str(tmp_path / "study.toml"))


def test_builtin_robot_has_the_published_frames():
    """The KR 270 has six revolute joints, the published limits, and a source of its numbers."""
    robot = load_robot("kuka_kr270")
    assert robot.joint_names == ("q1", "q2", "q3", "q4", "q5", "q6")
    expected = [[-185, -146, -119, -350, -125, -350], [185, 0, 155, 350, 125, 350]]
    np.testing.assert_allclose(np.rad2deg(robot.limits), expected)
    assert "Klimchik" in robot.source
