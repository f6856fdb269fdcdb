"""Fits in whitened units: correlated noise is that of turned, independent rows."""

import numpy as np
import pytest

from edtk.fit.correlated_noise import CorrelatedNoise, NoiseBlocks, whiten, whiten_columns
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import Estimate, Whitened, estimate
from edtk.fit.measurements import simulate
from edtk.fit.posterior import MeasuredRows
from edtk.fit.prior import HalfNormal, Prior, fit_with_prior

NAMES = ("a", "b", "c")
M = 12


def case(seed=0, turned=True):
    """Regressors, measured rows with one outlier, and noise: independent along turned axes."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((M, 3, 3))
    sigma = 10.0 ** rng.uniform(-2, 0, (M, 3))
    y = A @ np.array([3.0, 2.0, 5.0]) + sigma * rng.standard_normal((M, 3))
    y[4] += 30 * sigma[4]
    turn = np.linalg.qr(rng.standard_normal((M, 3, 3)))[0] if turned else np.eye(3)[None]
    noise = CorrelatedNoise.by_row(turn * sigma[:, None] ** 2 @ np.swapaxes(turn, 1, 2))
    return A, y, sigma, turn @ A, (turn @ y[..., None])[..., 0], noise


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("robust", [False, True])
def test_turned_axes_change_nothing_but_names(known, robust):
    """Least squares, its statistics and its outliers do not depend on the axes of measuring."""
    A, y, sigma, B, z, noise = case()
    one = identify(A, y, sigma, NAMES, known=known)
    other = identify(B, z, noise, NAMES, known=known)
    np.testing.assert_allclose(other.k, one.k, rtol=1e-10)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9, atol=1e-14)
    assert other.chi2 == pytest.approx(one.chi2, rel=1e-10)
    np.testing.assert_allclose(other.leverage.sum(axis=1), one.leverage.sum(axis=1), rtol=1e-9)
    assert other.outliers.tolist() == one.outliers.tolist() == [4]
    if robust:
        found = identify(B, z, noise, NAMES, robust=True, known=known)
        assert found.outliers.tolist() == [4]
        assert np.abs(found.k - [3, 2, 5]).max() < np.abs(one.k - [3, 2, 5]).max()


def test_a_diagonal_covariance_is_the_old_path():
    """Without correlations every statistic is that of standard deviations."""
    A, y, sigma, _, _, noise = case(turned=False)
    one = identify(A, y, sigma, NAMES)
    other = identify(A, y, noise, NAMES)
    for name in ("k", "covariance", "standardised", "leverage", "residual"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=1e-12)


def test_generalised_least_squares():
    """Aitken: ``k = (A' V^-1 A)^-1 A' V^-1 y`` with errors that whole groups share."""
    rng = np.random.default_rng(1)
    A = rng.standard_normal((6, 3, 3))
    y = rng.standard_normal((6, 3))
    members = rng.permutation(6).reshape(2, 3)
    root = rng.standard_normal((2, 9, 9))
    noise = CorrelatedNoise.of([NoiseBlocks(members, root @ np.swapaxes(root, 1, 2))], (6, 3))
    stacked = A[members].reshape(2, 9, 3)
    precision = np.linalg.inv(noise.blocks[0].covariance)
    M = np.einsum("gip,gij,gjq->pq", stacked, precision, stacked)
    h = np.einsum("gip,gij,gj->p", stacked, precision, y[members].reshape(2, 9))
    found = estimate(A, y, noise, NAMES)
    np.testing.assert_allclose(found.k, np.linalg.solve(M, h), rtol=1e-8)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(M), rtol=1e-8)


def test_one_measurement_less_lowers_the_sum_by_its_statistic():
    """Where groups share errors, T_i is the fall of chi-square when row i is left out."""
    rng = np.random.default_rng(2)
    A = rng.standard_normal((6, 3, 3))
    y = rng.standard_normal((6, 3))
    root = rng.standard_normal((2, 9, 9))
    noise = CorrelatedNoise.of(
        [NoiseBlocks(np.arange(6).reshape(2, 3), root @ np.swapaxes(root, 1, 2))], (6, 3)
    )
    whole = identify(A, y, noise, NAMES)
    whitened = Whitened.of(A, noise, NAMES)
    Q, d = whitened.deletable(whitened.in_sigma(whole.residual))
    for i in range(6):
        rest = np.delete(np.arange(6), i)
        left = identify(A[rest], y[rest], noise[rest], NAMES)
        T = d[i] @ np.linalg.solve(np.eye(3) - Q[i] @ Q[i].T, d[i])
        assert whole.chi2 - left.chi2 == pytest.approx(T, rel=1e-8)


def test_shift_of_some_measurements():
    """Its columns are those of a unit of each coordinate, whitened, in all rows where it shows."""
    members = np.array([[0, 3], [1, 2]])
    root = np.random.default_rng(3).standard_normal((2, 6, 6))
    noise = CorrelatedNoise.of([NoiseBlocks(members, root @ np.swapaxes(root, 1, 2))], (4, 3))
    A = np.random.default_rng(4).standard_normal((4, 3, 3))
    at, columns = Whitened.of(A, noise, NAMES).shift(np.array([3]))
    assert at.tolist() == [0, 3]
    unit = np.zeros((4, 3, 3))
    unit[3] = np.eye(3)
    np.testing.assert_allclose(columns, whiten_columns(unit, noise)[at], rtol=1e-12)


def test_priors_and_posteriors_see_whitened_rows():
    """A fit with a prior, its description and the sampled density do not depend on the axes."""
    A, y, sigma, B, z, noise = case()
    prior = Prior((HalfNormal(10.0),) * 3)
    one = fit_with_prior(A, y, sigma, NAMES, prior)
    other = fit_with_prior(B, z, noise, NAMES, prior)
    np.testing.assert_allclose(other.k, one.k, rtol=1e-10)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9, atol=1e-14)
    described = Identification.of_estimate(Estimate(other.k, other.covariance), B, z, noise, True)
    before = Identification.of_estimate(Estimate(one.k, one.covariance), A, y, sigma, True)
    assert described.chi2 == pytest.approx(before.chi2, rel=1e-9)
    seen = MeasuredRows.of(B, z, noise, other.k)
    assert seen.squares == pytest.approx(MeasuredRows.of(A, y, sigma, one.k).squares, rel=1e-9)


def test_simulated_errors_have_the_covariance():
    """Of 20000 runs the errors, whitened, have second moments within five standard errors."""
    _, _, _, B, _, noise = case()
    runs = 20_000
    measured = simulate(B, np.zeros(3), noise, np.random.default_rng(5), runs)
    z = whiten(measured, noise).reshape(runs, -1)
    moments = z.T @ z / runs - np.eye(z.shape[1])
    assert np.abs(moments).max() < 6 * np.sqrt(2 / runs)
