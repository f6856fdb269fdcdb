"""Forward kinematics and Jacobians: laws on a mixed chain, and an independent implementation."""

from pathlib import Path

import numpy as np
import pytest
from chains import mixed_chain
from scipy.spatial.transform import Rotation

from edtk.robots.frames import cross
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

URDF = Path(__file__).parents[1] / "data" / "kr150_2.urdf"


def kuka():
    return load_robot("kuka_kr270").with_tool(transform([0.6115, 0.0, -0.460], [0.1, -0.2, 0.3]))


ROBOTS = {"mixed": mixed_chain(), "kuka": kuka()}
both = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


def poses(robot, *batch, seed=1):
    return np.random.default_rng(seed).uniform(*robot.limits, size=(*batch, robot.n))


@both
def test_linear_rows_are_the_derivative_of_the_position(robot, derivative):
    """The upper half of the Jacobian is the finite difference of the tool point."""
    for q in poses(robot, 10):
        numeric = derivative(lambda x: robot.forward(x)[:3, 3], q)
        np.testing.assert_allclose(robot.jacobian(q)[:3], numeric, atol=1e-10)


@both
def test_angular_rows_are_the_derivative_of_the_rotation(robot, derivative):
    """The lower half is the finite difference of the rotation: dR/dq_k R' = [w_k x]."""
    for q in poses(robot, 10):
        spin = np.einsum(
            "ijk,lj->ilk",
            derivative(lambda x: robot.forward(x)[:3, :3], q),
            robot.forward(q)[:3, :3],
        )
        numeric = np.stack([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(robot.jacobian(q)[3:], numeric, atol=1e-10)
        np.testing.assert_allclose(spin, -np.swapaxes(spin, 0, 1), atol=1e-10)


@both
def test_forward_kinematics_is_the_product_of_transforms(robot):
    """The tool's pose is base * origin_1 * motion_1 * ... * tool, each factor by its definition."""
    for q in poses(robot, 10):
        T = robot.base
        for joint, x in zip(robot.joints, q, strict=True):
            motion = np.eye(4)
            if joint.kind == "prismatic":
                motion[:3, 3] = x * joint.axis
            else:
                motion[:3, :3] = Rotation.from_rotvec(x * joint.axis).as_matrix()
            T = T @ joint.origin @ motion
        np.testing.assert_allclose(robot.forward(q), T @ robot.tool, atol=1e-13)


@both
def test_frames_agree_with_the_jacobian(robot):
    """Frames hold the same numbers component first: columns of J, tool rotation and tool point."""
    q = poses(robot, 5)
    frames = robot.frames(q)
    J = robot.jacobian(q)
    T = robot.forward(q)
    np.testing.assert_array_equal(np.moveaxis(frames.linear, (0, 1), (2, 1)), J[:, :3])
    np.testing.assert_array_equal(np.moveaxis(frames.angular, (0, 1), (2, 1)), J[:, 3:])
    np.testing.assert_array_equal(frames.position.T, T[:, :3, 3])
    np.testing.assert_array_equal(frames.rotation[2].T, T[:, :3, 2])


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ((4, 3), (4, 3)),
        ((4, 3), (1, 3)),
        ((1, 3, 5), (4, 3, 5)),
        ((4, 3, 2, 5), (4, 3, 2, 5)),
        ((1, 3), (0, 3)),
    ],
    ids=["rows", "one row", "batch", "two axes", "none"],
)
def test_cross_product_along_the_second_axis(a, b):
    """The product along the second axis is numpy's, other axes broadcast, and inputs stay."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=a)
    y = rng.normal(size=b)
    x.flags.writeable = y.flags.writeable = False
    np.testing.assert_array_equal(cross(x, y), np.cross(x, y, axis=1))


@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3), (0,)])
@both
def test_batches_equal_loops(robot, batch):
    """Poses of any batch shape, a single one and none included, give what they give one by one."""
    q = poses(robot, *batch)
    T = robot.forward(q)
    J = robot.jacobian(q)
    assert T.shape == (*batch, 4, 4)
    assert J.shape == (*batch, 6, robot.n)
    for i in np.ndindex(*batch):
        np.testing.assert_allclose(T[i], robot.forward(q[i]), atol=1e-14)
        np.testing.assert_allclose(J[i], robot.jacobian(q[i]), atol=1e-14)


@both
def test_calls_do_not_change_their_argument_or_the_robot(robot):
    """The caller's q is left alone, also when it is read-only, and a second call gives the same."""
    q = poses(robot, 3)
    q.flags.writeable = False
    first = robot.forward(q)
    np.testing.assert_array_equal(robot.forward(q), first)


def test_wrong_number_of_joints_is_named():
    """A pose of the wrong length is refused with both lengths."""
    with pytest.raises(ValueError, match=r"q has shape \(5,\), expected \(\.\.\., 6\)"):
        kuka().forward(np.zeros(5))
    with pytest.raises(ValueError, match="expected"):
        kuka().forward(0.0)


def test_stretched_arm_is_where_the_geometry_says():
    """At q = 0 the wrist centre lies at (0.350 + 1.250 + 1.100, 0, 0.750 - 0.055) m, unrotated."""
    expected = transform([2.700, 0.0, 0.695])
    np.testing.assert_allclose(load_robot("kuka_kr270").forward(np.zeros(6)), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axis": np.zeros(3)}, "joint a: the axis must be a non-zero vector"),
        ({"axis": np.array([1.0, np.nan, 0.0])}, "joint a: the axis must be a non-zero vector"),
        ({"limits": (1.0, 1.0)}, "joint a: the lower limit must lie below"),
        ({"limits": (1.0, np.nan)}, "joint a: the lower limit must lie below"),
        ({"kind": "screw"}, "joint a: kind must be 'revolute' or 'prismatic', not 'screw'"),
    ],
)
def test_bad_joint_is_refused(change, message):
    """A joint without axis, with limits out of order or of unknown kind is refused by name."""
    good = {
        "name": "a",
        "origin": np.eye(4),
        "axis": np.array([0.0, 0.0, 2.0]),
        "limits": (-1.0, 1.0),
    }
    np.testing.assert_array_equal(Joint(**good).axis, [0.0, 0.0, 1.0])
    with pytest.raises(ValueError, match=message):
        Joint(**{**good, **change})


def test_bad_robot_is_refused():
    """A robot needs joints, and a name for each."""
    joint = mixed_chain().joints[0]
    for joints in ((), (joint, joint)):
        with pytest.raises(
            ValueError, match="needs at least one joint, each with a name of its own"
        ):
            Robot("r", joints)


@pytest.mark.slow
def test_same_kinematics_as_pinocchio_reads_from_the_sister_robots_urdf():
    """Another library finds our forward kinematics and Jacobians of the KR 150-2 in 200 poses."""
    pin = pytest.importorskip("pinocchio", reason="pinocchio is not importable here")
    model = pin.buildModelFromUrdf(str(URDF))
    data = model.createData()
    flange = model.getFrameId("flange")
    robot = load_robot("kuka_kr270").with_tool(transform([0.230, 0.0, 0.0]))
    np.testing.assert_allclose(
        robot.limits, [model.lowerPositionLimit, model.upperPositionLimit], atol=1e-12
    )
    for q in poses(robot, 200):
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        np.testing.assert_allclose(robot.forward(q), data.oMf[flange].homogeneous, atol=1e-10)
        J = pin.computeFrameJacobian(model, data, q, flange, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(robot.jacobian(q), J, atol=1e-10)
