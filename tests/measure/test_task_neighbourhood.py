"""The poses around a test pose."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.robots.workspace import neighbourhood

ROBOT = mixed_chain(5)
LOWER, UPPER = ROBOT.limits
RANGE = UPPER - LOWER
TRAVEL = np.where([joint.kind == "revolute" for joint in ROBOT.joints], 0.3, 0.3 / 6.283185 * RANGE)


@pytest.mark.parametrize("share", [0.5, 0.0, 1.0, 1.2])
def test_poses_fill_the_neighbourhood_as_far_as_the_limits_allow(share):
    """All poses are within reach of the test pose and, if it is, within the joint limits."""
    q = LOWER + share * RANGE
    poses = neighbourhood(ROBOT, q, 0.3)
    assert poses.shape == (255, ROBOT.n)
    np.testing.assert_array_equal(poses[0], q)
    assert (np.abs(poses - q) <= TRAVEL * (1 + 1e-6)).all()
    assert ((poses >= np.minimum(q, LOWER) - 1e-12) & (poses <= np.maximum(q, UPPER) + 1e-12)).all()
    low = np.minimum(q, np.maximum(LOWER, q - TRAVEL))
    high = np.maximum(q, np.minimum(UPPER, q + TRAVEL))
    spread = np.ptp(poses, axis=0)
    assert (spread > 0.97 * (high - low)).all()


def test_the_mean_of_anything_linear_is_that_of_the_middle():
    """Poses come in mirrored pairs: away from limits their mean is the test pose, exactly."""
    q = (LOWER + UPPER) / 2
    poses = neighbourhood(ROBOT, q, 0.2)
    np.testing.assert_allclose(poses.mean(axis=0), q, atol=1e-14)


def test_poses_are_even():
    """Each joint's values, and those of each pair of joints, fill their box like a uniform law."""
    q = (LOWER + UPPER) / 2
    unit = (neighbourhood(ROBOT, q, 0.3)[1:] - q) / TRAVEL
    np.testing.assert_allclose((unit**2).mean(axis=0), 1 / 3, atol=1e-4)
    np.testing.assert_allclose(3 * unit.T @ unit / len(unit), np.eye(ROBOT.n), atol=0.09)
