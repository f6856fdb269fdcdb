"""Joints that follow others: a chain with ties is the free chain, folded."""

import json

import numpy as np
import pytest
from chains import mixed_chain, tied_chain

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import equilibrium, torque_and_derivative
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.robots.frames import BodyPoint
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict
from edtk.robots.weights import DeadWeights, Loading

FREE = mixed_chain(6)
ROBOT = tied_chain()
WRENCH = np.array([30.0, -20.0, 50.0, 4.0, -3.0, 2.0])


Q = np.random.default_rng(1).uniform(-1.5, 1.5, size=(5, 4))


def spread(q):
    """Variables of all six joints."""
    return np.stack(
        [q[..., 0], -0.7 * q[..., 2] + 0.2, q[..., 1], 1.5 * q[..., 0] - 0.4, *q.T[2:]], axis=-1
    )


def everything() -> ElastostaticModel:
    """Markers on bodies, a pose, a distance, a load elsewhere and weights."""
    sensors = (
        Marker(BodyPoint(np.array([0.1, 0.2, 0.3]), 3)),
        PoseMarker(BodyPoint(np.array([0.0, 0.1, 0.0]))),
        Distance(BodyPoint(np.array([0.2, 0.0, 0.0]), 4), "", np.array([3.0, 2.0, 1.0])),
    )
    weights = DeadWeights((3.0, 2.0), (BodyPoint(np.array([0.1, 0.0, 0.2]), 1), BodyPoint()), 6)
    point = BodyPoint(np.array([0.3, -0.1, 0.2]))
    return ElastostaticModel(ROBOT, (0, 2, 3), sensors=sensors, load_point=point, weights=weights)


MODELS = {
    "position": ElastostaticModel(ROBOT),
    "pose": ElastostaticModel(ROBOT, (1, 2), "pose"),
    "everything": everything(),
}


def test_the_chain_is_the_free_one_with_the_ties_put_in():
    """Names, order, poses and Jacobians, whose columns of masters take in those that follow."""
    assert ROBOT.joint_names == ("q1", "q3", "q5", "q6")
    assert ROBOT.body_names == FREE.joint_names
    np.testing.assert_allclose(ROBOT.forward(Q), FREE.forward(spread(Q)), atol=1e-13)
    J = FREE.jacobian(spread(Q))
    columns = [J[..., 0] + 1.5 * J[..., 3], J[..., 2], J[..., 4] - 0.7 * J[..., 1], J[..., 5]]
    np.testing.assert_allclose(ROBOT.jacobian(Q), np.stack(columns, axis=-1), atol=1e-13)


@pytest.mark.parametrize("name", MODELS)
def test_regressors_are_motion_times_load_of_the_free_joints(name, derivative):
    """Points and loads fold alike: dy/dq is the derivative of the measured points."""
    model = MODELS[name]
    for q in Q:
        frames = model.frames(q)
        numeric = derivative(lambda x: model.points_of(model.frames(x))[0], q)
        np.testing.assert_allclose(model.motion_of(frames)[:, :3], numeric.T, atol=1e-9)
        A = (model.motion_of(frames) * model.torque_of(frames, WRENCH)[:, None])[model.joints]
        np.testing.assert_allclose(model.regressor(q, WRENCH), A.T, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_slopes_are_derivatives_by_the_free_joints(name, derivative):
    """A descent moves masters, and what follows moves with them."""
    model = MODELS[name]
    B = np.random.default_rng(2).normal(size=(model.row_count, model.p))
    for q in Q:
        numeric = derivative(lambda x: (B * model.regressor(x, WRENCH)).sum(), q)
        np.testing.assert_allclose(
            model.regressor_slope(q, WRENCH, B), numeric, rtol=1e-6, atol=1e-6
        )


def test_loads_and_their_derivatives_fold(derivative):
    """The loaded equilibrium of masters takes in what loads those that follow."""
    tau, H = torque_and_derivative(ROBOT, Q, np.tile(WRENCH, (5, 1)))
    for q, load, slope in zip(Q, tau, H, strict=True):
        np.testing.assert_allclose(load, ROBOT.jacobian(q).T @ WRENCH, atol=1e-12)
        numeric = derivative(lambda x: ROBOT.jacobian(x).T @ WRENCH, q)
        np.testing.assert_allclose(slope, numeric, atol=1e-6)
    k = np.array([1e-5, 2e-5, 1e-5, 3e-5])
    rest = equilibrium(ROBOT, Q, WRENCH, k)
    linear = ElastostaticModel(ROBOT).deflection(Q, WRENCH, k)
    moved = (ROBOT.forward(Q + rest) - ROBOT.forward(Q))[:, :3, 3]
    np.testing.assert_allclose(moved, linear, rtol=0.05, atol=1e-5)


def test_weights_and_loads_elsewhere_fold_too(derivative):
    """The derivative of all loads by the free joints, links and load point on bodies included."""
    model = everything()
    loading = Loading(model.load_point, model.weights)
    tau, H = torque_and_derivative(ROBOT, Q, np.tile(WRENCH, (5, 1)), loading)
    for q, load, slope in zip(Q, tau, H, strict=True):
        np.testing.assert_allclose(load, model.torque_of(model.frames(q), WRENCH), atol=1e-10)
        numeric = derivative(lambda x: model.torque_of(model.frames(x), WRENCH), q)
        np.testing.assert_allclose(slope, numeric, atol=1e-6)


def test_ties_are_written_and_read():
    """Places, factors and offsets come back bit by bit."""
    content = robot_to_dict(ROBOT)
    again = robot_from_dict(json.loads(json.dumps(content)))
    np.testing.assert_array_equal(again.forward(Q), ROBOT.forward(Q))
    assert robot_to_dict(again) == content


@pytest.mark.parametrize("wrong", [{"name": "#4"}, {"axis": [0, 0, 0]}])
def test_a_joint_that_follows_is_checked_as_any_other(wrong):
    """A name that heads no column and an axis of no length are refused where they are read."""
    content = robot_to_dict(ROBOT)
    content["joints"][3] |= wrong
    with pytest.raises(RobotFileError, match=r"^joint (name '#4'|q4: the axis must be)"):
        robot_from_dict(content)


@pytest.mark.parametrize(
    ("mimic", "key", "message"),
    [
        ({"joint": "q7"}, "joints.1.mimic.joint", "no free joint 'q7'; this robot has q1, q3, q5"),
        ({"joint": "q4"}, "joints.1.mimic.joint", "no free joint 'q4'"),
        ({"joint": "q1", "factor": 0}, "joints.1.mimic", "a factor that is not zero"),
        ({"joint": "q1", "offset_deg": 3}, "joints.1", "an offset in its own unit"),
    ],
)
def test_wrong_ties_are_one_line(mimic, key, message):
    """A master that is not there or not free, no motion, and the offset in the wrong unit."""
    content = robot_to_dict(ROBOT)
    content["joints"][1]["mimic"] = mimic
    with pytest.raises(RobotFileError) as caught:
        robot_from_dict(content)
    assert caught.value.key == key
    assert message in str(caught.value)
