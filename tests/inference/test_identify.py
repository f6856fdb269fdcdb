"""The laws that an identification obeys: its estimates, its covariance, its residuals and its intervals."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from edtk.inference.identify import NothingLeftError, identify
from edtk.inference.least_squares import SingularPlanError, covariance, estimate
from edtk.inference.simulate import simulate
from edtk.study.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLANS = STUDY.published_plans()
NAMES = STUDY.model.parameters
K0 = STUDY.compliances
S = STUDY.sigma[0]


def regressor(name="table_4_12"):
    plan = PLANS[name]
    return STUDY.model.regressor(plan.q, plan.wrench)


def fits(A, sigma, runs, seed, **options):
    sigma = np.broadcast_to(sigma, A.shape[:2])
    measured = simulate(A, K0, sigma, np.random.default_rng(seed), runs)
    return [identify(A, y, sigma, NAMES, **options) for y in measured]


@pytest.mark.parametrize("name", list(PLANS))
@pytest.mark.parametrize("robust", [False, True], ids=["squares", "Huber"])
def test_unbiased_with_the_covariance_of_eq_13(name, robust):
    """Over many runs of each published plan the estimates, whitened by Eq. (13), have mean zero and unit covariance.

    The mean has standard error 1/sqrt(N), the second moments sqrt(2/N) and 1/sqrt(N); each lies within five of these.
    Huber's estimates scatter more: their variance lies between that and a quarter more.
    """
    A, N = regressor(name), 150 if robust else 2000
    L = np.linalg.cholesky(covariance(np.einsum("mri,mrj->ij", A, A) / S**2, NAMES))
    k = np.array([fit.unbounded for fit in fits(A, S, N, 1, robust=robust)])
    z = np.linalg.solve(L, (k - K0).T)
    assert np.abs(z.mean(axis=1)).max() < 5 * 1.2 / np.sqrt(N)
    moments = z @ z.T / N
    if robust:
        assert 1 - 5 * np.sqrt(2 / N / 5) < np.trace(moments) / 5 < 1.25 + 5 * np.sqrt(2 / N / 5)
        return
    assert np.abs(np.diag(moments) - 1).max() < 5 * np.sqrt(2 / N)
    assert np.abs(moments - np.diag(np.diag(moments))).max() < 5 / np.sqrt(N)


def test_same_as_the_estimate():
    """Least squares is the plain estimate, with noise per row and coordinate too; the covariance is Eq. (13)."""
    A, sigma = regressor(), S * np.random.default_rng(2).uniform(0.5, 2, size=(12, 3))
    y = simulate(A, K0, sigma, np.random.default_rng(3))[0]
    fit, plain = identify(A, y, sigma, NAMES), estimate(A, y, sigma, NAMES)
    np.testing.assert_allclose(fit.k, plain.k, rtol=1e-12)
    M = np.einsum("mr,mri,mrj->ij", sigma**-2, A, A)
    np.testing.assert_allclose(fit.covariance @ M, np.eye(5), atol=1e-9)
    np.testing.assert_allclose(fit.correlation.diagonal(), 1.0, rtol=1e-12)


def test_residuals_are_orthogonal_and_leverages_sum_to_p():
    """Weighted residuals are orthogonal to all columns; leverages lie in [0, 1], sum to p, and are the hat diagonal."""
    A = regressor()
    fit = fits(A, S, 1, 4)[0]
    X, r = A.reshape(-1, 5) / S, fit.residual.ravel() / S
    np.testing.assert_allclose(
        X.T @ r / np.linalg.norm(X, axis=0) / np.linalg.norm(r), 0, atol=1e-12
    )
    assert fit.leverage.sum() == pytest.approx(5, rel=1e-12)
    np.testing.assert_allclose(fit.leverage.ravel(), np.diag(X @ np.linalg.pinv(X)), atol=1e-10)
    np.testing.assert_allclose(
        fit.standardised.ravel(), r / np.sqrt(1 - fit.leverage.ravel()), rtol=1e-12
    )
    assert fit.chi2 == pytest.approx(r @ r, rel=1e-12)


def test_p_values_are_uniform():
    """Over many runs the p-values of chi-square are uniform on [0, 1], and sigma is estimated without bias."""
    found = fits(regressor("table_4_4"), S, 1500, 5)
    assert kstest([fit.p_value for fit in found], "uniform").pvalue > 1e-3
    squares = np.array([fit.scale**2 for fit in found])
    dof = 12 - 5
    assert found[0].dof == dof
    assert abs(squares.mean() - 1) < 5 * np.sqrt(2 / dof / len(found))


def test_sigma_unknown_scales_the_covariance():
    """A wrong sigma does not matter where it is estimated: estimate, covariance and interval are the same."""
    A = regressor()
    y = simulate(A, K0, S, np.random.default_rng(6))[0]
    one = identify(A, y, np.full((12, 3), S), NAMES, known=False)
    other = identify(A, y, np.full((12, 3), 40 * S), NAMES, known=False)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9)
    np.testing.assert_allclose(other.standardised, one.standardised, rtol=1e-9)
    assert other.scale == pytest.approx(one.scale / 40)
    assert one.p_value is None
    (value, interval), (expected, between) = (
        other.accuracy(STUDY.target),
        one.accuracy(STUDY.target),
    )
    assert value == pytest.approx(expected)
    assert interval == pytest.approx(between)
    assert between[0] < expected < between[1]


def test_interval_of_rho0_covers_the_true_one():
    """The 95 % interval of rho0 covers Eq. (20)'s true value in 95 % of the runs; with sigma known it has no width."""
    A, runs = regressor("table_4_4"), 1000
    true, interval = fits(A, S, 1, 7)[0].accuracy(STUDY.target)
    assert interval == (true, true)
    hits = [
        low <= true <= high
        for _, (low, high) in (f.accuracy(STUDY.target) for f in fits(A, S, runs, 8, known=False))
    ]
    assert abs(np.mean(hits) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / runs)


