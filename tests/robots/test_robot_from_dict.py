"""Robots that are given in Python, by the keys of a robot file."""

import numpy as np
import pytest

from edtk.robots.robot_file import RobotFileError, robot_from_dict
from edtk.robots.rotations import transform

JOINT = {"name": "q1", "origin_m": [0, 0, 0.5], "axis": [0, 0, 2], "limits_deg": [-90, 180]}
TURNED = transform(rpy=[0.3, -0.2, 1.0])[:3, :3].tolist()


def robot(**changes):
    """A robot of one joint, some of whose keys are changed; those that are None are left out."""
    joint = {key: value for key, value in (JOINT | changes).items() if value is not None}
    return robot_from_dict({"name": "one", "source": "invented", "joints": [joint]})


def test_limits_in_radians():
    """Radians are taken as they are."""
    assert robot(limits_deg=None, limits_rad=[-0.1, 0.7]).joints[0].limits == (-0.1, 0.7)


def test_base_tool_and_rotations_by_matrix():
    """Base and tool are frames with a position; a matrix stands for three angles."""
    frame = {"position_m": [1, 2, 3], "rotation": TURNED}
    content = {"name": "one", "source": "", "joints": [JOINT], "base": frame, "tool": frame}
    found = robot_from_dict(content)
    for T in (found.base, found.tool):
        np.testing.assert_array_equal(T[:3, :3], TURNED)
        np.testing.assert_array_equal(T[:, 3], [1, 2, 3, 1])


@pytest.mark.parametrize(
    ("changes", "key", "expected"),
    [
        ({"axis": None}, "joints.0.axis", "this key is required: Direction of positive motion"),
        ({"colour": 1}, "joints.0.colour", "unknown key; known are rpy_deg, rotation, name"),
        ({"limits_rad": [0, 1]}, "joints.0", "a revolute joint takes limits_deg, and no other"),
        ({"kind": "prismatic"}, "joints.0", "a prismatic joint takes limits_m"),
        ({"rotation": TURNED, "rpy_deg": [0, 0, 1]}, "joints.0", "one of rpy_deg and rotation"),
        (
            {"kind": "spherical"},
            "joints.0.kind",
            "(got 'spherical'); it is: Whether the",
        ),
        ({"origin_m": [0, 1e200, 0]}, "joints.0.origin_m.1", "expected at most 1e+06 (got 1e+200)"),
        ({"limits_deg": [0, 1e7]}, "joints.0.limits_deg.1", "(got 10000000.0); it is: Lower and"),
        ({"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "joints.0", "expected orthonormal rows"),
        ({"rotation": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "joints.0", "right-handed"),
        ({"axis": [0, 1e-300, 0]}, "joints.0", "joint q1: the axis has the length 0; expected"),
        ({"axis": [0, 1e-7, 0]}, "joints.0", "joint q1: the axis has the length 1e-07; expected"),
        ({"name": "#1"}, "joints.0", "joint name '#1': expected 1 to 64 letters, digits, blanks"),
        ({"name": ""}, "joints.0", "joint name '': expected 1 to 64"),
        ({"name": " q1"}, "joints.0", "without blanks at either end or 'Unnamed:'"),
        ({"name": "q1\n"}, "joints.0", "joint name 'q1\\n': expected 1 to 64"),
        ({"name": "a;b"}, "joints.0", "signs but # and ;"),
        ({"name": "a\u2028b"}, "joints.0", "joint name 'a\\u2028b': expected 1 to 64"),
        ({"name": "Unnamed: 3"}, "joints.0", "or 'Unnamed:'"),
        ({"name": "x" * 65}, "joints.0", "expected 1 to 64 letters"),
        ({"axis": [0, 0, 0]}, "joints.0", "joint q1: the axis must be a non-zero vector"),
    ],
)
def test_errors_carry_the_key(changes, key, expected):
    """A message begins with the key, and the error has it as data."""
    with pytest.raises(RobotFileError) as caught:
        robot(**changes)
    error = caught.value
    assert (error.where, error.key) == (None, key)
    assert expected in error.message
    assert str(error) == (error.message if key is None else f"{key}: {error.message}")


def test_two_joints_of_one_name_are_refused():
    """The line names the second one's key."""
    content = {"name": "one", "source": "", "joints": [JOINT, JOINT]}
    with pytest.raises(RobotFileError, match=r"^joints\.1\.name: a joint before has the name 'q1'"):
        robot_from_dict(content)


@pytest.mark.parametrize("name", ["Größe 1", "関節", "joint_a1", "shoulder/pan.joint-1", "$x^2$"])
def test_names_of_all_languages_are_allowed(name):
    """Letters of any script, blanks inside and most signs may stand in a joint's name."""
    assert robot(name=name).joint_names == (name,)


def test_the_name_of_the_robot_is_one_line():
    """A title cannot be built from several lines."""
    content = {"name": "one\ntwo", "source": "", "joints": [JOINT]}
    with pytest.raises(RobotFileError, match="name: expected one line, without control characters"):
        robot_from_dict(content)
