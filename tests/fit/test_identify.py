"""The laws that an identification obeys: its estimates, its covariance and its residuals."""

import pickle

import numpy as np
import pytest
from scipy.stats import kstest
from simulated_fits import K0, NAMES, PLANS, SIGMA, STUDY, fits, regressor

from edtk.fit.identify import NothingLeftError, identify
from edtk.fit.least_squares import SingularPlanError, covariance, estimate
from edtk.fit.measurements import simulate

pytestmark = pytest.mark.slow

TWELVE = np.full((12, 3), SIGMA)


def measure(A, k=K0, sigma=SIGMA, seed=0):
    """One simulated run of a plan."""
    return simulate(A, k, sigma, np.random.default_rng(seed))[0]


@pytest.mark.parametrize("name", list(PLANS))
@pytest.mark.parametrize("robust", [False, True], ids=["squares", "Huber"])
def test_unbiased_with_the_covariance_of_eq_13(name, robust):
    """Over many runs of each published plan the whitened estimates are standard normal.

    Whitened by Eq. (13), the mean has standard error 1/sqrt(N), the second moments sqrt(2/N) and
    1/sqrt(N); each lies within five of these. Huber's estimates scatter more: their variance lies
    between that and a quarter more.
    """
    A = regressor(name)
    N = 100 if robust else 400
    L = np.linalg.cholesky(covariance(np.einsum("mri,mrj->ij", A, A) / SIGMA**2, NAMES))
    k = np.array([fit.unbounded for fit in fits(name, N, robust=robust)])
    z = np.linalg.solve(L, (k - K0).T)
    assert np.abs(z.mean(axis=1)).max() < 5 * 1.2 / np.sqrt(N)
    moments = z @ z.T / N
    if robust:
        assert 1 - 5 * np.sqrt(2 / N / 5) < np.trace(moments) / 5 < 1.25 + 5 * np.sqrt(2 / N / 5)
        return
    assert np.abs(np.diag(moments) - 1).max() < 5 * np.sqrt(2 / N)
    assert np.abs(moments - np.diag(np.diag(moments))).max() < 5 / np.sqrt(N)


@pytest.mark.parametrize(
    ("name", "low", "high"), [("table_4_2", 0.9, 0.99), ("table_4_4", 0.9, 0.98)]
)
def test_robust_intervals_of_few_poses(name, low, high):
    """Robust 95 % intervals with sigma estimated hold their level, with two poses and with four.

    A robust fit of two poses runs through five of the six coordinates: its scale is nothing, and
    intervals would cover none.
    """
    found = fits(name, 100, known=False, robust=True)
    error = np.abs(np.array([fit.unbounded for fit in found]) - K0)
    half = np.array([fit.half_interval for fit in found])
    assert low < (error <= half).mean() < high
    few = 3 * len(PLANS[name].q) <= 2 * len(NAMES)
    assert all(fit.too_few_for_robust == few != fit.robust for fit in found)


def test_same_as_the_estimate():
    """Least squares is the plain estimate, with noise per row and coordinate too, by Eq. (13)."""
    A = regressor()
    sigma = SIGMA * np.random.default_rng(2).uniform(0.5, 2, size=(12, 3))
    y = measure(A, sigma=sigma, seed=3)
    fit = identify(A, y, sigma, NAMES)
    np.testing.assert_allclose(fit.k, estimate(A, y, sigma, NAMES).k, rtol=1e-12)
    M = np.einsum("mr,mri,mrj->ij", sigma**-2, A, A)
    np.testing.assert_allclose(fit.covariance @ M, np.eye(5), atol=1e-9)
    np.testing.assert_allclose(fit.correlation.diagonal(), 1.0, rtol=1e-12)


def test_residuals_are_orthogonal_and_leverages_sum_to_p():
    """Weighted residuals are orthogonal to all columns; leverages are the hat matrix's diagonal."""
    fit = fits("table_4_12", 1)[0]
    X = regressor().reshape(-1, 5) / SIGMA
    r = fit.residual.ravel() / SIGMA
    cosines = X.T @ r / np.linalg.norm(X, axis=0) / np.linalg.norm(r)
    np.testing.assert_allclose(cosines, 0, atol=1e-12)
    assert fit.leverage.sum() == pytest.approx(5, rel=1e-12)
    leverage = fit.leverage.ravel()
    np.testing.assert_allclose(leverage, np.diag(X @ np.linalg.pinv(X)), atol=1e-10)
    np.testing.assert_allclose(fit.standardised.ravel(), r / np.sqrt(1 - leverage), rtol=1e-12)
    assert fit.chi2 == pytest.approx(r @ r, rel=1e-12)


