"""The body that a joint moves, and how a robot and its file hold it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from chains import mixed_chain

from edtk.robots.joint import Link
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict
from edtk.robots.rotations import transform

FLANGE = transform([0.1, -0.2, 0.3], [0.4, 0.5, -0.6])


@pytest.mark.parametrize("mass", [-1.0, np.nan, np.inf])
def test_a_mass_is_a_number_from_zero_on(mass):
    """No body is lighter than nothing."""
    with pytest.raises(ValueError, match="expected a number from 0 on"):
        Link(mass, np.zeros(3))


@pytest.mark.parametrize("center", [[0.0, 1.0], [0.0, 0.0, np.nan]])
def test_a_centre_is_a_point(center):
    """A centre of mass has three finite coordinates."""
    with pytest.raises(ValueError, match="point of three numbers"):
        Link(1.0, center)


def test_a_robot_has_a_link_for_each_joint_or_none():
    """Links for some joints only would shift the others."""
    robot = mixed_chain(3)
    assert robot.links == ()
    with pytest.raises(ValueError, match="has 2 links; expected one for each of its 3 joints"):
        replace(robot, links=(Link(1.0, np.zeros(3)),) * 2)


def test_links_are_written_and_read():
    """Masses and centres come back bit by bit, and a robot without them has no such keys."""
    rng = np.random.default_rng(3)
    links = tuple(Link(mass, rng.normal(size=3)) for mass in (0.0, 12.5, 1 / 3))
    robot = replace(mixed_chain(3), links=links)
    again = robot_from_dict(json.loads(json.dumps(robot_to_dict(robot))))
    assert [link.mass for link in again.links] == [link.mass for link in links]
    np.testing.assert_array_equal([x.center for x in again.links], [x.center for x in links])
    assert not any("mass_kg" in joint for joint in robot_to_dict(mixed_chain(3))["joints"])


@pytest.mark.parametrize(
    ("change", "key", "message"),
    [
        ({"mass_kg": 2.0}, "joints.1", "expected mass_kg and center_m together"),
        ({"mass_kg": -2.0, "center_m": [0, 0, 0]}, "joints.1.mass_kg", "at least 0"),
        ({"mass_kg": 2.0, "center_m": [0, 0, 0]}, "joints.0", "expected mass_kg for this one too"),
    ],
)
def test_half_a_mass_is_one_line(change, key, message):
    """A mass without its centre, a negative one, and masses of some joints only are refused."""
    content = robot_to_dict(mixed_chain(3))
    content["joints"][1] |= change
    with pytest.raises(RobotFileError) as caught:
        robot_from_dict(content)
    assert caught.value.key == key
    assert message in str(caught.value)


def test_tools_are_given_in_the_frame_of_the_flange():
    """The tool of a robot with a flange is that of the bare robot, shifted by the flange."""
    tool = transform([0.3, 0.0, 0.1], [0.0, 0.2, 0.0])
    bare = mixed_chain(3)
    flanged = replace(bare, flange=FLANGE)
    q = [0.1, 0.2, 0.3]
    expected = bare.with_tool(FLANGE @ tool).forward(q)
    np.testing.assert_array_equal(flanged.with_tool(tool).forward(q), expected)
    again = robot_from_dict(robot_to_dict(flanged.with_tool(tool)))
    np.testing.assert_array_equal(again.forward(q), expected)
    np.testing.assert_array_equal(again.flange, FLANGE)
