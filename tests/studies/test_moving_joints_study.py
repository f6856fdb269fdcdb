"""The study of joints that move: its sets are what it says, and its shares are counted right."""

import numpy as np
import pytest

pytestmark = pytest.mark.slow

ROBOT = "KR 270, 2500 N"


@pytest.fixture(scope="module")
def study(script):
    return script("moving_joints.py")


def test_markers_move_by_as_much_as_is_said(study):
    """Over some sets markers are off by 50 um, root mean square, beside the tracker's errors."""
    joints = study._joint_error(ROBOT)
    robot = study.robots()[ROBOT]
    data = [study._measured(robot, 1, joints, number) for number in range(3)]
    sizes = [np.sqrt(np.mean(one.sigma**2 - study.TRACKER**2)) for one in data]
    assert np.mean(sizes) == pytest.approx(study.MOVED, rel=0.3)


def test_one_case(study):
    """Two sets in which joints move: both are named, and nothing else is."""
    found = study.run_case(ROBOT, 1, True, 2)
    assert found.seen == 100
    assert found.blamed == 0
    assert found.tracker[0] == pytest.approx(1.0, abs=0.4)
    assert ROBOT in study.table([found])
