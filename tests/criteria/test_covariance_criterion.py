"""Criteria of the covariance: what they promise to those who have no information at hand."""

import numpy as np
import pytest
from matrices import make, positive

import criteria
from criteria.criterion import CovarianceCriterion

NAMES = [n for n in criteria.available() if issubclass(criteria.get(n), CovarianceCriterion)]


def test_which_criteria_need_the_covariance_alone():
    """A, E, G and O5; D looks at the determinant of M."""
    assert NAMES == ["A", "E", "G", "O5"]


@pytest.mark.parametrize("name", NAMES)
def test_the_information_is_not_looked_at(name):
    """The cost is the same whatever is given in its place."""
    cov = positive(np.random.default_rng(0), 4)
    c = make(name, 4)
    without = c.cost_of_regular(np.full((4, 4), np.nan), cov)
    assert without == pytest.approx(c.cost(np.linalg.inv(cov)), rel=1e-12)


@pytest.mark.parametrize("sharpness", [np.inf, 20.0])
@pytest.mark.parametrize("name", NAMES)
def test_slope_by_the_covariance_gives_the_gradient(name, sharpness):
    """``-cov S cov`` is the gradient by M, for the criterion and for smooth ones near it."""
    M = positive(np.random.default_rng(1), 4)
    c = make(name, 4).smoothed(sharpness)
    cov = np.linalg.inv(M)
    gradient = -cov @ c.covariance_slope(cov) @ cov
    np.testing.assert_allclose(gradient, c.gradient(M), rtol=1e-9, atol=1e-12)
