"""Compensation of the deflection under load, and its accuracy."""

import numpy as np
import pytest

import criteria
from edtk.inference.compensation import compensated_joints, compensation_accuracy
from edtk.inference.estimate import estimate
from edtk.inference.simulate import simulate
from edtk.model import ElastostaticModel, load_robot, transform

K0 = np.array([0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
SIGMA = 0.03e-3
TASK_WRENCH = np.array([0.0, 280.0, -180.0, 5.0, -8.0, 3.0])
TEST_POSE = np.deg2rad([0, -56.9, 89.3, 45.1, 76, 57.2])


def model_of(tool, unknown=(1, 2, 3, 4, 5), rows="position"):
    return ElastostaticModel(load_robot("kuka_kr270").with_tool(transform(tool)), unknown, rows)


TASK = model_of((0.986, 0.0, 0.1))


def position_error(model, q0, wrench, k):
    """Distance of the loaded tool point from the desired one, with the compensated joints commanded."""
    q = compensated_joints(model, q0, wrench, k)
    return np.linalg.norm(
        model.robot.forward(q)[..., :3, 3] + model.regressor(q, wrench) @ k - model.robot.forward(q0)[..., :3, 3],
        axis=-1,
    )


def plan():
    q = np.random.default_rng(0).uniform(*TASK.robot.limits, size=(8, 6))
    return model_of((0.6115, 0.0, -0.460)).regressor(q, [0, 0, -2500.0, 0, 0, 0])


def test_error_after_compensation_is_of_second_order():
    """Halving the load quarters what compensation leaves, and it leaves far less than the deflection."""
    load = 10 * TASK_WRENCH
    whole, half, quarter = (position_error(TASK, TEST_POSE, f * load, K0) for f in (1.0, 0.5, 0.25))
    assert whole / half == pytest.approx(4.0, rel=0.05)
    assert half / quarter == pytest.approx(4.0, rel=0.025)
    assert whole < 0.05 * np.linalg.norm(TASK.deflection(TEST_POSE, load, K0))


def test_compensation_is_equation_15():
    """With six compliant joints the command is q0 - J0^-1 K_C^-1 W, by the Jacobian's inverse."""
    model, k = model_of((0.986, 0.0, 0.1), unknown=None, rows="pose"), np.r_[3.8e-6, K0]
    turn = np.linalg.solve(model.robot.jacobian(TEST_POSE), model.deflection(TEST_POSE, TASK_WRENCH, k))
    np.testing.assert_allclose(compensated_joints(model, TEST_POSE, TASK_WRENCH, k), TEST_POSE - turn, atol=1e-13)


def test_compensation_is_the_linear_solution_of_equation_14():
    """To first order the command moves the tool point by minus the deflection."""
    dq = compensated_joints(TASK, TEST_POSE, TASK_WRENCH, K0) - TEST_POSE
    moved = TASK.robot.jacobian(TEST_POSE)[:3] @ dq
    np.testing.assert_allclose(moved, -TASK.deflection(TEST_POSE, TASK_WRENCH, K0), rtol=1e-8, atol=1e-13)


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
    result = estimate(A, simulate(A, K0, SIGMA, np.random.default_rng(2), runs=N), SIGMA, TASK.parameters)
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
