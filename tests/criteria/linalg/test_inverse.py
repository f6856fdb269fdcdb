"""Inverses, whiteners and traces of powers, which mark or survive what is lost in rounding."""

import numpy as np
import pytest
from matrices import EPS, orthogonal, positive, slip, units, with_spectrum

from criteria.linalg.inverse import (
    eigenpairs,
    guarded_inverse,
    power_trace,
    rounding_of_rows,
    whitener,
)

sizes = pytest.mark.parametrize("p", [1, 2, 3, 6, 9])
powers = pytest.mark.parametrize("exponent", [1 / 3, 0.5, 1.0])


def unit_diagonal(M):
    d = np.sqrt(np.diag(M))
    return M / np.outer(d, d)


@sizes
def test_regular_matrices_are_inverted_in_any_units(p):
    """``cov M = I`` to the rounding of a matrix of condition 1e4, once its units are taken away."""
    rng = np.random.default_rng(p)
    for _ in range(5):
        M = positive(rng, p, 1e4)
        t = units(rng, p)
        safe, cov, regular = guarded_inverse(M * np.outer(t, t))
        assert regular
        np.testing.assert_array_equal(safe, M * np.outer(t, t))
        np.testing.assert_allclose((cov * np.outer(t, t)) @ M, np.eye(p), rtol=0, atol=slip(M))


def test_singular_and_non_finite_members_of_a_batch():
    """Singular and non-finite members are marked; they and their inverses become the identity.

    The other members of the batch are what they would be alone.
    """
    M = np.tile(positive(np.random.default_rng(0), 3), (5, 1, 1))
    M[1] = np.ones((3, 3))
    M[2] = 0.0
    M[3] = np.nan
    safe, cov, regular = guarded_inverse(M)
    assert regular.tolist() == [True, False, False, False, True]
    for members in (safe, cov):
        np.testing.assert_array_equal(members[~regular], np.tile(np.eye(3), (3, 1, 1)))
    np.testing.assert_array_equal(cov[regular], np.tile(guarded_inverse(M[0])[1], (2, 1, 1)))


@pytest.mark.parametrize("scaled", [False, True], ids=["good units", "bad units"])
@pytest.mark.parametrize("p", [2, 3, 6])
def test_a_larger_threshold_refuses_what_is_nearly_singular(p, scaled):
    """Matrices are regular whose least eigenvalue at unit diagonal exceeds the threshold.

    It must exceed rounding in any case.
    """
    rng = np.random.default_rng(p)
    t = units(rng, p) if scaled else np.ones(p)
    for decades in range(1, 13):
        M = with_spectrum(rng, np.append(np.ones(p - 1), 10.0**-decades))
        smallest = float(np.linalg.eigvalsh(unit_diagonal(M))[0])
        for least in (0.0, 1e-6, 0.5 * smallest, 2 * smallest):
            expected = smallest > max(least, 16 * p * EPS)
            assert guarded_inverse(M * np.outer(t, t), least)[2] == expected


def test_the_threshold_is_never_below_rounding():
    """A singular matrix is marked as such, however small the threshold is."""
    A = np.random.default_rng(1).normal(size=(2, 4))
    for least in (0.0, 1e-30, -1.0):
        assert not guarded_inverse(A.T @ A, least)[2]


@sizes
def test_whitener_whitens_in_any_units(p):
    """``T' M T = I`` to the rounding of a matrix of condition 1e4, in any units."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        M = positive(rng, p, 1e4)
        for t in (np.ones(p), units(rng, p)):
            scaled = np.outer(t, t) * M
            T = whitener(scaled)
            np.testing.assert_allclose(T.T @ scaled @ T, np.eye(p), rtol=0, atol=slip(M))


@powers
@sizes
def test_power_trace_is_the_sum_of_powers(p, exponent):
    """``trace(Z^power)`` is the sum of the eigenvalues' powers.

    The least root is known to 64 p eps of the spread.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        z = 1e3 ** rng.uniform(-1, 1, size=p)
        np.testing.assert_allclose(
            power_trace(with_spectrum(rng, z), exponent), (z**exponent).sum(), rtol=1e6 * EPS * p
        )


@powers
@pytest.mark.parametrize("p", [2, 3, 6, 9])
def test_power_trace_of_low_rank_takes_no_roots_of_rounding(p, exponent):
    """Of low rank the trace is that of the nonzero singular values.

    Roots of rounded zeros would add up to 1e-5 of it.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        s = rng.uniform(1, 2, size=rng.integers(1, p))
        B = orthogonal(rng, p)[:, : len(s)] * s
        found = power_trace(B @ B.T, exponent)
        np.testing.assert_allclose(found, (s ** (2 * exponent)).sum(), rtol=64 * p * EPS)


@powers
def test_power_trace_is_never_above_the_sum(exponent):
    """Small eigenvalues never count for more than they are, and zero has no trace."""
    for small in 10.0 ** np.arange(-20, 1):
        found = power_trace(np.diag([1.0, small]), exponent)
        assert 1 - 64 * EPS <= found <= (1 + small**exponent) * (1 + 4 * EPS)
    assert power_trace(np.zeros((2, 2)), exponent) == 0.0


def test_rounding_of_many_sums_is_that_of_each():
    """Each sum has units of its own, and one of nothing loses nothing."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(5, 2, 4)) * 1e200 ** rng.uniform(-1, 1, (5, 1, 1))
    rows[2] = 0.0
    W = rng.normal(size=(4, 3))
    found = rounding_of_rows(rows, W)
    np.testing.assert_array_equal(found, [rounding_of_rows(one, W) for one in rows])
    assert found[2] == 0.0
    # Where both products cancel, all that is left is rounding.
    cancels = rounding_of_rows(np.array([[1.0, -1.0 + 1e-9]]), np.ones((2, 1)))
    assert cancels == pytest.approx(4 * EPS * 2e9, rel=1e-6)


@pytest.fixture
def failing(monkeypatch):
    """Divide and conquer that fails for stacks and for matrices of which the first entry is 7."""
    first = np.linalg.eigh

    def eigh(M):
        if M.ndim > 2 or M[0, 0] == 7.0:
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return first(M)

    monkeypatch.setattr(np.linalg, "eigh", eigh)


def test_eigenpairs_are_found_where_divide_and_conquer_fails(failing):
    """``V diag(r) V'`` is each matrix of a stack where LAPACK's first way fails for one of them."""
    rng = np.random.default_rng(1)
    stack = np.stack([positive(rng, 30, 1e4) for _ in range(3)])
    stack[1, 0, 0] = 7.0
    r, V = eigenpairs(stack)
    again = (V * r[:, None]) @ np.swapaxes(V, 1, 2)
    np.testing.assert_allclose(again, stack, rtol=0, atol=30 * EPS * np.linalg.norm(stack))
    assert (np.diff(r) >= 0).all()


def test_no_second_way_is_tried_to_eigenpairs_of_what_is_not_finite(failing):
    """Where the first way fails for a stack of NaN, its own error is what one sees."""
    with pytest.raises(np.linalg.LinAlgError, match="did not converge"):
        eigenpairs(np.full((2, 30, 30), np.nan))
