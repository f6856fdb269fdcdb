"""The guarded inverse: an inverse where there is one, and a mask where there is none."""

import numpy as np
import pytest
from matrices import EPS, positive, slip, units, with_spectrum

from criteria.linalg.inverse import guarded_inverse

sizes = pytest.mark.parametrize("p", [1, 2, 3, 6, 9])


def unit_diagonal(M):
    d = np.sqrt(np.diag(M))
    return M / np.outer(d, d)


@sizes
def test_regular_matrices_are_inverted_in_any_units(p):
    """``cov M = I`` to the rounding of a matrix of condition 1e4, once its units are taken away."""
    rng = np.random.default_rng(p)
    for _ in range(5):
        M, t = positive(rng, p, 1e4), units(rng, p)
        safe, cov, regular = guarded_inverse(M * np.outer(t, t))
        assert regular
        np.testing.assert_array_equal(safe, M * np.outer(t, t))
        np.testing.assert_allclose((cov * np.outer(t, t)) @ M, np.eye(p), rtol=0, atol=slip(M))


def test_singular_and_non_finite_members_of_a_batch():
    """They are marked, with the identity in their place and for their inverse; the others do not notice."""
    M = np.tile(positive(np.random.default_rng(0), 3), (5, 1, 1))
    M[1], M[2], M[3] = np.ones((3, 3)), 0.0, np.nan
    safe, cov, regular = guarded_inverse(M)
    assert regular.tolist() == [True, False, False, False, True]
    for members in (safe, cov):
        np.testing.assert_array_equal(members[~regular], np.tile(np.eye(3), (3, 1, 1)))
    np.testing.assert_array_equal(cov[regular], np.tile(guarded_inverse(M[0])[1], (2, 1, 1)))


@pytest.mark.parametrize("scaled", [False, True], ids=["good units", "bad units"])
@pytest.mark.parametrize("p", [2, 3, 6])
def test_a_larger_threshold_refuses_what_is_nearly_singular(p, scaled):
    """Regular are those whose least eigenvalue at unit diagonal is above the threshold, and above rounding anyway."""
    rng = np.random.default_rng(p)
    t = units(rng, p) if scaled else np.ones(p)
    for decades in range(1, 13):
        M = with_spectrum(rng, np.append(np.ones(p - 1), 10.0**-decades))
        smallest = float(np.linalg.eigvalsh(unit_diagonal(M))[0])
        for least in (0.0, 1e-6, 0.5 * smallest, 2 * smallest):
            expected = smallest > max(least, 16 * p * EPS)
            assert guarded_inverse(M * np.outer(t, t), least)[2] == expected


def test_the_threshold_is_never_below_rounding():
    """Asked for less than the rounding of a singular matrix, it is still marked as such."""
    A = np.random.default_rng(1).normal(size=(2, 4))
    for least in (0.0, 1e-30, -1.0):
        assert not guarded_inverse(A.T @ A, least)[2]
