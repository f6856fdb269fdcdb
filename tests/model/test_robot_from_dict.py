"""Robots that are given in Python, by the keys of a robot file."""

import numpy as np
import pytest

from edtk.model.robot_from_dict import RobotFileError, robot_from_dict
from edtk.model.transform import transform

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
        ({"axis": None}, "joints.0.axis", "Field required"),
        ({"colour": 1}, "joints.0.colour", "Extra inputs are not permitted"),
        ({"limits_rad": [0, 1]}, "joints.0", "a revolute joint takes limits_deg, and no other"),
        ({"kind": "prismatic"}, "joints.0", "a prismatic joint takes limits_m"),
        ({"rotation": TURNED, "rpy_deg": [0, 0, 1]}, "joints.0", "one of rpy_deg and rotation"),
        ({"axis": [0, 0, 0]}, None, "joint q1: the axis must be a non-zero vector"),
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
