"""Constraints, their gradients and their names."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.model.constraints.excluded import Excluded
from edtk.model.constraints.height import Height
from edtk.model.constraints.joint_limits import JointLimits
from edtk.model.constraints.radius import Radius
from edtk.model.constraints.tilt import Tilt
from edtk.model.joint import Joint
from edtk.model.load_robot import load_robot
from edtk.model.robot import Robot
from edtk.model.transform import transform
from edtk.model.workspace import Workspace

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
    """The gradient of every slack agrees with differences, away from the poles of phi and the base axis."""
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
    """Height is p_z, radius hypot(p_x, p_y), tilt asin(z_tool . e_z) on both sides, then joint limits."""
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
    workspace, q = (
        Workspace(robot, (*TABLE_3, Excluded(poses(robot, 3, seed=7), 0.1))),
        poses(robot, *batch),
    )
    slack, gradient, inside = workspace.slack(q), workspace.gradient(q), workspace.contains(q)
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
    """A workspace without constraints still keeps the joints between their limits, both included."""
    robot = ROBOTS["kuka"]
    workspace = Workspace(robot)
    assert workspace.contains(robot.limits).all()
    assert not workspace.contains(robot.limits[1] + 1e-9)


def test_a_pose_at_a_bound_is_within_rounding():
    """The slack within a resolution covers, to first order, all that rounding of the joints to it can take.

    The second order is at most reach + reach^2 / r = 25 m (for the radius, r > 0.6 m; the others have less)
    times half the square of the sum of the joints' changes.
    """
    robot, resolution = ROBOTS["kuka"], np.deg2rad(0.1)
    workspace, q = Workspace(robot, TABLE_3), poses(robot, 300)
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
    """With a vertical tool axis and the tool point on the base axis there is no warning and no NaN."""
    joint = Joint("q1", np.eye(4), np.array([0.0, 0.0, 1.0]), (-1.0, 1.0))
    workspace = Workspace(Robot("pole", (joint,)), TABLE_3)
    assert np.isfinite(workspace.gradient(np.zeros(1))).all()
    assert np.isfinite(workspace.slack(np.zeros(1))).all()


@both
def test_gradient_of_excluded_poses(robot, derivative):
    """The gradient of each distance agrees with differences, away from the pose itself and from half a turn."""
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
    """The distance is that of the angles, whole turns are none, and a prismatic joint does not count."""
    robot = ROBOTS["mixed"]
    turning = np.array([joint.kind == "revolute" for joint in robot.joints])
    assert turning.sum() >= 2
    assert not turning.all()
    pose, away = poses(robot), np.random.default_rng(2).uniform(-3, 3, size=robot.n)
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
    """Only poses that near an excluded one are refused; each excluded pose has a label with the distance."""
    robot, inside = ROBOTS["kuka"], np.zeros(6)
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
