"""Compensation of the deflection under load, and its accuracy."""

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import criteria
from edtk.inference.bias import linearisation_bias
from edtk.inference.equilibrium_deflection import equilibrium_deflection
from edtk.inference.error_quantiles import error_quantiles
from edtk.inference.least_squares import estimate
from edtk.inference.simulate import simulate
from edtk.model.compensated_joints import compensated_joints
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium
from edtk.model.joint import Joint
from edtk.model.load_robot import load_robot
from edtk.model.remaining_error import remaining_error
from edtk.model.robot import Robot
from edtk.model.transform import transform

K0 = np.array([0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
SIGMA = 0.03e-3
TASK_WRENCH = np.array([0.0, 280.0, -180.0, 5.0, -8.0, 3.0])
TEST_POSE = np.deg2rad([0, -56.9, 89.3, 45.1, 76, 57.2])


def model_of(tool, unknown=(1, 2, 3, 4, 5), rows="position"):
    return ElastostaticModel(load_robot("kuka_kr270").with_tool(transform(tool)), unknown, rows)


TASK = model_of((0.986, 0.0, 0.1))


def seven_joints():
    """A chain on skew axes whose second and fifth joints are prismatic."""
    rng = np.random.default_rng(0)
    kinds = ["prismatic" if i in (1, 4) else "revolute" for i in range(7)]
    origins = [transform(rng.normal(size=3), rng.uniform(-3, 3, size=3)) for _ in kinds]
    joints = [
        Joint(f"q{i}", T, rng.normal(size=3), (-2.0, 2.0), kinds[i]) for i, T in enumerate(origins)
    ]
    return Robot("seven", tuple(joints), tool=transform([0.2, 0.1, -0.3], [1.0, 0.2, -0.5]))


def position_error(model, q0, wrench, k):
    """Distance of the loaded tool point from the desired one, with the compensated joints commanded."""
    q = compensated_joints(model, q0, wrench, k)
    return np.linalg.norm(
        model.robot.forward(q)[..., :3, 3]
        + model.regressor(q, wrench) @ k
        - model.robot.forward(q0)[..., :3, 3],
        axis=-1,
    )


def plan():
    q = np.random.default_rng(0).uniform(*TASK.robot.limits, size=(8, 6))
    return model_of((0.6115, 0.0, -0.460)).regressor(q, [0, 0, -2500.0, 0, 0, 0])


def test_error_by_the_linear_model_is_of_second_order():
    """Halving the load quarters what compensation leaves if deflections are linear in the commanded pose."""
    load = 10 * TASK_WRENCH
    whole, half, quarter = (position_error(TASK, TEST_POSE, f * load, K0) for f in (1.0, 0.5, 0.25))
    assert whole / half == pytest.approx(4.0, rel=0.05)
    assert half / quarter == pytest.approx(4.0, rel=0.025)
    assert whole < 0.05 * np.linalg.norm(TASK.deflection(TEST_POSE, load, K0))


def test_compensation_is_equation_15():
    """With six compliant joints the command is q0 - J0^-1 K_C^-1 W, by the Jacobian's inverse."""
    model, k = model_of((0.986, 0.0, 0.1), unknown=None, rows="pose"), np.r_[3.8e-6, K0]
    turn = np.linalg.solve(
        model.robot.jacobian(TEST_POSE), model.deflection(TEST_POSE, TASK_WRENCH, k)
    )
    np.testing.assert_allclose(
        compensated_joints(model, TEST_POSE, TASK_WRENCH, k), TEST_POSE - turn, atol=1e-13
    )


def test_compensation_is_the_linear_solution_of_equation_14():
    """To first order the command moves the tool point by minus the deflection."""
    dq = compensated_joints(TASK, TEST_POSE, TASK_WRENCH, K0) - TEST_POSE
    moved = TASK.robot.jacobian(TEST_POSE)[:3] @ dq
    np.testing.assert_allclose(
        moved, -TASK.deflection(TEST_POSE, TASK_WRENCH, K0), rtol=1e-8, atol=1e-13
    )


def test_compensation_keeps_rigid_joints_and_its_argument():
    """Joints without compliance are not turned, and the desired pose is left as it was."""
    q0 = TEST_POSE.copy()
    q = compensated_joints(TASK, q0, TASK_WRENCH, K0)
    assert q[0] == q0[0]
    np.testing.assert_array_equal(q0, TEST_POSE)


def test_compensation_holds_in_a_singular_pose():
    """In the stretched arm, where J has no inverse, the command still removes the first order."""
    q0 = np.zeros(6)
    assert np.linalg.matrix_rank(TASK.robot.jacobian(q0)) < 6
    load = 10 * TASK_WRENCH
    errors = [position_error(TASK, q0, f * load, K0) for f in (1.0, 0.5)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_compensation_of_a_batch_equals_the_loop(batch):
    """Poses and wrenches of any batch shape give what they give one by one."""
    rng = np.random.default_rng(1)
    q0, each = rng.uniform(*TASK.robot.limits, size=(*batch, 6)), rng.normal(size=(*batch, 6))
    for W in (TASK_WRENCH, each):
        q = compensated_joints(TASK, q0, W, K0)
        assert q.shape == q0.shape
        for i in np.ndindex(*batch):
            expected = compensated_joints(TASK, q0[i], W if W is TASK_WRENCH else W[i], K0)
            np.testing.assert_allclose(q[i], expected, atol=1e-14)


def test_accuracy_is_the_rms_error_of_repeated_calibrations():
    """Eq. (17) is the root mean square of |A0 (k_hat - k0)| over 20000 simulated calibrations.

    The squared error of a normal vector with covariance C has mean trace(C) and variance 2 trace(C^2).
    """
    A, A0, N = plan(), TASK.regressor(TEST_POSE, TASK_WRENCH), 20_000
    result = estimate(
        A, simulate(A, K0, SIGMA, np.random.default_rng(2), runs=N), SIGMA, TASK.parameters
    )
    squares = (((result.k - K0) @ A0.T) ** 2).sum(axis=-1)
    C = A0 @ result.covariance @ A0.T
    rho = compensation_accuracy(A0, result.covariance)
    assert rho**2 == pytest.approx(np.trace(C), rel=1e-12)
    assert abs(squares.mean() - rho**2) < 5 * np.sqrt(2 * np.trace(C @ C) / N)


def test_accuracy_is_the_criterion_rho0():
    """The accuracy of a plan in the test pose is the criterion's value of the plan's information."""
    A, A0 = plan(), TASK.regressor(TEST_POSE, TASK_WRENCH)
    M = np.einsum("mri,mrj->ij", A, A) / SIGMA**2
    cov = estimate(A, A @ K0, SIGMA, TASK.parameters).covariance
    value = criteria.create("rho0", target=A0).value(M)
    np.testing.assert_allclose(compensation_accuracy(A0, cov), value, rtol=1e-10)


def test_accuracy_of_a_batch_of_task_poses():
    """Several task poses at once give one accuracy each."""
    q = np.random.default_rng(3).uniform(*TASK.robot.limits, size=(2, 3, 6))
    A0, cov = TASK.regressor(q, TASK_WRENCH), np.diag(K0**2)
    rho = compensation_accuracy(A0, cov)
    assert rho.shape == (2, 3)
    for i in np.ndindex(2, 3):
        assert rho[i] == pytest.approx(compensation_accuracy(A0[i], cov), rel=1e-13)


def equation_14(model, q0, wrench, k):
    """The command that solves Eq. (14) to the end: g(q) plus the deflection in q0 is the desired pose."""
    goal, dt = model.robot.forward(q0), model.deflection(q0, wrench, k)
    turned = Rotation.from_rotvec(-dt[3:]).as_matrix() @ goal[:3, :3]

    def miss(q):
        T = model.robot.forward(q)
        turn = Rotation.from_matrix(T[:3, :3] @ turned.T).as_rotvec()
        return np.r_[T[:3, 3] + dt[:3] - goal[:3, 3], turn]

    return root(miss, q0, tol=1e-15).x


@pytest.mark.parametrize("q0", [TEST_POSE, np.zeros(6)], ids=["regular", "singular"])
def test_compensation_is_exact_in_the_equilibrium(q0):
    """The loaded robot rests in the desired joints and tool pose, even under a load ten times the task's."""
    q = compensated_joints(TASK, q0, 10 * TASK_WRENCH, K0)
    theta = equilibrium(TASK.robot, q, 10 * TASK_WRENCH, np.r_[0, K0]).theta
    assert np.abs(theta).max() > 1e-3
    np.testing.assert_allclose(q + theta, q0, atol=1e-14)
    assert np.abs(remaining_error(TASK, q0, 10 * TASK_WRENCH, K0, K0)).max() < 1e-14


def test_compensation_is_exact_with_prismatic_and_more_than_six_joints():
    """A skew chain of seven revolute and prismatic joints is brought to the desired pose too."""
    robot, rng = seven_joints(), np.random.default_rng(4)
    model, k = ElastostaticModel(robot), rng.uniform(1e-6, 1e-4, robot.n)
    q0, W = rng.uniform(-1, 1, (5, robot.n)), 30 * rng.normal(size=(5, 6))
    assert np.abs(equilibrium(robot, q0, W, k).displacement).max() > 1e-3
    assert np.abs(remaining_error(model, q0, W, k, k)).max() < 1e-13


def test_other_readings_of_compensation_are_off_by_the_second_order():
    """Eq. (14) solved to the end, and Eq. (15) for the position by a pseudo-inverse, leave errors of order two.

    Eq. (15) itself, with the inverse of the full Jacobian, leaves rounding, since it is the exact command.
    """
    model, k = model_of((0.986, 0.0, 0.1), unknown=None, rows="pose"), np.r_[3.8e-6, K0]
    J, sizes = model.robot.jacobian(TEST_POSE), 16 * 2.0 ** -np.arange(6)
    left = []
    for W in np.multiply.outer(sizes, TASK_WRENCH):
        dt = model.deflection(TEST_POSE, W, k)
        commands = [
            TEST_POSE - np.linalg.solve(J, dt),
            TEST_POSE - np.linalg.pinv(J[:3]) @ dt[:3],
            equation_14(model, TEST_POSE, W, k),
        ]
        loaded = [
            model.robot.forward(q + equilibrium(model.robot, q, W, k).theta)[:3, 3]
            for q in commands
        ]
        left.append(np.linalg.norm(loaded - model.robot.forward(TEST_POSE)[:3, 3], axis=-1))
    exact, *others = np.transpose(left)
    assert exact.max() < 1e-13
    for error in others:
        assert np.polyfit(np.log(sizes), np.log(error), 1)[0] == pytest.approx(2.0, abs=0.05)


def test_calibrated_robot_is_as_accurate_as_promised():
    """Measured, identified and compensated 20000 times, the loaded robot misses the test pose by rho0, and no more.

    The mean square is rho0^2 within five Monte-Carlo errors, and the 95 % band holds 95 % of the errors; the noise is
    small enough that dk is small beside k, as Eq. (17) supposes.
    """
    A, A0, N = plan(), TASK.regressor(TEST_POSE, TASK_WRENCH), 20_000
    fit = estimate(
        A, simulate(A, K0, SIGMA, np.random.default_rng(5), runs=N), SIGMA, TASK.parameters
    )
    errors = np.linalg.norm(remaining_error(TASK, TEST_POSE, TASK_WRENCH, fit.k, K0), axis=-1)
    C = A0 @ fit.covariance @ A0.T
    rho = compensation_accuracy(A0, fit.covariance)
    assert abs((errors**2).mean() - rho**2) < 5 * np.sqrt(2 * np.trace(C @ C) / N)
    low, high = error_quantiles(A0, fit.covariance, [0.025, 0.975])
    share = ((errors > low) & (errors < high)).mean()
    assert abs(share - 0.95) < 5 * np.sqrt(0.95 * 0.05 / N)


def test_calibration_on_the_equilibrium_adds_its_bias():
    """Where the measured robot is not linear, the mean square error is rho0^2 and the squared bias in the pose."""
    model, load, N = model_of((0.6115, 0.0, -0.460)), np.array([0, 0, -2500.0, 0, 0, 0]), 20_000
    q = np.random.default_rng(0).uniform(*TASK.robot.limits, size=(8, 6))
    bias = linearisation_bias(model, q, load, SIGMA, np.r_[0, K0])
    measured = equilibrium_deflection(model, q, load, np.r_[0, K0])
    noisy = measured + SIGMA * np.random.default_rng(6).standard_normal((N, *measured.shape))
    fit = estimate(plan(), noisy, SIGMA, TASK.parameters)
    squares = (remaining_error(TASK, TEST_POSE, TASK_WRENCH, fit.k, K0) ** 2).sum(axis=-1)
    A0 = TASK.regressor(TEST_POSE, TASK_WRENCH)
    expected = compensation_accuracy(A0, fit.covariance) ** 2 + bias.in_pose(A0) ** 2
    assert abs(squares.mean() - expected) < 5 * squares.std() / np.sqrt(N)
