"""A problem of arrays: its information, and what it refuses."""

import numpy as np
import pytest

from edtk.design import Problem


@pytest.fixture
def blocks():
    return np.random.default_rng(0).normal(size=(7, 3, 4))


@pytest.mark.parametrize("sigma", [0.3, [0.1, 0.2, 0.7]], ids=["one", "per row"])
def test_information_is_the_sum_of_outer_products(blocks, sigma):
    """M = sum w_i A_i' A_i / sigma^2, row by row."""
    w = np.arange(7.0)
    s = np.broadcast_to(sigma, 3)
    rows = [(w[i], r, s[j]) for i, A in enumerate(blocks) for j, r in enumerate(A)]
    expected = sum(weight * np.outer(r, r) / sd**2 for weight, r, sd in rows)
    np.testing.assert_allclose(Problem(blocks, sigma).information(w), expected, rtol=1e-12)


def test_blocks_are_information_of_one_each(blocks):
    """The information of a unit weight is the candidate's own block, and p is the number of columns."""
    problem = Problem(blocks, 2.0)
    assert problem.p == 4
    for w, N in zip(np.eye(7), problem.information_blocks, strict=True):
        np.testing.assert_array_equal(problem.information(w), N)


def test_non_finite_block_is_named(blocks):
    """The message names the first block with an entry that is not finite."""
    blocks[[3, 5], 1, 2] = np.inf, np.nan
    with pytest.raises(ValueError, match="block 3 "):
        Problem(blocks)


@pytest.mark.parametrize("shape", [(3, 4), (0, 3, 4), (7, 3, 0)])
def test_shape(shape):
    """Anything but a non-empty array of three axes is refused."""
    with pytest.raises(ValueError, match="blocks must be"):
        Problem(np.ones(shape))


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, np.inf, [1.0, 1.0, 0.0]])
def test_sigma(blocks, sigma):
    """Noise that is not finite and positive is refused."""
    with pytest.raises(ValueError, match="sigma must be"):
        Problem(blocks, sigma)
