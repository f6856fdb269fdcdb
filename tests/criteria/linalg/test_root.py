"""Roots of semidefinite matrices, singular ones and badly scaled ones included."""

import numpy as np
import pytest

from criteria.linalg.inverse import root


@pytest.mark.parametrize("rank", [0, 1, 3, 4])
def test_square_of_the_root(rank):
    """F'F is the matrix, entry by entry at the scale of its diagonal, in any units."""
    units = 10.0 ** np.array([-9, 0, 4, 11])
    B = np.random.default_rng(rank).normal(size=(rank, 4)) * units
    M = B.T @ B
    F = root(M)
    assert (np.abs(F.T @ F - M) <= 1e-14 * np.outer(units, units) * (1 + 4 * rank)).all()
