"""Outliers are found, and not invented."""

import numpy as np
import pytest
from scipy.stats import f, kstest

from edtk.fit.outliers import _deletion, find_outliers

M = 15
ROWS = 3
P = 4


def residuals(seed, runs=1, Q=None):
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=(M * ROWS, P)))[0] if Q is None else Q
    y = rng.normal(size=(runs, M * ROWS))
    return Q.reshape(M, ROWS, P), (y - (y @ Q) @ Q.T).reshape(runs, M, ROWS)


def test_deletion_is_what_the_sum_of_squares_loses():
    """T_i is the drop of the least sum of squares when row i is left out, from a fit without it."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(M, ROWS, P))
    y = rng.normal(size=(M, ROWS))

    def least(keep):
        A = X[keep].reshape(-1, P)
        b = y[keep].ravel()
        return np.sum((b - A @ np.linalg.lstsq(A, b)[0]) ** 2)

    Q = np.linalg.qr(X.reshape(-1, P))[0]
    z = (y.ravel() - Q @ (Q.T @ y.ravel())).reshape(M, ROWS)
    T, rank = _deletion(Q.reshape(M, ROWS, P), z)
    everything = np.arange(M)
    drops = [least(everything) - least(np.delete(everything, i)) for i in range(M)]
    np.testing.assert_allclose(T, drops, rtol=1e-9)
    assert (rank == ROWS).all()


def test_studentised_blocks_have_the_f_distribution():
    """The studentised block of one row has the F law with (r, dof - r) degrees of freedom."""
    Q, runs = residuals(1, runs=2000)
    dof = M * ROWS - P
    values = []
    for z in runs:
        T = _deletion(Q, z)[0][0]
        values.append((T / ROWS) / (((z**2).sum() - T) / (dof - ROWS)))
    assert kstest(values, f(ROWS, dof - ROWS).cdf).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("scale", [None, 1.0])
def test_false_alarms(scale):
    """In clean data anything at all is flagged in one run of a hundred, at most."""
    Q, runs = residuals(2, runs=3000)
    dof = np.inf if scale else M * ROWS - P
    alarms = np.mean([len(find_outliers(Q, z, dof, scale)) > 0 for z in runs])
    assert alarms < 0.01 + 4 * np.sqrt(0.01 / 3000)
    assert alarms > 0.004


def test_an_outlier_is_found_whatever_sigma():
    """One gross error is flagged alone, in whatever unit of noise."""
    Q, (z,) = residuals(3)
    y = z.copy()
    y[6] += 12
    flat = Q.reshape(-1, P)
    z = (y.ravel() - flat @ (flat.T @ y.ravel())).reshape(M, ROWS)
    for unit in (1, 1e-6, 1e6):
        assert find_outliers(Q, unit * z, M * ROWS - P).tolist() == [6]


def test_a_row_that_alone_tells_of_a_parameter_is_judged_by_the_rest():
    """A coordinate that the fit passes through takes a degree of freedom from its row.

    It is no outlier itself.
    """
    Q = np.zeros((M, ROWS, 2))
    Q[0, 0, 0] = 1.0
    Q[:, 1, 1] = 1 / np.sqrt(M)
    z = np.random.default_rng(4).normal(size=(M, ROWS))
    z[0, 0] = 0.0
    z[:, 1] -= z[:, 1].mean()
    T, rank = _deletion(Q, z)
    assert rank.tolist() == [2] + [3] * (M - 1)
    assert T[0] == pytest.approx(z[0, 1] ** 2 / (1 - 1 / M) + z[0, 2] ** 2)
    assert not len(find_outliers(Q, z, M * ROWS - 2))


def test_without_degrees_of_freedom_nothing_is_flagged():
    """Nothing can be said against a scatter that has no degrees of freedom."""
    Q, (z,) = residuals(5)
    assert not len(find_outliers(Q, z, ROWS))
