"""Rotation vectors, against scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.robots.rotations import rotation_vector


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-5, 9e-3, 1.1e-2, 1.0, 3.0, np.pi - 1e-9])
def test_as_scipy(size):
    """From turns that vanish to half a turn, about axes in all directions, to the last digits."""
    axes = np.random.default_rng(0).normal(size=(200, 3))
    axes[:6] = np.vstack([np.eye(3), -np.eye(3)])
    r = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    R = np.moveaxis(Rotation.from_rotvec(r).as_matrix(), 0, -1)
    found = rotation_vector(R).T
    np.testing.assert_allclose(found, Rotation.from_rotvec(r).as_rotvec(), atol=4e-15, rtol=4e-15)


def test_any_batch():
    """One rotation, none, and many of them keep their shape."""
    R = Rotation.from_rotvec([[0.1, 0.2, -0.3]] * 6).as_matrix().transpose(1, 2, 0)
    assert rotation_vector(R[..., 0]) == pytest.approx([0.1, 0.2, -0.3], abs=1e-15)
    assert rotation_vector(R[..., :0]).shape == (3, 0)
    assert rotation_vector(R.reshape(3, 3, 2, 3))[:, 1, 2] == pytest.approx([0.1, 0.2, -0.3])
