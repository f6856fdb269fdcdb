"""The rows of some of very many poses."""

import numpy as np

from edtk.findings.match_plan import MOST_POSES, some_poses


def test_few_poses_are_all_taken():
    """All rows of poses that are not too many."""
    pose = np.repeat(np.arange(MOST_POSES), 2)
    np.testing.assert_array_equal(some_poses(pose), np.arange(2 * MOST_POSES))


def test_a_pose_comes_with_all_its_repetitions():
    """Of too many poses, every second with both its rows."""
    pose = np.repeat(np.arange(MOST_POSES + 1), 2)
    rows = some_poses(pose)
    np.testing.assert_array_equal(np.bincount(pose[rows])[::2], 2)
    np.testing.assert_array_equal(np.bincount(pose[rows])[1::2], 0)
