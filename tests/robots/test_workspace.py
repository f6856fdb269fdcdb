"""Constraints, their gradients and their names."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.robots.constraints.excluded import Excluded
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.joint_limits import JointLimits
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
def test_gradients_match_finite_differences(robot, derivative):
    """Gradients of slacks agree with differences, away from the poles of phi and the base axis."""
    workspace = Workspace(robot, TABLE_3)
    used = 0
    for q in poses(robot, 20):
        T = robot.forward(q)
        if abs(T[2, 2]) > 0.9 or np.hypot(T[0, 3], T[1, 3]) < 0.3:
            continue
        used += 1
        np.testing.assert_allclose(workspace.gradient(q), derivative(workspace.slack, q), atol=1e-7)
    assert used >= 5


@both
def test_slacks_are_their_definitions(robot):
    """Slacks are those of p_z, hypot(p_x, p_y), asin(z_tool . e_z) on both sides, and limits."""
    workspace = Workspace(robot, TABLE_3)
    for q in poses(robot, 10):
        T = robot.forward(q)
        phi = np.arcsin(T[2, 2])
        head = [
            T[2, 3] - 0.8,
            np.hypot(*T[:2, 3]) - 0.6,
            np.deg2rad(30) - phi,
            np.deg2rad(30) + phi,
        ]
        expected = np.concatenate([head, q - robot.limits[0], robot.limits[1] - q])
        np.testing.assert_allclose(workspace.slack(q), expected, atol=1e-13)
        assert workspace.contains(q) == (expected >= 0).all()


@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3), (0,)])
@both
def test_batches_equal_loops(robot, batch):
    """Poses of any batch shape give what they give one by one."""
    workspace = Workspace(robot, (*TABLE_3, Excluded(poses(robot, 3, seed=7), 0.1)))
    q = poses(robot, *batch)
    slack = workspace.slack(q)
    gradient = workspace.gradient(q)
    inside = workspace.contains(q)
    c = len(workspace.labels)
    assert (slack.shape, gradient.shape, np.shape(inside)) == (
        (*batch, c),
        (*batch, c, robot.n),
        batch,
    )
    for i in np.ndindex(*batch):
        np.testing.assert_allclose(slack[i], workspace.slack(q[i]), atol=1e-13)
        np.testing.assert_allclose(gradient[i], workspace.gradient(q[i]), atol=1e-12)
        assert inside[i] == workspace.contains(q[i])


def test_labels_name_every_inequality_with_its_bound():
    """There is one label per slack, in its unit: mm, deg, and m for a prismatic joint."""
    labels = Workspace(ROBOTS["kuka"], TABLE_3).labels
    assert labels[:5] == (
        "height p_z > 800 mm",
        "radius r > 600 mm",
        "tilt phi < 30 deg",
        "tilt phi > -30 deg",
        "joint limit q1 > -185 deg",
    )
    assert labels[-1] == "joint limit q6 < 350 deg"
    assert len(labels) == 16
    assert JointLimits(ROBOTS["mixed"].limits).labels(ROBOTS["mixed"])[1] == "joint limit q2 > -2 m"


def test_joint_limits_always_hold():
    """Without constraints the joints still stay between their limits, both included."""
    robot = ROBOTS["kuka"]
    workspace = Workspace(robot)
    assert workspace.contains(robot.limits).all()
    assert not workspace.contains(robot.limits[1] + 1e-9)


def test_a_pose_at_a_bound_is_within_rounding():
    """The slack within a resolution covers what rounding of the joints can take from a pose.

    To first order. The second order is at most reach + reach^2 / r = 25 m (for the radius,
    r > 0.6 m; the others have less) times half the square of the sum of the joints' changes.
    """
    robot = ROBOTS["kuka"]
    resolution = np.deg2rad(0.1)
    workspace = Workspace(robot, TABLE_3)
    q = poses(robot, 300)
    exact = workspace.slack(q)
    rounded = np.round(q / resolution) * resolution
    second_order = 0.5 * 25.0 * (robot.n * resolution / 2) ** 2
    smooth = (np.abs(robot.forward(q)[:, 2, 2]) < 0.5) & (exact[:, 1] > 0)
    assert smooth.sum() > 50
    assert (workspace.slack_within(rounded, resolution) >= exact - second_order)[smooth].all()
    assert (workspace.slack(rounded) < exact - second_order)[smooth].any()
    granted = workspace.slack_within(q, resolution) - exact
    np.testing.assert_allclose(
        granted, np.abs(workspace.gradient(q)).sum(axis=-1) * resolution / 2, atol=1e-13
    )


def test_gradients_stay_finite_at_the_poles():
    """With a vertical tool on the base axis there is no warning and no NaN."""
    joint = Joint("q1", np.eye(4), np.array([0.0, 0.0, 1.0]), (-1.0, 1.0))
    workspace = Workspace(Robot("pole", (joint,)), TABLE_3)
    assert np.isfinite(workspace.gradient(np.zeros(1))).all()
    assert np.isfinite(workspace.slack(np.zeros(1))).all()
