"""Tails and quantiles beside those of scipy.stats."""

import numpy as np
import pytest
from scipy import stats

from edtk.fit.distributions import (
    chi_square_quantile,
    chi_square_tail,
    fisher_quantile,
    fisher_tail,
    poisson_tail,
    student_below,
    student_quantile,
)

X = np.concatenate([[0.0], np.logspace(-8, 3, 60)])
P = np.concatenate([np.logspace(-12, -1, 30), np.linspace(0.1, 1 - 1e-9, 40)])
DOF = [0.37, 1, 2, 3, 7, 31, 33.3, 4e5]


@pytest.mark.parametrize("dof", DOF)
def test_same_digits_as_scipy_stats(dof):
    """Every function gives the very numbers of scipy.stats, from far tails to the middle."""
    np.testing.assert_array_equal(chi_square_tail(X, dof), stats.chi2.sf(X, dof))
    np.testing.assert_array_equal(chi_square_quantile(P, dof), stats.chi2.ppf(P, dof))
    np.testing.assert_array_equal(student_quantile(P, dof), stats.t.ppf(P, dof))
    np.testing.assert_array_equal(student_below(-X, dof), stats.t.cdf(-X, dof))
    np.testing.assert_array_equal(
        poisson_tail(np.arange(9.0), dof), stats.poisson.sf(range(9), dof)
    )
    for n in (1, 2, 3, 6):
        np.testing.assert_array_equal(fisher_tail(X, n, dof), stats.f.sf(X, n, dof))
        np.testing.assert_array_equal(fisher_quantile(P, n, dof), stats.f.ppf(P, n, dof))


def test_student_with_infinite_degrees_of_freedom_is_normal():
    """Where sigma is known, intervals are those of the normal distribution."""
    np.testing.assert_array_equal(student_quantile(P, np.inf), stats.t.ppf(P, np.inf))
    np.testing.assert_array_equal(student_below(X, np.inf), stats.t.cdf(X, np.inf))
    np.testing.assert_allclose(student_quantile(P, np.inf), stats.norm.ppf(P), rtol=1e-12)
