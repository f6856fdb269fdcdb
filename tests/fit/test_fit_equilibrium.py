"""Compliances from measurements of a robot that is at rest under its load."""

import numpy as np
import pytest
from readings import STUDY

from edtk.fit.equilibrium import equilibrium_deflection, fit_equilibrium
from edtk.fit.identify import identify
from edtk.fit.measurements import Measurements

pytestmark = pytest.mark.slow

MODEL = STUDY.model
TRUE = np.zeros(6)
TRUE[MODEL.joints] = STUDY.compliances
LOAD = np.array([0, 0, -2500.0, 0, 0, 0])
SIGMA = 0.03e-3


def measure(seed, poses=60, sigma=SIGMA):
    """Random poses, measured in equilibrium."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(*MODEL.robot.limits, size=(poses, 6))
    wrench = np.tile(LOAD, (poses, 1))
    moved = equilibrium_deflection(MODEL, q, wrench, TRUE)
    moved = moved + sigma * rng.standard_normal(moved.shape)
    return Measurements(q, wrench, moved, np.full(moved.shape, SIGMA), np.zeros((poses, 3)))


def fits(data, **options):
    """The linear fit, and that of the equilibrium which starts from it."""
    A = data.regressor(MODEL)
    linear = identify(A, data.deflection, data.sigma, MODEL.parameters)
    start = np.zeros(6)
    start[MODEL.joints] = linear.unbounded
    return linear, fit_equilibrium(MODEL, data, start, **options)[1]


@pytest.mark.parametrize("robust", [False, True])
def test_without_noise_the_truth_comes_out(robust):
    """The linear fit is off by half a per cent, the fit of the equilibrium by rounding."""
    linear, found = fits(measure(0, sigma=0.0), robust=robust)
    assert np.abs(linear.k / STUDY.compliances - 1).max() > 0.005
    np.testing.assert_allclose(found.k, STUDY.compliances, rtol=1e-10)


def test_intervals_hold_the_truth_and_residuals_are_noise():
    """Of 100 fits of 60 poses 95 % of the intervals hold the truth; the linear model's do not."""
    pairs = [fits(measure(seed)) for seed in range(100)]
    held = np.array(
        [[np.abs(fit.k - STUDY.compliances) < fit.half_interval for fit in pair] for pair in pairs]
    )
    linear, found = held.mean(axis=(0, 2))
    # Binomial: five standard errors of 500 dependent intervals are 5 %.
    assert linear < 0.92
    assert found == pytest.approx(0.95, abs=0.03)
    p_values = np.array([[fit.p_value for fit in pair] for pair in pairs])
    assert (p_values[:, 0] < 0.01).mean() > 0.1
    assert (p_values[:, 1] < 0.01).mean() <= 0.04


def test_minimum_is_a_minimum():
    """No compliance a hundredth of a standard deviation away has a smaller sum of squares."""
    data = measure(1)
    found = fits(data)[1]

    def chi2(k):
        complete = np.zeros(6)
        complete[MODEL.joints] = k
        moved = equilibrium_deflection(MODEL, data.q, data.wrench, complete)
        return (((data.deflection - moved) / SIGMA) ** 2).sum()

    least = chi2(found.unbounded)
    assert least == pytest.approx(found.chi2, rel=1e-9)
    for step in np.vstack([np.eye(5), -np.eye(5)]) * found.std * 0.01:
        assert chi2(found.unbounded + step) > least
