"""Determinants of small matrices, written out."""

import numpy as np
import pytest
from matrices import positive

from criteria.linalg.logarithms import log_determinant


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_log_determinant_is_that_of_a_factorization(n):
    """``I + P`` with any P, also not symmetric: the same digits as numpy's, matrix by matrix."""
    rng = np.random.default_rng(n)
    M = np.stack([np.eye(n) + 10.0**k * positive(rng, n) for k in range(-6, 7)])
    M = np.concatenate([M, np.eye(n) + 0.1 * rng.uniform(size=(5, n, n))])
    expected = np.linalg.slogdet(M).logabsdet
    np.testing.assert_allclose(log_determinant(M), expected, rtol=1e-13, atol=1e-13)
    assert log_determinant(M[:, None]).shape == (len(M), 1)
