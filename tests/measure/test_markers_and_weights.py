"""Motion of several instruments, joint loads of forces and weights, and their adjoint slopes."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.robots.frames import BodyPoint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.robots.weights import GRAVITY, DeadWeights

ROBOT = mixed_chain(7)
WRENCH = np.array([300.0, -200.0, 500.0, 40.0, -70.0, 90.0])
TIP = BodyPoint(np.array([0.1, -0.2, 0.3]))
ELBOW = BodyPoint(np.array([-0.2, 0.4, 0.1]), joint=3)
SLIDE = BodyPoint(np.array([0.3, 0.2, -0.1]), joint=1)
ANCHOR = np.array([2.0, -1.0, 0.4])
SENSORS = (
    Marker(TIP),
    PoseMarker(ELBOW),
    Distance(TIP, "wire", ANCHOR),
    Marker(SLIDE),
    Distance(ELBOW, "ballbar", -ANCHOR),
)
WEIGHTS = DeadWeights((12.0, 30.0, 4.0), (ELBOW, SLIDE, TIP), ROBOT.n)
MODELS = {
    "plain": ElastostaticModel(ROBOT),
    "markers": ElastostaticModel(ROBOT, None, sensors=SENSORS),
    "load point": ElastostaticModel(ROBOT, (4, 0, 2), load_point=TIP),
    "load on the forearm": ElastostaticModel(ROBOT, None, "pose", load_point=ELBOW),
    "weights": ElastostaticModel(ROBOT, (0, 1, 2, 5), weights=WEIGHTS),
    "all": ElastostaticModel(ROBOT, (6, 3, 1, 2), "pose", SENSORS, TIP, WEIGHTS),
}
each = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def poses(*batch, seed=1):
    return np.random.default_rng(seed).uniform(-2, 2, size=(*batch, ROBOT.n))


def place(point, q):
    """A point by homogeneous transforms, joint after joint."""
    if point.joint is None:
        return (ROBOT.forward(q) @ np.append(point.offset, 1.0))[..., :3]
    body = Robot("body", ROBOT.joints[: point.joint + 1], ROBOT.base, transform(point.offset))
    return body.forward(q[..., : point.joint + 1])[..., :3, 3]


@pytest.mark.parametrize("point", [BodyPoint(), TIP, ELBOW, SLIDE])
def test_a_point_is_where_its_body_carries_it(point):
    """Positions are those of a chain that ends at the body, for any batch of poses."""
    for batch in ((), (4,), (2, 3)):
        q = poses(*batch)
        got = np.moveaxis(point.position(ROBOT.frames(q, point.bodies)), 0, -1)
        np.testing.assert_allclose(got, place(point, q), atol=1e-13)


def test_chosen_poses_keep_their_bodies():
    """Frames of some of the poses are the frames of these poses."""
    q = poses(6)
    some = ROBOT.frames(q, (3,))[np.array([4, 1])]
    np.testing.assert_array_equal(ELBOW.position(some).T, place_of(q[[4, 1]]))


def place_of(q):
    return ELBOW.position(ROBOT.frames(q, (3,))).T


def test_motion_is_the_derivative_of_what_is_measured(derivative):
    """Rows of positions, distances and rotations are derivatives of positions and distances."""
    model = MODELS["markers"]

    def rows(q):
        tip = place(TIP, q)
        elbow = place(ELBOW, q)
        wire = [np.linalg.norm(tip - ANCHOR)]
        ballbar = [np.linalg.norm(elbow + ANCHOR)]
        return np.concatenate([tip, elbow, np.zeros(3), wire, place(SLIDE, q), ballbar])

    for q in poses(3):
        frames = model.frames(q)
        motion = np.array(model.motion_of(frames).T)
        angular = motion[6:9].copy()
        motion[6:9] = 0
        np.testing.assert_allclose(motion, derivative(rows, q), atol=1e-9)
        np.testing.assert_array_equal(angular, ELBOW.angular(frames).T)
        body = Robot("body", ROBOT.joints[:4], ROBOT.base)
        np.testing.assert_allclose(angular[:, :4], body.jacobian(q[:4])[3:], atol=1e-13)
        points = [place(sensor.point, q) for sensor in SENSORS]
        np.testing.assert_allclose(model.points_of(frames), points, atol=1e-13)


@each
def test_joint_loads_are_slopes_of_the_potential_energy(model, derivative):
    """``tau = d(F.p - sum m g z)/dq`` for forces and weights anywhere on the arm."""
    force = np.r_[WRENCH[:3], 0, 0, 0]

    def work(q):
        done = place(model.load_point, q) @ WRENCH[:3]
        if model.weights is None:
            return done
        heights = [place(center, q)[2] for center in model.weights.centers]
        return done - GRAVITY * np.dot(model.weights.masses, heights)

    for q in poses(3):
        expected = derivative(work, q)
        torque = model.torque_of(model.frames(q), force)
        np.testing.assert_allclose(torque, expected, atol=1e-9 * np.abs(expected).max())


@each
def test_motion_slope_matches_differences(model, derivative):
    """The slope of <B, dy/dq> is that of differences, for every instrument."""
    rng = np.random.default_rng(3)
    for q in poses(3):
        B = rng.normal(size=(ROBOT.n, model.row_count))
        numeric = derivative(lambda x, B=B: (B * model.motion_of(model.frames(x))).sum(), q)
        slope = model.motion_slope_of(model.frames(q), B)
        np.testing.assert_allclose(slope, numeric, atol=1e-8 * np.abs(numeric).max())


@each
def test_torque_slope_matches_differences(model, derivative):
    """The slope of <s, tau> is that of differences, for forces, torques and weights."""
    rng = np.random.default_rng(4)
    for q in poses(3):
        s = rng.normal(size=ROBOT.n)
        numeric = derivative(lambda x, s=s: s @ model.torque_of(model.frames(x), WRENCH), q)
        slope = model.torque_slope_of(model.frames(q), WRENCH, s)
        np.testing.assert_allclose(slope, numeric, atol=1e-8 * np.abs(numeric).max())


@each
def test_regressor_and_slope_are_composed_of_both(model, derivative):
    """Column j is ``dy/dq_j tau_j``, and the slope of <B, A> is that of differences."""
    rng = np.random.default_rng(5)
    for q in poses(3):
        frames = model.frames(q)
        A = model.regressor(q, WRENCH)
        expected = (model.motion_of(frames) * model.torque_of(frames, WRENCH)[:, None]).T
        np.testing.assert_allclose(A, expected[:, model.joints], rtol=1e-12)
        B = rng.normal(size=A.shape)
        numeric = derivative(lambda x, B=B: (B * model.regressor(x, WRENCH)).sum(), q)
        slope = model.regressor_slope(q, WRENCH, B)
        np.testing.assert_allclose(slope, numeric, atol=1e-8 * np.abs(numeric).max())


def test_batches_equal_loops():
    """Any batch of poses gives what its members give, with all that a model can have."""
    model = MODELS["all"]
    for batch in ((1,), (2, 3)):
        q = poses(*batch)
        W = np.random.default_rng(3).normal(size=(*batch, 6))
        B = np.random.default_rng(4).normal(size=(model.row_count, model.p))
        A = model.regressor(q, W)
        slope = model.regressor_slope(q, W, B)
        assert A.shape == (*batch, model.row_count, model.p)
        for i in np.ndindex(*batch):
            one = model.regressor(q[i], W[i])
            np.testing.assert_allclose(A[i], one, rtol=1e-12, atol=1e-13 * np.abs(one).max())
            np.testing.assert_allclose(slope[i], model.regressor_slope(q[i], W[i], B), rtol=1e-10)


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_a_marker_at_the_tool_point_is_the_plain_model(rows):
    """One marker at the tool point, where the load acts, has the regressors of the plain model."""
    marker = Marker() if rows == "position" else PoseMarker()
    plain = ElastostaticModel(ROBOT, (0, 3, 6), rows)
    same = ElastostaticModel(ROBOT, (0, 3, 6), sensors=(marker,))
    q = poses(5)
    assert not same.is_plain
    np.testing.assert_array_equal(same.regressor(q, WRENCH), plain.regressor(q, WRENCH))
    B = np.random.default_rng(4).normal(size=(same.row_count, 3))
    np.testing.assert_allclose(
        same.regressor_slope(q, WRENCH, B), plain.regressor_slope(q, WRENCH, B), rtol=1e-9
    )


def test_a_marker_is_the_tool_point_of_another_tool():
    """A marker with an offset, loaded there, is a robot whose tool ends at the marker."""
    longer = ROBOT.with_tool(ROBOT.tool @ transform(TIP.offset))
    expected = ElastostaticModel(longer, (2, 3)).regressor(poses(5), WRENCH)
    model = ElastostaticModel(ROBOT, (2, 3), sensors=(Marker(TIP),), load_point=TIP)
    np.testing.assert_allclose(model.regressor(poses(5), WRENCH), expected, rtol=1e-11)


def test_a_weight_is_a_force_at_its_centre_of_mass():
    """One mass at the tool loads the joints as its weight does."""
    held = ElastostaticModel(ROBOT, weights=DeadWeights((25.0,), (TIP,), ROBOT.n))
    pulled = ElastostaticModel(ROBOT, load_point=TIP)
    q = poses(5)
    weight = np.array([0, 0, -25 * GRAVITY, 0, 0, 0])
    expected = pulled.regressor(q, weight)
    np.testing.assert_allclose(held.regressor(q, np.zeros(6)), expected, rtol=1e-10)
