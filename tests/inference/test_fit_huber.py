"""Huber's estimate and its covariance."""

import pickle

import numpy as np
import pytest

from edtk.inference.fit_huber import CORNER, SigmaTooSmallError, fit_huber

pytestmark = pytest.mark.slow

M = 20
ROWS = 3
P = 3
RNG = np.random.default_rng(0)
X = RNG.normal(size=(M, ROWS, P)) / np.sqrt(M * ROWS)
TRUE = np.array([30.0, 20.0, 10.0])


def start(y, columns=X):
    return np.linalg.lstsq(columns.reshape(y.size, -1), y.ravel())[0]


@pytest.mark.parametrize("known", [True, False])
def test_estimating_equation(known):
    """Clipped residuals are orthogonal to the columns: sum psi(r) x = 0."""
    y = X @ TRUE + np.random.default_rng(1).standard_t(2, size=(M, ROWS))
    found = fit_huber(X, y, start(y), known)
    corner = CORNER * (1.0 if known else found.scale)
    psi = np.clip(y - X @ found.x, -corner, corner)
    np.testing.assert_allclose(np.einsum("mrp,mr->p", X, psi), 0, atol=1e-4 * corner)


def test_small_residuals_are_least_squares():
    """Where all residuals are within the corner the fit is that of least squares."""
    y = X @ TRUE + np.random.default_rng(2).uniform(-1, 1, size=(M, ROWS))
    np.testing.assert_allclose(fit_huber(X, y, start(y) + 0.1, True).x, start(y), rtol=1e-6)


@pytest.mark.parametrize("tails", [False, True], ids=["normal", "heavy tails"])
def test_covariance_is_that_of_repeated_fits(tails):
    """The mean of the covariance over many runs is the estimates' scatter, within a tenth.

    The estimates are unbiased: each parameter within five standard errors, and all together within
    the chi-square that chance exceeds once in a million. Of nine parameters with as many rows each
    as three have, a third of the runs tells as much.
    """
    p = 9
    m = 60
    runs = 270
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(m, ROWS, p)) / np.sqrt(m * ROWS)
    true = np.full(p, 20.0)
    found = []
    for _ in range(runs):
        noise = rng.standard_t(3, size=(m, ROWS)) if tails else rng.normal(size=(m, ROWS))
        y = columns @ true + noise
        found.append(fit_huber(columns, y, start(y, columns), False))
    flat = columns.reshape(-1, p)
    L = np.linalg.cholesky(np.linalg.inv(flat.T @ flat))
    z = np.linalg.solve(L, (np.array([fit.x for fit in found]) - true).T)
    predicted = np.mean([fit.inflation for fit in found])
    mean = z.mean(axis=1) * np.sqrt(runs / predicted)
    assert np.abs(mean).max() < 5
    assert mean @ mean < 47.9  # chi-square with 9 degrees of freedom, exceeded in 3e-7 of cases
    assert (z**2).mean() / predicted == pytest.approx(1, abs=0.1 + 4 * np.sqrt(2 / p / runs))


def test_bound():
    """Under a lower bound no parameter is below it, and those that want to be are on it exactly."""
    y = X @ (TRUE * [1, -1, 1]) + np.random.default_rng(4).normal(size=(M, ROWS))
    free = fit_huber(X, y, start(y), True)
    bound = fit_huber(X, y, np.maximum(start(y), 0), True, least=0.0)
    assert free.x[1] < 0 == bound.x[1]
    assert (bound.x[[0, 2]] > 0).all()


def test_scale_of_the_bulk():
    """A tenth of gross errors leaves the scale near that of the rest."""
    y = X @ TRUE + 0.5 * np.random.default_rng(5).normal(size=(M, ROWS))
    y[:6, 0] += 1000
    assert fit_huber(X, y, start(y), False).scale == pytest.approx(0.5, rel=0.4)


def test_sigma_that_is_far_too_small():
    """Where no residual is as small as sigma the error holds the ratio, and survives pickling."""
    with pytest.raises(SigmaTooSmallError, match="times sigma") as caught:
        fit_huber(np.ones((2, 1, 1)), np.array([[0.0], [100.0]]), np.array([50.0]), True)
    assert caught.value.ratio == 50
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
