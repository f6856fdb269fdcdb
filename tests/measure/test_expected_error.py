"""What accuracy to expect in a test pose, and around it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from chains import mixed_chain

from edtk.measure.expected_error import compensation_accuracy, expected_error
from edtk.measure.task import Task
from edtk.robots.rotations import transform

ROBOT = mixed_chain(5)
TASK = Task(
    q=np.full(ROBOT.n, 0.1),
    tool=transform([0.1, 0.2, -0.3]),
    wrench=np.array([300.0, -200.0, 500.0, 0.0, 0.0, 0.0]),
    robot=ROBOT,
    unknown=(0, 2),
)
COV = np.array([[2.0, 0.5], [0.5, 1.0]]) * 1e-14


@pytest.mark.parametrize("lever", [0.0, 0.3])
def test_the_mean_over_the_neighbourhood_is_its_rho0(lever):
    """With a neighbourhood of its own, rho0 of the task is the mean; without, the test pose's."""
    alone = replace(TASK, lever=lever)
    robust = replace(alone, within=np.deg2rad(30))
    found = expected_error(robust, COV)
    assert found.mean == pytest.approx(compensation_accuracy(robust.target, COV), rel=1e-12)
    assert found.test_pose == pytest.approx(compensation_accuracy(alone.target, COV), rel=1e-12)
    assert found.test_pose < found.largest > found.mean
    assert expected_error(alone, COV) == found, "without one, thirty degrees are shown"


def test_the_line_and_the_numbers():
    """One line in millimetres; plain numbers in metres."""
    found = expected_error(replace(TASK, lever=0.3, within=np.deg2rad(12.5)), COV)
    line = str(found)
    assert line.startswith(
        f"error by the noise alone: {1e3 * found.test_pose:.2g} mm in the test pose; "
    )
    assert f"within 12.5 deg of it {1e3 * found.mean:.2g} mm on average" in line
    angle = f"{np.rad2deg(found.rotation):.2g} deg in the test pose"
    assert line.endswith(f"mm at most; a rotation, {angle}, counts as at 300 mm")
    data = json.loads(json.dumps(found.to_dict()))
    assert data["largest"] == found.largest
    assert data["rotation"] == found.rotation
    assert data["within_deg"] == pytest.approx(12.5)
