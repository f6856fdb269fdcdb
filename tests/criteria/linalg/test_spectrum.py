"""Extreme eigenvalues, whiteners and traces of powers, on matrices whose spectrum is known beforehand."""

import cvxpy as cp
import numpy as np
import pytest
from matrices import EPS, orthogonal, positive, slip, units, with_spectrum

from criteria.linalg.inverse import power_trace, whitener
from criteria.linalg.spectrum import (
    bounded_below,
    definite_parts,
    extreme_eigenvalues,
    largest_eigenvalue,
)

sizes = pytest.mark.parametrize("p", [1, 2, 3, 6, 9])
powers = pytest.mark.parametrize("exponent", [1 / 3, 0.5, 1.0])


@sizes
def test_whitener_whitens_in_any_units(p):
    """``T' M T = I`` to the rounding of a matrix of condition 1e4, whatever the units of the parameters are."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M = positive(rng, p, 1e4)
        for t in (np.ones(p), units(rng, p)):
            scaled = np.outer(t, t) * M
            T = whitener(scaled)
            np.testing.assert_allclose(T.T @ scaled @ T, np.eye(p), rtol=0, atol=slip(M))


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
    """As a cvxpy expression the largest eigenvalue is that in the original parameters, in units of the whitened."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M, N = positive(rng, p, 1e3), positive(rng, p, 1e3)
        T = whitener(N) @ orthogonal(rng, p)
        found = largest_eigenvalue(cp.Constant(0.5 * (T.T @ M @ T + (T.T @ M @ T).T)), T).value
        expected = np.linalg.eigvalsh(M)[-1] / np.linalg.eigvalsh(N)[-1]
        np.testing.assert_allclose(found, expected, rtol=slip(M, N) * np.linalg.cond(N))


@sizes
def test_bounded_below_means_the_least_eigenvalue_of_what_is_whitened(p):
    """The constraint holds just where the least eigenvalue is at least that of the whitened design.

    It is tried a part in a million to either side; in rounding it is off by about 64 p eps times both conditions.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M, N = positive(rng, p), positive(rng, p)
        T = whitener(N) @ orthogonal(rng, p)
        edge = M * np.linalg.eigvalsh(N)[0] / np.linalg.eigvalsh(M)[0]
        for factor, holds in ((1 + 1e-6, True), (1 - 1e-6, False)):
            X = cp.Variable((p, p), symmetric=True)
            Y = factor * T.T @ edge @ T
            X.value = 0.5 * (Y + Y.T)
            assert (bounded_below(X, T).violation() == 0) == holds


@sizes
def test_parts_of_an_indefinite_matrix(p):
    """The traces of both parts are the sums of the positive and of the negative eigenvalues, to their rounding."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        z = rng.normal(size=p)
        above, below = definite_parts(with_spectrum(rng, z))
        rounding = 64 * p * EPS * np.abs(z).max()
        assert abs(above - z[z > 0].sum()) <= rounding
        assert abs(below + z[z < 0].sum()) <= rounding


@sizes
def test_parts_are_never_on_the_lucky_side(p):
    """The positive part is not above what it is, nor the negative one below, of diagonals that have no rounding.

    That holds for a negative eigenvalue of 1e-22 as well: where the largest eigenvalue of a design is 1e22 times its
    least, the negative part counts as much as the positive one.
    """
    for seed in range(50):
        rng = np.random.default_rng(seed)
        for z in (rng.normal(size=p), rng.normal(size=p) * 10 ** rng.uniform(-22, 0, size=p)):
            above, below = definite_parts(np.diag(z))
            assert above <= np.maximum(z, 0).sum()
            assert below >= np.maximum(-z, 0).sum()


@sizes
def test_semidefinite_matrices_have_one_part(p):
    """Eigenvalues lost in rounding, as of a Gram matrix of low rank, are no negative part; nor any of -Z positive."""
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


@powers
@sizes
def test_power_trace_is_the_sum_of_powers(p, exponent):
    """``trace(Z^power)`` is the sum of the eigenvalues' powers: the least root is known to 64 p eps of the spread."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        z = 1e3 ** rng.uniform(-1, 1, size=p)
        np.testing.assert_allclose(
            power_trace(with_spectrum(rng, z), exponent), (z**exponent).sum(), rtol=1e6 * EPS * p
        )


@powers
@pytest.mark.parametrize("p", [2, 3, 6, 9])
def test_power_trace_of_low_rank_takes_no_roots_of_rounding(p, exponent):
    """Of low rank the trace is that of the singular values; roots of rounded zeros would add up to 1e-5 of it."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        s = rng.uniform(1, 2, size=rng.integers(1, p))
        B = orthogonal(rng, p)[:, : len(s)] * s
        found = power_trace(B @ B.T, exponent)
        np.testing.assert_allclose(found, (s ** (2 * exponent)).sum(), rtol=64 * p * EPS)


@powers
def test_power_trace_is_never_above_the_sum(exponent):
    """Small eigenvalues count at most as what they are, down to where rounding would be larger, and zero is zero."""
    for small in 10.0 ** np.arange(-20, 1):
        found = power_trace(np.diag([1.0, small]), exponent)
        assert 1 - 64 * EPS <= found <= (1 + small**exponent) * (1 + 4 * EPS)
    assert power_trace(np.zeros((2, 2)), exponent) == 0.0
