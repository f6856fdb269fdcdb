"""Noise that is correlated within groups of measurements: whitening, subsets and invariances."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from edtk.fit.correlated_noise import CorrelatedNoise, NoiseBlocks, NotPositiveDefiniteError

SIZES = (2, 2, 3, 1, 1)
ROWS = 3


def random_covariance(rng, n):
    """A covariance whose coordinates differ by powers of ten."""
    root = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-6, -3, n)[:, None]
    return root @ root.T


def noise_of(seed=0):
    """Groups of several sizes whose members are spread over the sheet, and the whole covariance."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(sum(SIZES))
    members = np.split(order, np.cumsum(SIZES)[:-1])
    covariances = [random_covariance(rng, ROWS * size) for size in SIZES]
    blocks = []
    for size in sorted(set(SIZES)):
        which = [i for i, one in enumerate(SIZES) if one == size]
        rows = np.stack([members[i] for i in which])
        blocks.append(NoiseBlocks(rows, np.stack([covariances[i] for i in which])))
    coordinates = (ROWS * order[:, None] + np.arange(ROWS)).ravel()
    whole = np.zeros((ROWS * len(order),) * 2)
    whole[np.ix_(coordinates, coordinates)] = block_diag(*covariances)
    return CorrelatedNoise.of(blocks, (len(order), ROWS)), whole


def matrix_of(apply, m):
    """The matrix of a linear map of measurements (m, rows)."""
    unit = np.eye(ROWS * m).reshape(-1, m, ROWS)
    return apply(unit).reshape(ROWS * m, ROWS * m).T


def test_whitening_is_a_root_of_the_precision():
    """W V W' = I, W' W = V^-1, and colouring is the inverse of whitening."""
    noise, V = noise_of()
    m = noise.shape[0]
    W = matrix_of(noise.whiten, m)
    np.testing.assert_allclose(W @ V @ W.T, np.eye(len(V)), atol=1e-9)
    np.testing.assert_allclose(matrix_of(noise.adjoint, m), W.T, rtol=1e-14)
    np.testing.assert_allclose(W @ matrix_of(noise.colour, m), np.eye(len(V)), atol=1e-9)
    np.testing.assert_allclose(noise.std.ravel(), np.sqrt(np.diag(V)), rtol=1e-14)
    precision = (W.T @ W).reshape(m, ROWS, m, ROWS)
    found = noise.precision()
    for i in range(m):
        np.testing.assert_allclose(found[i], precision[i, :, i], rtol=1e-10)


def test_without_correlations_it_divides_by_sigma():
    """Independent coordinates of any size are divided by their standard deviations."""
    rng = np.random.default_rng(1)
    sigma = 10.0 ** rng.uniform(-6, -3, (5, 3))
    noise = CorrelatedNoise.by_row(sigma[:, :, None] ** 2 * np.eye(3))
    x = rng.standard_normal((2, 5, 3))
    np.testing.assert_allclose(noise.whiten(x), x / sigma, rtol=1e-14)
    np.testing.assert_allclose(noise.colour(x), x * sigma, rtol=1e-14)


def test_the_order_of_rows_does_not_matter():
    """Whitened rows in another order are the whitened rows, in that order."""
    noise, _ = noise_of()
    x = np.random.default_rng(2).standard_normal(noise.shape)
    order = np.random.default_rng(3).permutation(len(x))
    np.testing.assert_allclose(noise[order].whiten(x[order]), noise.whiten(x)[order], rtol=1e-8)


def test_some_rows_have_the_covariance_of_these():
    """The noise of some measurements is that of their part of the whole matrix."""
    noise, V = noise_of()
    rows = np.array([6, 0, 3, 4])
    W = matrix_of(noise[rows].whiten, 4)
    at = (ROWS * rows[:, None] + np.arange(ROWS)).ravel()
    np.testing.assert_allclose(W @ V[np.ix_(at, at)] @ W.T, np.eye(12), atol=1e-9)
    assert noise[2:5].shape == (3, ROWS)


def test_company_is_whoever_shares_a_group():
    """All members of the groups that some rows are in, once each."""
    members = NoiseBlocks(np.array([[4, 0], [1, 3]]), np.tile(np.eye(6), (2, 1, 1)))
    alone = NoiseBlocks(np.array([[2]]), np.eye(3)[None])
    noise = CorrelatedNoise.of([members, alone], (5, 3))
    assert noise.company(np.array([0, 2])).tolist() == [0, 2, 4]


@pytest.mark.parametrize(
    "bad",
    [np.diag([1.0, 0.0, 1.0]), np.ones((3, 3)), np.array([[1.0, 2, 0], [2, 1, 0], [0, 0, 1]])],
)
def test_a_matrix_that_is_no_covariance(bad):
    """A variance of zero, errors that are one, and too large a covariance are refused."""
    with pytest.raises(NotPositiveDefiniteError, match="row 2") as caught:
        CorrelatedNoise.by_row(np.stack([np.eye(3), bad, np.eye(3)]))
    assert caught.value.row == 1
