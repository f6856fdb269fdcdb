"""Two duals from their difference."""

import numpy as np
import pytest
from matrices import positive

from criteria.linalg.inverse import whitener
from criteria.relaxable import SpectralBand
from edtk.design.relaxation.master_equations import definite_duals


@pytest.mark.parametrize("a", [0.0, 0.7])
def test_parts_of_a_multiplier(a):
    """They are semidefinite, without common direction, and of the length that is asked for."""
    rng = np.random.default_rng(0)
    R = whitener(positive(rng, 4))
    band = SpectralBand(a, 1.0, np.eye(4), R)
    near = rng.normal(size=(4, 4))
    near = near + near.T
    duals = definite_duals(band, near)
    assert duals.shape == (2 if a else 1, 4, 4)
    assert np.linalg.eigvalsh(duals).min() > -1e-12
    if a:
        assert np.trace(duals[1]) == pytest.approx(a)
        S = np.linalg.inv(R)
        np.testing.assert_allclose(S @ duals[0] @ S.T @ duals[1], 0, atol=1e-12)


def test_without_negative_part():
    """The dual of the upper bound then has all directions alike."""
    band = SpectralBand.of(2.0, 1.0, 3)
    duals = definite_duals(band, np.diag([1.0, 2.0, 0.0]))
    np.testing.assert_allclose(duals, [np.diag([1.0, 2.0, 0.0]), 2 / 3 * np.eye(3)])
