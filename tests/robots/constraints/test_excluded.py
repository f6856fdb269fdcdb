"""Distances from poses that must not be used."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.robots.constraints.excluded import Excluded
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.radius import Radius
from edtk.robots.constraints.tilt import Tilt
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.robots.workspace import Workspace

ROBOTS = {
    "mixed": mixed_chain(4),
    "kuka": load_robot("kuka_kr270").with_tool(transform([0.6115, 0.0, -0.460])),
}
both = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
TABLE_3 = (Height(0.800), Radius(0.600), Tilt(np.deg2rad(30)))


def poses(robot, *batch, seed=1):
    return np.random.default_rng(seed).uniform(*robot.limits, size=(*batch, robot.n))


@both
@pytest.mark.slow
def test_gradient_of_excluded_poses(robot, derivative):
    """Gradients of distances agree with differences, away from the pose and from half a turn."""
    forbidden = poses(robot, 3, seed=7)
    workspace = Workspace(robot, (Excluded(forbidden, 0.2),))
    turning = np.array([joint.kind == "revolute" for joint in robot.joints])
    used = 0
    for q in poses(robot, 30):
        apart = np.abs(np.mod(q - forbidden + np.pi, 2 * np.pi) - np.pi)[:, turning]
        if (np.linalg.norm(apart, axis=1) < 0.5).any() or apart.max() > np.pi - 0.01:
            continue
        used += 1
        np.testing.assert_allclose(
            workspace.gradient(q)[:3], derivative(workspace.slack, q)[:3], rtol=0, atol=1e-9
        )
        np.testing.assert_array_equal(workspace.gradient(q)[:3, ~turning], 0)
    assert used >= 5


def test_distance_from_excluded_poses():
    """The distance is that of the angles: whole turns and prismatic joints do not count."""
    robot = ROBOTS["mixed"]
    turning = np.array([joint.kind == "revolute" for joint in robot.joints])
    assert turning.sum() >= 2
    assert not turning.all()
    pose = poses(robot)
    away = np.random.default_rng(2).uniform(-3, 3, size=robot.n)
    workspace = Workspace(robot, (Excluded(pose[None], 0.2),))
    expected = np.linalg.norm(away[turning]) - 0.2
    for turns in (0, 1, -2):
        assert workspace.slack(pose + away + 2 * np.pi * turns * turning)[0] == pytest.approx(
            expected, abs=1e-12
        )
    assert workspace.slack(pose + ~turning)[0] == pytest.approx(-0.2, abs=1e-12)


def test_the_short_way_round():
    """Just beyond half a turn the distance falls again: -179 deg is 2 deg away from 179 deg."""
    joint = Joint("q1", np.eye(4), np.array([0.0, 0.0, 1.0]), (-4.0, 4.0))
    workspace = Workspace(Robot("one", (joint,)), (Excluded(np.deg2rad([[179.0]]), np.deg2rad(5)),))
    q = np.deg2rad([[-179.0], [-170.0], [170.0], [0.0]])
    np.testing.assert_allclose(
        workspace.slack(q)[:, 0], np.deg2rad([-3, 6, 4, 174]), rtol=0, atol=1e-14
    )
    np.testing.assert_allclose(workspace.gradient(q)[:, 0, 0], [1, 1, -1, -1], rtol=1e-12)


def test_excluded_poses_in_a_workspace():
    """Only poses near an excluded one are rejected, and each has a label with the distance."""
    robot = ROBOTS["kuka"]
    inside = np.zeros(6)
    forbidden = np.array([inside, inside + 1.0])
    workspace = Workspace(robot, (Excluded(forbidden, np.deg2rad(5)),))
    assert workspace.labels[:2] == (
        "distance from excluded pose 1 > 5 deg",
        "distance from excluded pose 2 > 5 deg",
    )
    step = np.deg2rad(5) * np.eye(6)[2]
    assert not workspace.contains(inside + 0.999 * step)
    assert workspace.contains(inside + 1.001 * step)
    assert [str(violation) for violation in workspace.violations(workspace.slack(inside))] == [
        "'distance from excluded pose 1 > 5 deg' by 5 deg"
    ]


def test_the_slope_at_an_excluded_pose_itself_is_zero():
    """Where the distance has a kink there is no warning and no NaN."""
    pose = np.zeros(6)
    G = Workspace(ROBOTS["kuka"], (Excluded(pose[None], 0.1),)).gradient(pose)
    np.testing.assert_array_equal(G[0], 0)
