"""Distances of poses over their revolute joints."""

import numpy as np

from edtk.robots.robot import joint_distance


def test_short_way_round():
    """Each difference is taken the short way round, and prismatic joints do not count."""
    q = np.array([[np.pi - 0.1, 5.0, 0.4], [0.0, 7.0, 0.0]])
    other = np.array([-np.pi + 0.2, 1.0, 0.0])
    away = joint_distance(q, other, np.array([False, True, False]))
    np.testing.assert_allclose(away, [0.5, np.pi - 0.2], rtol=1e-12)