def test_robust_fit_resists_gross_errors():
    """A few gross errors spoil least squares, and move Huber's estimate by about its standard deviation only."""
    A = np.tile(regressor(), (4, 1, 1))
    sigma = np.full(A.shape[:2], S)
    y = simulate(A, K0, sigma, np.random.default_rng(9))[0]
    y[[3, 17, 30], 2] += 100 * S
    squares, huber = (identify(A, y, sigma, NAMES, robust=r) for r in (False, True))
    assert np.abs((squares.k - K0) / squares.std).max() > 10
    assert np.abs((huber.k - K0) / huber.std).max() < 4
    assert huber.outliers.tolist() == [3, 17, 30]
    unknown = identify(A, y, sigma, NAMES, robust=True, known=False)
    assert unknown.outliers.tolist() == [3, 17, 30]
    assert 0.7 < unknown.scale < 1.4
    assert np.abs((unknown.k - K0) / unknown.std).max() < 4


@pytest.mark.parametrize("robust", [False, True], ids=["squares", "Huber"])
def test_negative_compliances(robust):
    """Where the best fit has a negative compliance, k is the best that has none, and the rest belongs to the former."""
    A = regressor()
    sigma = np.full((12, 3), S)
    y = simulate(A, K0 * [1, 1, -0.01, 1, 1], S, np.random.default_rng(10))[0]
    fit = identify(A, y, sigma, NAMES, robust)
    assert fit.negative.tolist() == [False, False, True, False, False]
    assert fit.unbounded[2] < 0 == fit.k[2]
    np.testing.assert_allclose(fit.residual, y - A @ fit.unbounded)
    if not robust:
        rest = estimate(A[..., [0, 1, 3, 4]], y, S, NAMES[:4])  # without k4 altogether
        np.testing.assert_allclose(fit.k[[0, 1, 3, 4]], rest.k, rtol=1e-10)


def test_exact_measurements():
    """Deflections without noise give the truth back, and rounding is not taken for outliers."""
    A = regressor()
    for options in ({}, {"robust": True}):
        fit = identify(A, A @ K0, np.full((12, 3), S), NAMES, **options)
        np.testing.assert_allclose(fit.k, K0, rtol=1e-10)
        assert not len(fit.outliers)
        with pytest.raises(NothingLeftError, match="fits the measurements exactly"):
            identify(A, A @ K0, np.full((12, 3), S), NAMES, known=False, **options)
    gross = A @ K0
    gross[[2, 7], 0] += 1e-3
    with pytest.raises(NothingLeftError, match="half of the measurements exactly"):
        identify(A, gross, np.full((12, 3), S), NAMES, known=False, robust=True)


def test_what_cannot_be_identified_is_named():
    """One pose leaves directions open, which the error names; so does a file without a degree of freedom left."""
    A = regressor("table_4_2")[:1]
    with pytest.raises(SingularPlanError, match=r"cannot identify .* along \(.*k\d [+-] "):
        identify(A, A @ K0, np.full((1, 3), S), NAMES)
    A = A[..., :3]
    exact = identify(A, A @ K0[:3], np.full((1, 3), S), NAMES[:3])
    assert exact.dof == 0
    assert exact.p_value is None
    assert not exact.standardised.any()
    with pytest.raises(NothingLeftError, match="3 measured coordinates for 3 parameters"):
        identify(A, A @ K0[:3], np.full((1, 3), S), NAMES[:3], known=False)


@pytest.mark.parametrize(
    ("known", "robust"), [(True, False), (False, False), (True, True), (False, True)]
)
def test_intervals_hold_the_truth(known, robust):
    """The 95 % intervals of the compliances hold the truth in 95 % of the runs, also of a plan of four poses."""
    A = regressor("table_4_4")
    runs = fits(A, S, 400, 11, known=known, robust=robust)
    held = np.mean([np.abs(fit.unbounded - K0) <= fit.half_interval for fit in runs])
    assert abs(held - 0.95) < (0.03 if robust else 4 * np.sqrt(0.95 * 0.05 / 400 / 3))


@pytest.mark.parametrize("known", [True, False])
def test_interval_of_the_accuracy_if_robust(known):
    """The interval of rho0 of a robust fit holds the accuracy of Huber's estimate in some 95 % of the runs."""
    A = regressor("table_4_12")
    runs = fits(A, S, 400, 12, known=known, robust=True)
    errors = [STUDY.target @ (fit.unbounded - K0) for fit in runs]
    true = np.sqrt(np.mean([e @ e for e in errors]))
    held = np.mean(
        [low <= true <= high for low, high in (fit.accuracy(STUDY.target)[1] for fit in runs)]
    )
    assert 0.9 < held < 0.99