def test_p_values_are_uniform():
    """Over many runs p-values of chi-square are uniform, and sigma is estimated without bias."""
    found = fits("table_4_4", 1500)
    assert kstest([fit.p_value for fit in found], "uniform").pvalue > 1e-3
    squares = np.array([fit.scale**2 for fit in found])
    dof = 12 - 5
    assert found[0].dof == dof
    assert abs(squares.mean() - 1) < 5 * np.sqrt(2 / dof / len(found))


def test_sigma_unknown_scales_the_covariance():
    """A wrong sigma does not matter where it is estimated: all that is stated stays the same."""
    A = regressor()
    y = measure(A, seed=6)
    one = identify(A, y, TWELVE, NAMES, known=False)
    other = identify(A, y, 40 * TWELVE, NAMES, known=False)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9)
    np.testing.assert_allclose(other.standardised, one.standardised, rtol=1e-9)
    assert other.scale == pytest.approx(one.scale / 40)
    assert one.p_value is None
    value, interval = other.accuracy(STUDY.target)
    expected, between = one.accuracy(STUDY.target)
    assert value == pytest.approx(expected)
    assert interval == pytest.approx(between)
    assert between[0] < expected < between[1]


def test_robust_fit_resists_gross_errors():
    """A few gross errors spoil least squares, and move Huber's estimate by about its own error."""
    A = np.tile(regressor(), (4, 1, 1))
    sigma = np.full(A.shape[:2], SIGMA)
    y = measure(A, sigma=sigma, seed=9)
    y[[3, 17, 30], 2] += 100 * SIGMA
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
    """Where the best fit has a negative compliance, k is the best fit that has none.

    Everything else belongs to the former, and the line that shows the result counts the zeros.
    """
    A = regressor()
    y = measure(A, K0 * [1, 1, -0.01, 1, 1], seed=10)
    fit = identify(A, y, TWELVE, NAMES, robust)
    assert fit.negative.tolist() == [False, False, True, False, False]
    assert fit.unbounded[2] < 0 == fit.k[2]
    np.testing.assert_allclose(fit.residual, y - A @ fit.unbounded)
    assert "1 of them zero" in repr(fit)
    far = identify(A, measure(A, K0 * [1, 1, -9, 1, 1], seed=10), TWELVE, NAMES, robust)
    low, high = far.interval
    assert ((low <= far.k) & (far.k <= high)).all()
    assert (np.abs(far.k - far.unbounded) > far.half_interval).sum() > 1  # it would be outside
    if not robust:
        rest = estimate(A[..., [0, 1, 3, 4]], y, SIGMA, NAMES[:4])  # without k4 altogether
        np.testing.assert_allclose(fit.k[[0, 1, 3, 4]], rest.k, rtol=1e-10)


def test_exact_measurements():
    """Deflections without noise give the truth back, and rounding is not taken for outliers."""
    A = regressor()
    for options in ({}, {"robust": True}):
        fit = identify(A, A @ K0, TWELVE, NAMES, **options)
        np.testing.assert_allclose(fit.k, K0, rtol=1e-10)
        assert not len(fit.outliers)
        with pytest.raises(NothingLeftError, match="fits the measurements exactly"):
            identify(A, A @ K0, TWELVE, NAMES, known=False, **options)
    gross = A @ K0
    gross[[2, 7], 0] += 1e-3
    with pytest.raises(NothingLeftError, match="half of the measurements exactly"):
        identify(A, gross, TWELVE, NAMES, known=False, robust=True)


def test_parameters_that_cannot_be_identified_are_named():
    """One pose leaves directions open, which the error names; so does one without freedom left."""
    A = regressor("table_4_2")[:1]
    sigma = np.full((1, 3), SIGMA)
    with pytest.raises(SingularPlanError, match=r"cannot identify .* along \(.*k\d [+-] ") as open_:
        identify(A, A @ K0, sigma, NAMES)
    assert set(open_.value.parameters) <= set(NAMES)
    assert len(open_.value.directions) == 2
    A = A[..., :3]
    exact = identify(A, A @ K0[:3], sigma, NAMES[:3])
    assert exact.dof == 0
    assert exact.p_value is None
    assert not exact.standardised.any()
    with pytest.raises(NothingLeftError, match="3 measured coordinates for 3 parameters") as left:
        identify(A, A @ K0[:3], sigma, NAMES[:3], known=False)
    for error in (open_.value, left.value):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)
