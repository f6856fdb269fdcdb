"""The accuracy after compensation: an expectation, and a criterion."""

import numpy as np
import pytest
from tasks import K0, SIGMA, TASK, TASK_WRENCH, TEST_POSE, plan

import criteria
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.measure.expected_error import compensation_accuracy


def test_accuracy_is_the_rms_error_of_repeated_calibrations():
    """Eq. (17) is the root mean square of |A0 (k_hat - k0)| over 20000 simulated calibrations.

    The squared error of a normal vector with covariance C has mean trace(C) and variance
    2 trace(C^2).
    """
    A = plan()
    A0 = TASK.regressor(TEST_POSE, TASK_WRENCH)
    N = 20_000
    result = estimate(
        A, simulate(A, K0, SIGMA, np.random.default_rng(2), runs=N), SIGMA, TASK.parameters
    )
    squares = (((result.k - K0) @ A0.T) ** 2).sum(axis=-1)
    C = A0 @ result.covariance @ A0.T
    rho = compensation_accuracy(A0, result.covariance)
    assert rho**2 == pytest.approx(np.trace(C), rel=1e-12)
    assert abs(squares.mean() - rho**2) < 5 * np.sqrt(2 * np.trace(C @ C) / N)


def test_accuracy_is_the_criterion_rho0():
    """A plan's accuracy in the test pose is the criterion's value of its information."""
    A = plan()
    A0 = TASK.regressor(TEST_POSE, TASK_WRENCH)
    M = np.einsum("mri,mrj->ij", A, A) / SIGMA**2
    cov = estimate(A, A @ K0, SIGMA, TASK.parameters).covariance
    value = criteria.create("rho0", target=A0).value(M)
    np.testing.assert_allclose(compensation_accuracy(A0, cov), value, rtol=1e-10)


def test_accuracy_of_a_batch_of_task_poses():
    """Several task poses at once give one accuracy each."""
    q = np.random.default_rng(3).uniform(*TASK.robot.limits, size=(2, 3, 6))
    A0 = TASK.regressor(q, TASK_WRENCH)
    cov = np.diag(K0**2)
    rho = compensation_accuracy(A0, cov)
    assert rho.shape == (2, 3)
    for i in np.ndindex(2, 3):
        assert rho[i] == pytest.approx(compensation_accuracy(A0[i], cov), rel=1e-13)
