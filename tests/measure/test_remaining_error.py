"""What is left after compensation with compliances that were identified."""

import numpy as np
import pytest
from tasks import K0, SIGMA, TASK, TASK_WRENCH, TEST_POSE, model_of, plan

from edtk.fit.distributions import error_quantiles
from edtk.fit.equilibrium import equilibrium_deflection, linearisation_bias
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.measure.expected_error import compensation_accuracy, remaining_error

pytestmark = pytest.mark.slow


def test_calibrated_robot_is_as_accurate_as_promised():
    """Measured, identified and compensated 20000 times, the robot misses the pose by rho0.

    The mean square is rho0^2 within five Monte-Carlo errors, and the 95 % band holds 95 % of the
    errors; the noise is small enough that dk is small beside k, as Eq. (17) supposes.
    """
    A = plan()
    A0 = TASK.regressor(TEST_POSE, TASK_WRENCH)
    N = 20_000
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
    """A robot that is not linear adds its squared bias in the pose to the mean square error."""
    model = model_of((0.6115, 0.0, -0.460))
    load = np.array([0, 0, -2500.0, 0, 0, 0])
    N = 20_000
    q = np.random.default_rng(0).uniform(*TASK.robot.limits, size=(8, 6))
    bias = linearisation_bias(model, q, load, SIGMA, np.r_[0, K0])
    measured = equilibrium_deflection(model, q, load, np.r_[0, K0])
    noisy = measured + SIGMA * np.random.default_rng(6).standard_normal((N, *measured.shape))
    fit = estimate(plan(), noisy, SIGMA, TASK.parameters)
    squares = (remaining_error(TASK, TEST_POSE, TASK_WRENCH, fit.k, K0) ** 2).sum(axis=-1)
    A0 = TASK.regressor(TEST_POSE, TASK_WRENCH)
    expected = compensation_accuracy(A0, fit.covariance) ** 2 + bias.in_pose(A0) ** 2
    assert abs(squares.mean() - expected) < 5 * squares.std() / np.sqrt(N)
