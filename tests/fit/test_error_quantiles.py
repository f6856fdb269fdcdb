"""Quantiles of |A dk| against closed forms and against drawn errors."""

import numpy as np
import pytest
from scipy.stats import chi2, f

from edtk.fit.distributions import _estimated, error_quantiles, weighted_chi_square_cdf


@pytest.mark.parametrize("r", [1, 2, 3, 6])
def test_equal_weights_are_a_chi_square(r):
    """With r weights l the distribution is l times a chi-square of r degrees, to 1e-12."""
    x = np.logspace(-6, 2, 40)
    np.testing.assert_allclose(
        weighted_chi_square_cdf(2.5 * x, np.full(r, 2.5)), chi2.cdf(x, r), atol=1e-12
    )


def test_pairs_of_weights_are_exponentials():
    """With weights a, a, b, b the tail is (a exp(-x/2a) - b exp(-x/2b)) / (a - b).

    So it is however far apart a and b are.
    """
    x = np.logspace(-4, 2, 30)
    for a, b in ((1.0, 0.5), (1.0, 1e-3), (1.0, 1e-9)):
        exact = 1 - (a * np.exp(-x / (2 * a)) - b * np.exp(-x / (2 * b))) / (a - b)
        np.testing.assert_allclose(weighted_chi_square_cdf(x, [a, a, b, b]), exact, atol=1e-12)


def test_quantiles_of_drawn_errors():
    """Of 400000 drawn errors the stated share lies below each quantile, within five errors."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(2, 3, 5))
    root = rng.normal(size=(5, 5)) * 1e-8
    A[1, 2] *= 1e-3
    levels = np.array([0.025, 0.5, 0.95, 0.975])
    found = error_quantiles(A, root @ root.T, levels)
    drawn = rng.normal(size=(400_000, 5)) @ root.T
    for pose in range(2):
        sizes = np.linalg.norm(drawn @ A[pose].T, axis=-1)
        share = (sizes[:, None] <= found[pose]).mean(axis=0)
        assert (np.abs(share - levels) < 5 * np.sqrt(levels * (1 - levels) / len(sizes))).all()


def test_one_direction_and_none():
    """An error along one line has the quantiles of |z|; a pose without sensitivity has zeros."""
    A = np.zeros((2, 3, 2))
    A[0, 0] = [3.0, 4.0]
    found = error_quantiles(A, np.eye(2), [0.025, 0.95])
    np.testing.assert_allclose(found[0], 5 * np.sqrt(chi2.ppf([0.025, 0.95], 1)), rtol=1e-9)
    assert not found[1].any()


@pytest.mark.parametrize(
    ("dof", "accuracy"), [(1.0, 1e-4), (2.8, 1e-4), (4.0, 1e-6), (30.0, 1e-11), (3e5, 1e-11)]
)
def test_estimated_noise_makes_an_f_law(dof, accuracy):
    """With equal eigenvalues the squares over an estimated noise follow Fisher's law."""
    scales, shares = _estimated(dof)
    for r in (1, 2, 3, 6):
        x = r * f.ppf([0.001, 0.025, 0.3, 0.5, 0.95, 0.975, 0.999], r, dof)
        found = weighted_chi_square_cdf(x[:, None] * scales, np.ones(r)) @ shares
        np.testing.assert_allclose(found, f.cdf(x / r, r, dof), atol=accuracy)


def test_quantiles_of_drawn_errors_with_estimated_noise():
    """The same holds of 400000 errors over an estimated noise."""
    rng = np.random.default_rng(1)
    dof = 4
    A = rng.normal(size=(3, 5))
    root = rng.normal(size=(5, 5)) * 1e-8
    levels = np.array([0.025, 0.5, 0.95, 0.975])
    found = error_quantiles(A[None], root @ root.T, levels, dof)[0]
    drawn = rng.normal(size=(400_000, 5)) @ root.T / np.sqrt(rng.chisquare(dof, (400_000, 1)) / dof)
    share = (np.linalg.norm(drawn @ A.T, axis=-1)[:, None] <= found).mean(axis=0)
    assert (np.abs(share - levels) < 5 * np.sqrt(levels * (1 - levels) / len(drawn))).all()
