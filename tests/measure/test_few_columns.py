"""Columns of which each instrument has few, and covariances of few common causes: as matrices."""

import numpy as np
import pytest
from numpy.typing import NDArray

from edtk.measure.few_columns import Beside, FewColumns, between, inverse_of, sandwich
from edtk.measure.whitening import Precision, Scatter

Array = NDArray[np.float64]

VISITS = 6
SIZES = ((1, 9), (3, 3), (5, 6))  # instruments, and rows of each


def design_of(rng: np.random.Generator, instruments: int, d: int) -> Array:
    """Columns (m, r, p): four of all instruments, two of each, and one of the first two."""
    r = instruments * d
    X = np.zeros((VISITS, r, 4 + 2 * instruments + 1))
    X[..., :4] = rng.standard_normal((VISITS, r, 4))
    for i in range(instruments):
        own = slice(i * d, (i + 1) * d)
        X[:, own, 4 + 2 * i : 6 + 2 * i] = rng.standard_normal((VISITS, d, 2))
    X[:, : 2 * d, -1] = rng.standard_normal((VISITS, min(2 * d, r)))
    order = rng.permutation(X.shape[-1])
    return X[..., order]


def scatter_of(rng: np.random.Generator, instruments: int, d: int) -> Scatter:
    """Covariances of instruments that err apart, and of three common causes."""
    root = rng.standard_normal((VISITS, instruments, d, d))
    apart = root @ np.swapaxes(root, -1, -2) + 0.3 * np.eye(d)
    return Scatter(apart, 2 * rng.standard_normal((VISITS, instruments * d, 3)))


def summed(X: Array, M: Array, Y: Array) -> Array:
    """``sum_b X_b' M_b Y_b``."""
    return np.asarray(np.einsum("mrp,mrs,msq->pq", X, M, Y))


@pytest.mark.parametrize(("instruments", "d"), SIZES)
def test_sums_are_those_of_whole_matrices(instruments: int, d: int) -> None:
    """Inverses, information, sandwiches and what a fit leaves are those of the matrices V and X."""
    rng = np.random.default_rng(1)
    X, V, W = design_of(rng, instruments, d), *(scatter_of(rng, instruments, d) for _ in range(2))
    few = FewColumns.among(X, instruments)
    np.testing.assert_array_equal(few.dense, X)
    weights = W.inverse
    inverse = np.linalg.inv(W.dense)
    Y = rng.standard_normal((VISITS, instruments * d, 2))
    close = {"rtol": 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(weights.times(Y), inverse @ Y, **close)
    np.testing.assert_allclose(V.times(Y), V.dense @ Y, **close)
    np.testing.assert_allclose(V.variances, np.einsum("mrr->mr", V.dense), **close)
    assert weights.log_det == pytest.approx(np.linalg.slogdet(W.dense)[1].sum())
    M = summed(X, inverse, X)
    np.testing.assert_allclose(few.information(weights), M, **close)
    np.testing.assert_allclose(
        sandwich(few, weights, V), summed(X, inverse @ V.dense @ inverse, X), **close
    )
    K = Scatter(V.apart, V.together[..., :0])
    np.testing.assert_allclose(
        between(few, weights, K.apart)[0], summed(X, inverse @ K.dense @ inverse, X), **close
    )
    H, log = inverse_of(M)
    np.testing.assert_allclose(H, np.linalg.inv(M), **close)
    assert log == pytest.approx(np.linalg.slogdet(M)[1])
    by = Beside.of(few, W)
    left = Y - X @ H @ summed(X, inverse, Y)
    np.testing.assert_allclose(by.left(Y), left, **close)
    along = by.along(Y).sum(axis=0)
    np.testing.assert_allclose(along.T @ along, summed(Y - left, inverse, Y - left), **close)


@pytest.mark.parametrize(("instruments", "d"), SIZES)
def test_bases_span_the_columns(instruments: int, d: int) -> None:
    """Orthonormal columns span those of a design that depend on each other, and as many are zero.

    Turned rows, as few as there are columns, have the same squares.
    """
    rng = np.random.default_rng(2)
    X = design_of(rng, instruments, d)
    X = np.concatenate([X, X @ rng.standard_normal((X.shape[-1], 2))], axis=-1)
    few = FewColumns.among(X, instruments)
    flat = X.reshape(-1, X.shape[-1])
    R = few.compressed
    assert len(R) <= X.shape[-1]
    np.testing.assert_allclose(R.T @ R, flat.T @ flat, rtol=1e-10, atol=1e-10)
    basis = few.independent()
    Q = basis.dense.reshape(flat.shape)
    rank = np.linalg.matrix_rank(flat)
    assert basis.rank == rank == X.shape[-1] - 2
    whole = np.zeros(X.shape[-1])
    whole[np.flatnonzero(Q.any(axis=0))] = 1
    np.testing.assert_allclose(Q.T @ Q, np.diag(whole), atol=1e-12)
    np.testing.assert_allclose(Q @ (Q.T @ flat), flat, atol=1e-10)


def test_what_rounding_leaves_of_columns_is_none() -> None:
    """Where the instruments' own columns span all rows, shared ones add nothing."""
    rng = np.random.default_rng(2)
    X = np.zeros((1, 6, 10))
    X[..., :4] = rng.standard_normal((1, 6, 4))
    X[:, :3, 4:7] = rng.standard_normal((1, 3, 3))
    X[:, 3:, 7:] = rng.standard_normal((1, 3, 3))
    basis = FewColumns.among(X, 2).independent()
    assert basis.rank == 6
    np.testing.assert_allclose(basis.dense[0] @ basis.dense[0].T, np.eye(6), atol=1e-12)


def test_a_design_without_shared_columns_has_a_basis_too() -> None:
    """Each instrument's columns span what they do, and compressed rows have the same squares."""
    rng = np.random.default_rng(3)
    X = np.zeros((4, 6, 4))
    X[:, :3, :2] = rng.standard_normal((4, 3, 2))
    X[:, 3:, 2:] = rng.standard_normal((4, 3, 2))
    few = FewColumns.among(X, 2)
    assert few.independent().rank == 4
    rows = few.compressed
    np.testing.assert_allclose(rows.T @ rows, summed(X, np.tile(np.eye(6), (4, 1, 1)), X))


def test_places_of_markers_cost_what_their_rows_have() -> None:
    """Of 200 markers each row keeps the columns of all and three more, not those of all markers."""
    markers, of_all = 200, 24
    X = np.zeros((2, 3 * markers, of_all + 3 * markers), dtype=float)
    X[..., :of_all] = 1.0
    own = np.arange(3 * markers)
    X[:, own, of_all + own] = 1.0
    few = FewColumns.among(X, markers)
    assert few.part.shape == (2, markers, 3, of_all + 3)
    few = few.independent()
    assert few.part.size <= X.size / markers * (of_all + 3)
    weights = Precision(np.ones((2, markers, 3, 3)) + np.eye(3), np.zeros((2, 600, 0)), 0.0)
    assert few.information(weights).shape == (few.p, few.p)
