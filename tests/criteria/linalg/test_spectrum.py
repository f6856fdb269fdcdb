"""Eigenvalues, definite parts and constraints, on matrices whose spectrum is known."""

import cvxpy as cp
import numpy as np
import pytest
from matrices import EPS, orthogonal, positive, slip, with_spectrum

from criteria.linalg.inverse import whitener
from criteria.linalg.spectrum import (
    bounded_below,
    conjugate,
    definite_parts,
    extreme_eigenvalues,
    largest_eigenvalue,
)

sizes = pytest.mark.parametrize("p", [1, 2, 3, 6, 9])


@sizes
def test_extremes_are_those_of_what_is_whitened(p):
    """The extreme eigenvalues are read off any whitener, a rotated one too."""
    rng = np.random.default_rng(p)
    spectrum = np.geomspace(1e-3, 10.0, p)
    M = with_spectrum(rng, spectrum)
    for T in (whitener(M), whitener(M) @ orthogonal(rng, p)):
        np.testing.assert_allclose(extreme_eigenvalues(T), spectrum[[0, -1]], rtol=slip(M))


@sizes
def test_largest_eigenvalue_is_relative_to_what_is_whitened(p):
    """The cvxpy expression is the largest eigenvalue in the original parameters.

    Its unit is the largest eigenvalue of the whitened design.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M = positive(rng, p, 1e3)
        N = positive(rng, p, 1e3)
        T = whitener(N) @ orthogonal(rng, p)
        found = largest_eigenvalue(cp.Constant(0.5 * (T.T @ M @ T + (T.T @ M @ T).T)), T).value
        expected = np.linalg.eigvalsh(M)[-1] / np.linalg.eigvalsh(N)[-1]
        np.testing.assert_allclose(found, expected, rtol=slip(M, N) * np.linalg.cond(N))


@sizes
def test_bounded_below_means_the_least_eigenvalue_of_what_is_whitened(p):
    """The constraint holds just where the least eigenvalue is at least that of the whitened design.

    It is tried a part in a million to either side; rounding shifts it by about 64 p eps times both
    conditions.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M = positive(rng, p)
        N = positive(rng, p)
        T = whitener(N) @ orthogonal(rng, p)
        edge = M * np.linalg.eigvalsh(N)[0] / np.linalg.eigvalsh(M)[0]
        for factor, holds in ((1 + 1e-6, True), (1 - 1e-6, False)):
            X = cp.Variable((p, p), symmetric=True)
            Y = factor * T.T @ edge @ T
            X.value = 0.5 * (Y + Y.T)
            assert (bounded_below(X, T).violation() == 0) == holds


@sizes
def test_parts_of_an_indefinite_matrix(p):
    """The traces of both parts are the sums of the positive and of the negative eigenvalues."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        z = rng.normal(size=p)
        above, below = definite_parts(with_spectrum(rng, z))
        rounding = 64 * p * EPS * np.abs(z).max()
        assert abs(above - z[z > 0].sum()) <= rounding
        assert abs(below + z[z < 0].sum()) <= rounding


@sizes
def test_parts_are_never_on_the_lucky_side(p):
    """The positive part is never too large, and the negative part never too small.

    Diagonals show it, since they have no rounding. It holds for a negative eigenvalue of 1e-22 too:
    where the largest eigenvalue of a design is 1e22 times its least, the negative part counts as
    much as the positive one.
    """
    for seed in range(50):
        rng = np.random.default_rng(seed)
        for z in (rng.normal(size=p), rng.normal(size=p) * 10 ** rng.uniform(-22, 0, size=p)):
            above, below = definite_parts(np.diag(z))
            assert above <= np.maximum(z, 0).sum()
            assert below >= np.maximum(-z, 0).sum()


@sizes
def test_semidefinite_matrices_have_one_part(p):
    """Eigenvalues lost in rounding, as of a Gram matrix of low rank, are no negative part.

    Of -Z they are no positive part either.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        B = rng.normal(size=(p, rng.integers(1, p + 1)))
        assert definite_parts(B @ B.T)[1] == 0
        assert definite_parts(-B @ B.T)[0] <= 64 * p * EPS * np.linalg.norm(B, 2) ** 2
        assert definite_parts(-B @ B.T)[1] == pytest.approx(np.sum(B**2), rel=64 * p * EPS)


def test_parts_of_a_batch_and_of_nothing():
    """A stack gives what its members give, in the shape of the stack, and zero has no parts."""
    Z = np.array([[np.diag([1.0, -2.0]), np.zeros((2, 2)), np.diag([3.0, 4.0])]])
    above, below = definite_parts(Z)
    np.testing.assert_allclose(above, [[1, 0, 7]], rtol=64 * EPS)
    np.testing.assert_allclose(below, [[2, 0, 0]], rtol=64 * EPS)


def test_conjugate():
    """``V diag(d) V'``, also of stacks."""
    rng = np.random.default_rng(0)
    V = rng.normal(size=(3, 4, 4))
    d = rng.normal(size=(3, 4))
    for found, v, x in zip(conjugate(V, d), V, d, strict=True):
        np.testing.assert_allclose(
            found, v @ np.diag(x) @ v.T, rtol=0, atol=64 * EPS * np.abs(found).max()
        )
