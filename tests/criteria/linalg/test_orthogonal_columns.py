"""Columns of very different lengths, turned until they are orthogonal."""

import numpy as np
import pytest

from criteria.linalg.spectrum import have_orthogonal_columns, orthogonal_columns

EPS = np.finfo(float).eps


@pytest.mark.parametrize("p", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("decades", [0, 6, 12, 30])
def test_lengths_are_singular_values(p, decades):
    """Of an orthogonal matrix times lengths, turned, the lengths come back with all digits."""
    rng = np.random.default_rng(p)
    U = np.linalg.qr(rng.normal(size=(p, p)))[0]
    lengths = 10.0 ** np.linspace(0, -decades, p)
    # Mixing by a matrix near the identity that is graded too: a long column has little of no other.
    L = np.tril(rng.normal(size=(p, p)), -1) * lengths[:, None] / lengths
    T = U * lengths @ (np.eye(p) + L).T
    found = orthogonal_columns(T)
    assert have_orthogonal_columns(found)
    # T'T and turned: the same determinant, and the same matrix T T'.
    scale = np.sqrt(np.diag(T @ T.T))
    difference = (found @ found.T - T @ T.T) / np.outer(scale, scale)
    assert np.abs(difference).max() <= 16 * p * EPS
    log = np.log(np.linalg.norm(found, axis=0)).sum()
    assert log == pytest.approx(np.log(lengths).sum(), abs=16 * p * EPS * max(decades, 1))


def test_orthogonal_columns_stay():
    """Nothing is done where nothing is to do."""
    T = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0] * [1e9, 1.0, 1e-3, 1e-20]
    assert have_orthogonal_columns(T)
    lengths = np.linalg.norm(T, axis=0)
    assert np.abs((orthogonal_columns(T) - T) / lengths).max() <= 16 * EPS


def test_others_are_not_taken_for_such():
    """Two short columns that are parallel are not orthogonal beside a long one."""
    T = np.array([[1.0, 0.0, 0.0], [0.0, 1e-9, 1e-9], [0.0, 0.0, 1e-18]])
    assert not have_orthogonal_columns(T)
    assert not have_orthogonal_columns(np.zeros((2, 2)))


def test_columns_whose_squares_multiply_beyond_doubles():
    """Long columns are turned as short ones, without a warning."""
    T = np.random.default_rng(0).normal(size=(3, 3))
    np.testing.assert_allclose(
        orthogonal_columns(1e120 * T) / 1e120, orthogonal_columns(T), rtol=1e-12
    )
