"""Huber's estimate and its covariance."""

import pickle

import numpy as np
import pytest
from scipy.optimize import least_squares

from edtk.fit import fit_huber as module
from edtk.fit.fit_huber import CORNER, SigmaTooSmallError

pytestmark = pytest.mark.slow

M = 20
ROWS = 3
P = 3
RNG = np.random.default_rng(0)
X = RNG.normal(size=(M, ROWS, P)) / np.sqrt(M * ROWS)
TRUE = np.array([30.0, 20.0, 10.0])


def fit_huber(columns, y, start, known, least=-np.inf):
    """The fit with columns (m, rows, p), which it takes as orthonormal ones and a triangle."""
    Q, R = np.linalg.qr(columns.reshape(y.size, -1))
    return module.fit_huber(Q.reshape(columns.shape), R, y, start, known, least)


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


@pytest.mark.parametrize("least", [-np.inf, 0.0])
@pytest.mark.parametrize("tails", [1, 4])
@pytest.mark.parametrize("m", [2, 5, 20])
def test_least_loss(m, tails, least):
    """The loss is least: SciPy's trust region finds the same parameters, with and without a bound.

    With few measurements some steps of Newton's method do not lower the loss, or have no curvature.
    """
    rng = np.random.default_rng(m)
    for _ in range(8):
        columns = rng.normal(size=(m, ROWS, P)) / np.sqrt(m * ROWS)
        y = columns @ (TRUE * [1, -1, 1]) + rng.standard_t(tails, size=(m, ROWS))
        begin = np.maximum(start(y, columns), least)
        found = fit_huber(columns, y, begin, True, least)
        inner = begin if np.isneginf(least) else np.maximum(begin, 1e-6)
        other = least_squares(
            lambda x, X=columns, y=y: (X @ x - y).ravel(),
            inner,
            bounds=(least, np.inf),
            loss="huber",
            f_scale=CORNER,
            xtol=1e-13,
            ftol=1e-13,
            gtol=1e-13,
        )
        # At its least the loss is flat: parameters agree to the root of what it is known to.
        np.testing.assert_allclose(found.x, other.x, rtol=1e-5, atol=1e-4)
        r = y - columns @ found.x
        psi = np.clip(r, -CORNER, CORNER)
        assert (psi * (r - psi / 2)).sum() <= other.cost * (1 + 1e-9)


def test_few_passes_over_the_rows(monkeypatch):
    """A fit takes a handful of passes over the measurements, with a tenth of them outliers too."""
    passes = []
    local = module._local
    monkeypatch.setattr(module, "_local", lambda *args: passes.append(1) or local(*args))
    rng = np.random.default_rng(6)
    columns = rng.normal(size=(2000, ROWS, P)) / np.sqrt(2000 * ROWS)
    y = columns @ TRUE + rng.normal(size=(2000, ROWS))
    y[:200] += 100
    fit_huber(columns, y, start(y, columns), True)
    assert len(passes) <= 8


def test_scale_of_the_bulk():
    """A tenth of gross errors leaves the scale near that of the rest."""
    y = X @ TRUE + 0.5 * np.random.default_rng(5).normal(size=(M, ROWS))
    y[:6, 0] += 1000
    assert fit_huber(X, y, start(y), False).scale == pytest.approx(0.5, rel=0.4)


def test_sigma_that_is_far_too_small():
    """Where no residual is as small as sigma the error says the ratio, and survives pickling."""
    line = "^the smallest residual is 50 times sigma: expected a larger sigma$"
    with pytest.raises(SigmaTooSmallError, match=line) as caught:
        fit_huber(np.ones((2, 1, 1)), np.array([[0.0], [100.0]]), np.array([50.0]), True)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
