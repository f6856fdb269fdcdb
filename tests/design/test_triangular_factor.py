"""The triangular factor of many rows, seen part by part."""

import numpy as np
import pytest

from edtk.design import conditioning as module
from edtk.design.conditioning import triangular_factor

EPS = np.finfo(float).eps


@pytest.mark.parametrize("n", [1, 3, 200])
def test_square_of_the_factor(monkeypatch, n):
    """R'R is the sum of B'B, in one part or in many, of fewer rows than columns too."""
    monkeypatch.setattr(module, "AT_ONCE", 60)
    rng = np.random.default_rng(n)
    A = rng.normal(size=(n, 4))
    extra = rng.normal(size=(2, 4))
    scale = np.array([1e-6, 1.0, 2.0, 1e8])
    R = triangular_factor([A * scale, extra * scale], scale)
    assert R.shape == (4, 4)
    np.testing.assert_array_equal(R, np.triu(R))
    expected = A.T @ A + extra.T @ extra
    np.testing.assert_allclose(R.T @ R, expected, atol=64 * EPS * np.abs(expected).max(), rtol=0)


def test_digits_that_squares_have_lost():
    """Columns that differ by 1e-10 have their least singular value to six digits; squares none."""
    rng = np.random.default_rng(0)
    common, other = np.linalg.qr(rng.normal(size=(5000, 2)))[0].T
    A = np.column_stack([common, common + 1e-10 * other])
    s = np.linalg.svd(triangular_factor([A], np.ones(2)), compute_uv=False)
    assert s[1] == pytest.approx(1e-10 / np.sqrt(2), rel=1e-5)
