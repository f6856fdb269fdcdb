"""The soft maximum: a little above the maximum, smooth, and safe at any size."""

import numpy as np
import pytest
from matrices import EPS

from criteria.linalg.logarithms import soft_maximum

sharpnesses = pytest.mark.parametrize("sharpness", [2.0, 8.0, 50.0, 1e4])


@sharpnesses
def test_soft_maximum_is_a_little_above_the_maximum(sharpness):
    """``max x <= f <= n^(1/s) max x`` on the last axis, with equality on the right for equals."""
    rng = np.random.default_rng(0)
    x = 10 ** rng.uniform(-3, 3, size=(5, 7, 6))
    f, u = soft_maximum(x, sharpness)
    top = x.max(axis=-1)
    assert f.shape == (5, 7)
    assert u.shape == x.shape
    assert (f >= top).all()
    assert (f <= 6 ** (1 / sharpness) * top * (1 + 8 * EPS)).all()
    equal, _ = soft_maximum(np.full(6, 3.0), sharpness)
    assert equal == pytest.approx(6 ** (1 / sharpness) * 3, rel=8 * EPS)


@pytest.mark.parametrize("sharpness", [2.0, 8.0, 50.0])
def test_derivatives_of_the_soft_maximum(sharpness, derivative):
    """They match finite differences, at equal numbers too, and f = sum u_i x_i by homogeneity.

    Truncation grows with the fifth power of the sharpness, so the step of 1e-3 shrinks with it;
    rounding then is 1e-11 at the sharpest.
    """
    for x in (np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 1.0]), np.ones(4)):
        f, u = soft_maximum(x, sharpness)
        numeric = derivative(lambda y: soft_maximum(y, sharpness)[0], x, 1e-3 * 2 / sharpness)
        np.testing.assert_allclose(u, numeric, rtol=0, atol=1e-9)
        assert u @ x == pytest.approx(f, rel=64 * sharpness * EPS)


def test_the_maximum_itself():
    """For infinite sharpness it is the maximum, with the derivative of one largest entry."""
    f, u = soft_maximum(np.array([[1.0, 3.0, 2.0], [2.0, 2.0, 2.0]]), np.inf)
    assert f.tolist() == [3.0, 2.0]
    assert u.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_soft_maximum_neither_overflows_nor_underflows(scale):
    """Powers are taken of ratios to the largest number, so that size does no harm."""
    x = np.array([1.0, 0.9, 1e-30])
    f, u = soft_maximum(scale * x, 1e4)
    assert f == pytest.approx(scale, rel=8 * EPS)
    np.testing.assert_allclose(u, soft_maximum(x, 1e4)[1], rtol=1e4 * 8 * EPS)
