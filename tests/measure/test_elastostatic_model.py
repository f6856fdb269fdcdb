"""Regressors, their slopes, and the paper's Eq. (1) to (4) and (23)."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

DEG = np.pi / 180
CALIBRATION_TOOL = transform([0.6115, 0.0, -0.460])
CALIBRATION_WRENCH = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
WRENCH = np.array([300.0, -200.0, 500.0, 40.0, -70.0, 90.0])


ROBOTS = {"mixed": mixed_chain(6), "kuka": load_robot("kuka_kr270").with_tool(CALIBRATION_TOOL)}
both = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
either = pytest.mark.parametrize("rows", ["position", "pose"])
subsets = pytest.mark.parametrize("unknown", [None, (1, 2, 3, 4, 5), (4, 0), (2,)])


def poses(robot, *batch, seed=1):
    return np.random.default_rng(seed).uniform(*robot.limits, size=(*batch, robot.n))


def gradient(model, q, wrench):
    """Derivative (rows, p, n) of the regressor in one pose, one entry after another."""
    rows = 3 if model.rows == "position" else 6
    each = np.eye(rows * model.p).reshape(-1, rows, model.p)
    return model.regressor_slope(np.tile(q, (len(each), 1)), wrench, each).reshape(
        rows, model.p, -1
    )


@subsets
@either
@both
def test_regressor_slope_matches_finite_differences(robot, rows, unknown, derivative):
    """dA/dq agrees with differences: forces, torques, all rows, revolute and prismatic joints."""
    model = ElastostaticModel(robot, unknown, rows)
    for q in poses(robot, 5):
        numeric = derivative(lambda x: model.regressor(x, WRENCH), q)
        exact = gradient(model, q, WRENCH)
        assert exact.shape == (3 if rows == "position" else 6, model.p, robot.n)
        np.testing.assert_allclose(exact, numeric, atol=1e-9 * np.abs(numeric).max())


@either
@pytest.mark.parametrize(
    "wrench", [np.r_[WRENCH[:3], 0, 0, 0], np.r_[0, 0, 0, WRENCH[3:]]], ids=["force", "torque"]
)
def test_slope_is_linear_in_the_weights(rows, wrench):
    """The slope of <B, A> is <B, dA> for any weights B, under forces or torques alone."""
    model = ElastostaticModel(ROBOTS["mixed"], (4, 0, 2), rows)
    for q in poses(model.robot, 3):
        dA = gradient(model, q, wrench)
        B = np.random.default_rng(0).normal(size=dA.shape[:2])
        slope = model.regressor_slope(q, wrench, B)
        np.testing.assert_allclose(
            slope, np.einsum("rp,rpn->n", B, dA), atol=1e-12 * np.abs(dA).max()
        )


@subsets
@either
@both
def test_regressor_is_equation_4(robot, rows, unknown):
    """Column j of A is J_j (J_j' W), with the Jacobian taken from the robot."""
    model = ElastostaticModel(robot, unknown, rows)
    for q in poses(robot, 5):
        J = robot.jacobian(q)[:, model.joints]
        expected = (J * (J.T @ WRENCH))[: 3 if rows == "position" else 6]
        np.testing.assert_allclose(
            model.regressor(q, WRENCH), expected, atol=1e-12 * np.abs(expected).max()
        )


@subsets
@either
@both
def test_deflection_is_the_regressor_times_the_compliances(robot, rows, unknown):
    """Eq. (2) and Eq. (3) give the same deflection, which is K_C^-1 W."""
    model = ElastostaticModel(robot, unknown, rows)
    k = np.random.default_rng(2).uniform(1e-7, 1e-5, size=model.p)
    for q in poses(robot, 5):
        deflection = model.deflection(q, WRENCH, k)
        scale = np.abs(deflection).max()
        np.testing.assert_allclose(deflection, model.regressor(q, WRENCH) @ k, atol=1e-12 * scale)
        compliance = model.cartesian_compliance(q, k)
        np.testing.assert_allclose(
            deflection, (compliance @ WRENCH)[: len(deflection)], atol=1e-12 * scale
        )


@both
def test_cartesian_stiffness_is_equation_1(robot):
    """With six compliant joints K_C = J^-T K_theta J^-1, to the conditioning of J and of K_C."""
    model = ElastostaticModel(robot, None, "pose")
    k = np.array([3.8, 0.3, 0.5, 2.9, 3.3, 2.1]) * 1e-6
    for q in poses(robot, 10):
        inverse = np.linalg.inv(robot.jacobian(q))
        expected = inverse.T @ np.diag(1 / k) @ inverse
        stiffness = model.cartesian_stiffness(q, k)
        tolerance = 64 * np.finfo(float).eps * np.linalg.cond(expected)
        np.testing.assert_allclose(
            stiffness, expected, rtol=0, atol=tolerance * np.abs(expected).max()
        )
        np.testing.assert_allclose(
            stiffness @ model.deflection(q, WRENCH, k), WRENCH, rtol=1e-6, atol=1e-3
        )


def test_stiffness_needs_six_compliant_joints():
    """With a rigid joint the Cartesian compliance is singular, its inverse an error or huge."""
    model = ElastostaticModel(ROBOTS["kuka"], (1, 2, 3, 4, 5))
    compliance = model.cartesian_compliance(np.full(6, 0.3), np.full(5, 1e-6))
    assert np.linalg.matrix_rank(compliance) == 5


@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3)])
@either
@both
def test_batches_equal_loops(robot, rows, batch):
    """Any batch of poses, with one wrench or one each, gives what its members give."""
    model = ElastostaticModel(robot, (1, 4, 5), rows)
    q = poses(robot, *batch)
    k = np.array([1e-6, 2e-6, 3e-6])
    each = np.random.default_rng(3).normal(size=(*batch, 6))
    rank = 3 if rows == "position" else 6
    B = np.random.default_rng(4).normal(size=(rank, 3))
    for W in (WRENCH, each):
        A = model.regressor(q, W)
        slope = model.regressor_slope(q, W, B)
        t = model.deflection(q, W, k)
        assert (A.shape, slope.shape, t.shape) == (
            (*batch, rank, 3),
            (*batch, robot.n),
            (*batch, rank),
        )
        assert model.cartesian_compliance(q, k).shape == (*batch, 6, 6)
        for i in np.ndindex(*batch):
            w = W if W is WRENCH else W[i]
            for got, expected in (
                (A[i], model.regressor(q[i], w)),
                (slope[i], model.regressor_slope(q[i], w, B)),
                (t[i], model.deflection(q[i], w, k)),
            ):
                np.testing.assert_allclose(
                    got, expected, rtol=1e-12, atol=1e-13 * np.abs(expected).max()
                )


