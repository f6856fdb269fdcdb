"""Robots as data: what is written is read as the very same robot."""

import json
from dataclasses import replace

import numpy as np
import pytest
from chains import mixed_chain

from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_from_dict, robot_to_dict
from edtk.robots.rotations import transform


def rounded_chain() -> Robot:
    """Angles as a person writes them, with one pitch of 90 degrees."""
    rpy = ([10.0, -20.5, 30.0], [0.0, 90.0, 0.0], [0.0, 0.0, 180.0])
    joints = tuple(
        Joint(
            f"joint {i}",
            transform([0.1, 0.2, 0.3], np.deg2rad(angles)),
            np.array([0.0, 1.0, 0.0]),
            (float(np.deg2rad(-170)), float(np.deg2rad(33.3))),
        )
        for i, angles in enumerate(rpy)
    )
    return Robot("rounded", joints, source="invented")


def turned_by_hand() -> Robot:
    """A rotation matrix that no angles give back, and a negative zero."""
    robot = mixed_chain(2)
    origin = robot.joints[0].origin.copy()
    origin[:3, :3] = origin[:3, :3] @ origin[:3, :3] @ origin[:3, :3]
    origin[1, 3] = -0.0
    return replace(robot, joints=(replace(robot.joints[0], origin=origin), robot.joints[1]))


ROBOTS = {
    "built in": load_robot("kuka_kr270"),
    "with a tool": load_robot("kuka_kr270").with_tool(transform([0.6, 0, 0.1], [0.1, -0.2, 3.0])),
    "mixed": mixed_chain(),
    "rounded": rounded_chain(),
    "turned by hand": turned_by_hand(),
}
each = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


def bits(robot: Robot) -> list[object]:
    """Everything that a robot is, arrays bit by bit."""
    joints = [
        (j.name, j.kind, j.origin.tobytes(), j.axis.tobytes(), np.array(j.limits).tobytes())
        for j in robot.joints
    ]
    return [robot.name, robot.source, robot.base.tobytes(), robot.tool.tobytes(), *joints]


@each
def test_the_robot_that_is_read_is_the_one_that_was_written(robot):
    """Names, kinds and all numbers come back bit by bit, through JSON too."""
    content = robot_to_dict(robot)
    assert bits(robot_from_dict(content)) == bits(robot)
    assert bits(robot_from_dict(json.loads(json.dumps(content)))) == bits(robot)


def test_many_rotations_and_limits():
    """Whatever the axes, angles and limits: nothing is lost."""
    rng = np.random.default_rng(1)
    for _ in range(100):
        limits = tuple(sorted(rng.uniform(-7, 7, size=2).tolist()))
        origin = transform(rng.normal(size=3), rng.uniform(-4, 4, size=3))
        robot = Robot("any", (Joint("q1", origin, rng.normal(size=3), limits),))
        assert bits(robot_from_dict(robot_to_dict(robot))) == bits(robot)


def test_what_a_person_wrote_is_written_again():
    """Round angles and limits in degrees stay round; what is the default is left out."""
    content = robot_to_dict(ROBOTS["rounded"])
    assert set(content) == {"name", "source", "joints"}
    assert [joint["limits_deg"] for joint in content["joints"]] == [[-170.0, 33.3]] * 3
    assert content["joints"][0]["rpy_deg"] == [10.0, -20.5, 30.0]
    built_in = robot_to_dict(ROBOTS["built in"])["joints"]
    assert [joint["limits_deg"] for joint in built_in][:2] == [[-185.0, 185.0], [-146.0, 0.0]]
    assert all("rpy_deg" not in joint for joint in built_in)
