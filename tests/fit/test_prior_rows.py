"""Rows of a prior below those of measurements are the prior's density, to the second order."""

import numpy as np
import pytest
from readings import STUDY, measured

from edtk.fit.correlated_noise import CorrelatedNoise, whiten
from edtk.fit.least_squares import Whitened
from edtk.fit.prior import Flat, HalfNormal, LogNormal, Normal, Prior, PriorRows, fit_with_prior

K = STUDY.compliances
NAMES = STUDY.model.parameters
DATA = measured()
A = DATA.regressor(STUDY.model)
EARLIER = Prior(
    (Flat(),) * 5, Normal(0.9 * K, np.diag((0.3 * K) ** 2) + np.outer(0.1 * K, 0.1 * K))
)


def test_an_earlier_calibration_is_exact():
    """The fit of all rows is that of measurements and prior together, with its covariance."""
    rows = PriorRows.near(EARLIER, K)
    noise = rows.noise_below(DATA.sigma, 3)
    whitened = Whitened.of(rows.below(A), noise, NAMES)
    found = fit_with_prior(A, DATA.deflection, DATA.sigma, NAMES, EARLIER)
    np.testing.assert_allclose(
        whitened.solve(rows.measured_below(DATA.deflection)), found.k, rtol=1e-9
    )
    np.testing.assert_allclose(whitened.covariance, found.covariance, rtol=1e-8)


def test_correlated_noise_is_whitened_above_and_left_below():
    """Rows of the prior have errors of size one, whatever those of the measurements are."""
    rows = PriorRows.near(EARLIER, K)
    blocks = np.tile(STUDY.sigma[0] ** 2 * (np.eye(3) + 0.5), (len(DATA), 1, 1))
    noise = CorrelatedNoise.by_row(blocks)
    both = whiten(rows.measured_below(DATA.deflection), rows.noise_below(noise, 3))
    np.testing.assert_allclose(both[: len(DATA)], noise.whiten(DATA.deflection))
    np.testing.assert_allclose(both[len(DATA) :].ravel()[:5], rows.values)


@pytest.mark.parametrize("factor", [1.05, 2.0])
def test_a_log_normal_has_its_gradient_and_precision(factor):
    """Value and slope of the sum of squares are those of minus two log densities of log k."""
    prior = Prior(tuple(LogNormal(1.1 * k, factor) for k in K))
    rows = PriorRows.near(prior, K)

    def misfit(k):
        return ((rows.rows @ k - rows.values) ** 2).sum()

    def exact(k):
        return ((np.log(k / (1.1 * K)) / np.log(factor)) ** 2).sum()

    assert misfit(K) == pytest.approx(exact(K))
    for step in 1e-6 * np.diag(K):
        slope = misfit(K + step) - misfit(K - step)
        assert slope == pytest.approx(exact(K + step) - exact(K - step), rel=1e-5)


def test_an_estimate_far_from_the_prior_is_no_place_to_linearise():
    """Where an estimate is negative, or far too small, the median takes its place."""
    prior = Prior((LogNormal(1e-6, 1.5), LogNormal(1e-6, 1.5)))
    rows = PriorRows.near(prior, np.array([-1e-6, 1e-12]))
    np.testing.assert_allclose(rows.rows @ np.full(2, 1e-6), rows.values)


def test_a_density_about_zero_is_only_a_help():
    """Flat and half-normal densities say nothing of a size; half-normal ones bound it if asked."""
    prior = Prior((Flat(), HalfNormal(2e-6)))
    rows = PriorRows.near(prior, np.ones(2))
    assert len(rows) == 0
    weak = PriorRows.near(prior.with_weak, np.ones(2))
    np.testing.assert_allclose(weak.rows, [[0, 0.5e6]])
    np.testing.assert_array_equal(weak.values, [0])
