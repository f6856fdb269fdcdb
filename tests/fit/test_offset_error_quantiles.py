"""Quantiles of |b + A dk| against closed forms."""

import numpy as np
import pytest
from scipy.stats import ncf, ncx2, norm

from edtk.fit.distributions import NormalMixture, error_quantiles

LEVELS = np.array([0.025, 0.5, 0.975])


def quantiles(b, V, dof=np.inf):
    """Quantiles of the lengths of errors about b with covariance V."""
    return NormalMixture.single(b, V, dof).quantiles(LEVELS)


@pytest.mark.parametrize("size", [0.1, 1.0, 4.0, 100.0])
def test_equal_eigenvalues_are_a_noncentral_chi_square(size):
    """With unit covariance the square of the error is a noncentral chi-square of three degrees."""
    b = size * np.array([[0.6, 0.0, -0.8]])
    found = quantiles(b, np.eye(3)[None])[0]
    np.testing.assert_allclose(found, np.sqrt(ncx2.ppf(LEVELS, 3, size**2)), rtol=6e-3)


def test_an_estimated_noise_makes_a_noncentral_f_law():
    """Noise of six degrees of freedom scales the spread, and leaves the offset as it is.

    For small offsets that is nearly a noncentral F, whose denominator scales both.
    """
    b = np.array([[0.1, 0.0, 0.0]])
    found = quantiles(b, np.eye(3)[None], dof=6)[0]
    np.testing.assert_allclose(found, np.sqrt(3 * ncf.ppf(LEVELS, 3, 6, 0.01)), rtol=0.01)


def test_one_direction():
    """An error along one line, off by b on it, is a folded normal variable."""
    A = np.zeros((1, 3, 1))
    A[0, :, 0] = [2.0, 0.0, 0.0]
    high = quantiles(np.array([[30.0, 0, 0]]), A @ np.swapaxes(A, 1, 2))[0]
    np.testing.assert_allclose(high, 30 + 2 * norm.ppf(LEVELS), rtol=1e-3)


def test_without_offset_nothing_changes():
    """Poses without an offset have the exact quantiles, and a small one changes them by little."""
    A = np.random.default_rng(0).normal(size=(2, 3, 4))
    b = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    exact = error_quantiles(A, np.eye(4), LEVELS)
    found = quantiles(b, A @ np.swapaxes(A, 1, 2))
    np.testing.assert_array_equal(found[0], exact[0])
    np.testing.assert_allclose(found[1], exact[1], rtol=6e-3)
