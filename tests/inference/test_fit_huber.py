"""Huber's estimate and its covariance."""

import numpy as np
import pytest

from edtk.inference.fit_huber import CORNER, SigmaTooSmallError, fit_huber

M, ROWS, P = 20, 3, 3
RNG = np.random.default_rng(0)
X = RNG.normal(size=(M, ROWS, P)) / np.sqrt(M * ROWS)
TRUE = np.array([30.0, 20.0, 10.0])


def start(y):
    return np.linalg.lstsq(X.reshape(-1, P), y.ravel())[0]


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
    """The mean of the covariance over many runs is the estimates' scatter, within a tenth; it is unbiased."""
    rng, runs = np.random.default_rng(3), 800
    found = []
    for _ in range(runs):
        noise = rng.standard_t(3, size=(M, ROWS)) if tails else rng.normal(size=(M, ROWS))
        y = X @ TRUE + noise
        found.append(fit_huber(X, y, start(y), False))
    columns = X.reshape(-1, P)
    L = np.linalg.cholesky(np.linalg.inv(columns.T @ columns))
    z = np.linalg.solve(L, (np.array([fit.x for fit in found]) - TRUE).T)
    predicted = np.mean([fit.inflation for fit in found])
    assert np.abs(z.mean(axis=1)).max() < 5 * np.sqrt(predicted / runs)
    assert (z**2).mean() / predicted == pytest.approx(1, abs=0.1 + 4 * np.sqrt(2 / P / runs))


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
    """Where no residual is as small as sigma says that is said, and nothing is divided by zero."""
    with pytest.raises(SigmaTooSmallError, match="times sigma"):
        fit_huber(np.ones((2, 1, 1)), np.array([[0.0], [100.0]]), np.array([50.0]), True)