def test_wrench_of_the_last_axis_only_is_shared_by_the_first():
    """A wrench (3, 6) goes with the last batch axis of poses (2, 3, n), for regressor and slope."""
    robot = ROBOTS["kuka"]
    model = ElastostaticModel(robot)
    q = poses(robot, 2, 3)
    W = np.random.default_rng(4).normal(size=(3, 6))
    full = np.broadcast_to(W, (2, 3, 6))
    np.testing.assert_array_equal(model.regressor(q, W), model.regressor(q, full))
    B = np.random.default_rng(5).normal(size=(3, 6))
    np.testing.assert_array_equal(model.regressor_slope(q, W, B), model.regressor_slope(q, full, B))


def test_regressor_is_linear_in_the_wrench():
    """Superposition: A(W1 + 2 W2) = A(W1) + 2 A(W2), with pure forces and pure torques."""
    model = ElastostaticModel(ROBOTS["mixed"], rows="pose")
    q = poses(model.robot, 4)
    F = np.r_[WRENCH[:3], 0, 0, 0]
    T = np.r_[0, 0, 0, WRENCH[3:]]
    expected = model.regressor(q, F) + 2 * model.regressor(q, T)
    np.testing.assert_allclose(
        model.regressor(q, F + 2 * T), expected, atol=1e-12 * np.abs(expected).max()
    )


