"""Whitening of correlated rows, component first."""

import numpy as np

from edtk.measure.whitening import Whitener

RNG = np.random.default_rng(1)
ROOTS = RNG.normal(size=(6, 7, 4, 2))
SIGMA = np.einsum("ik...,jk...->ij...", ROOTS, ROOTS)
A = RNG.normal(size=(5, 6, 4, 2))


def test_information():
    """The Gram matrix of whitened rows is A' Sigma^-1 A, and the triangle is Cholesky's."""
    whitener = Whitener.of(SIGMA)
    white = whitener.rows(A)
    for k in np.ndindex(4, 2):
        one = A[(..., *k)].T
        Sigma = SIGMA[(..., *k)]
        expected = one.T @ np.linalg.solve(Sigma, one)
        np.testing.assert_allclose(white[(..., *k)] @ white[(..., *k)].T, expected, rtol=1e-9)
        np.testing.assert_allclose(whitener.L[(..., *k)], np.linalg.cholesky(Sigma), rtol=1e-9)


def test_adjoint():
    """<B, L^-1 A> = <L^-T B, A>."""
    whitener = Whitener.of(SIGMA)
    B = RNG.normal(size=A.shape)
    left = (B * whitener.rows(A)).sum(axis=(0, 1))
    right = (whitener.transposed(B) * A).sum(axis=(0, 1))
    np.testing.assert_allclose(left, right, rtol=1e-10)


def test_one_covariance_for_all():
    """A covariance without the axes of the poses serves all of them."""
    whitener = Whitener.of(SIGMA[:, :, :1, :1])
    np.testing.assert_array_equal(whitener.rows(A)[..., :1, :1], whitener.rows(A[..., :1, :1]))
    assert whitener.transposed(A).shape == A.shape


def test_not_definite():
    """A covariance that is not positive definite is NaN, without a warning."""
    singular = np.ones((2, 2, 1))
    indefinite = np.array([[[1.0]], [[2.0]]]) * np.array([1.0, 1.0])[None, :, None]
    for Sigma in (singular, indefinite, -np.eye(2)[..., None]):
        assert not np.isfinite(Whitener.of(Sigma).rows(np.ones((1, 2, 1)))).all()