def test_parameters_are_named_after_their_joints():
    """Joint q3 has compliance k3, and a joint of another name has k_NAME."""
    assert ElastostaticModel(ROBOTS["kuka"], (1, 2, 5)).parameters == ("k2", "k3", "k6")
    joint = Joint("slide", np.eye(4), np.array([1.0, 0, 0]), (0.0, 1.0), "prismatic")
    assert ElastostaticModel(Robot("r", (joint,))).parameters == ("k_slide",)


@pytest.mark.parametrize("unknown", [(), (1, 1), (6,), (-1,)])
def test_bad_unknown_joints_are_refused(unknown):
    """No joint, a repeated one, or one out of range is refused."""
    with pytest.raises(ValueError, match="must be distinct indices below 6"):
        ElastostaticModel(ROBOTS["kuka"], unknown)


def test_equation_23_of_the_paper():
    """The test pose's A0 has the printed entries to 0.11, and zero for axis 6, where it lies."""
    printed = [
        [-73.4, -177.4, -106.1, 102.4, 0],
        [0, 0, 197.2, 19.3, 0],
        [-363.6, -98.3, -167.1, -42.2, 0],
    ]
    robot = load_robot("kuka_kr270").with_tool(transform([0.986, 0, 0]))
    q = np.array([0, -56.9, 89.3, 45.1, 76, 57.2]) * DEG
    A0 = ElastostaticModel(robot, (1, 2, 3, 4, 5)).regressor(q, [0, 280, -180, 0, 0, 0])
    np.testing.assert_allclose(A0, printed, atol=0.11)
    np.testing.assert_allclose(A0[:, -1], 0.0, atol=1e-12)


@pytest.fixture
def calibration():
    return ElastostaticModel(ROBOTS["kuka"], (1, 2, 3, 4, 5))


def gram(A):
    return np.swapaxes(A, -1, -2) @ A


def test_full_turns_of_joints_4_and_6_change_nothing(calibration):
    """A depends on q4 and q6 only modulo 360 degrees."""
    q = poses(calibration.robot, 50)
    A = calibration.regressor(q, CALIBRATION_WRENCH)
    for joint in (3, 5):
        turned = q + 2 * np.pi * np.eye(6)[joint]
        np.testing.assert_allclose(
            calibration.regressor(turned, CALIBRATION_WRENCH), A, atol=1e-10 * np.abs(A).max()
        )


def test_flipped_wrist_is_the_same_experiment(calibration):
    """(q4 + 180, -q5, q6 + 180) is the same tool pose with the same regressor."""
    q = poses(calibration.robot, 50)
    flipped = q * [1, 1, 1, 1, -1, 1] + np.pi * np.array([0, 0, 0, 1, 0, 1])
    np.testing.assert_allclose(
        calibration.robot.forward(flipped), calibration.robot.forward(q), atol=1e-13
    )
    A = calibration.regressor(q, CALIBRATION_WRENCH)
    np.testing.assert_allclose(
        calibration.regressor(flipped, CALIBRATION_WRENCH), A, atol=1e-10 * np.abs(A).max()
    )


def test_mirrored_wrist_gives_the_same_information(calibration):
    """(q4, q6) -> (-q4, -q6) mirrors A in the arm plane; under a vertical force A'A stays."""
    q = poses(calibration.robot, 50)
    mirrored = q * [1, 1, 1, -1, 1, -1]
    A = calibration.regressor(q, CALIBRATION_WRENCH)
    B = calibration.regressor(mirrored, CALIBRATION_WRENCH)
    assert np.abs(A - B).max() > 1.0
    np.testing.assert_allclose(gram(B), gram(A), atol=1e-10 * np.abs(gram(A)).max())


def test_vertical_force_makes_joint_1_irrelevant(calibration):
    """Under a vertical force A'A does not depend on q1, and k1 has a zero column."""
    q = poses(calibration.robot, 50)
    A = calibration.regressor(q, CALIBRATION_WRENCH)
    B = calibration.regressor(q * [0, 1, 1, 1, 1, 1], CALIBRATION_WRENCH)
    np.testing.assert_allclose(gram(B), gram(A), atol=1e-10 * np.abs(gram(A)).max())
    first = ElastostaticModel(calibration.robot, (0,)).regressor(q, CALIBRATION_WRENCH)
    np.testing.assert_allclose(first, 0.0, atol=1e-10)
