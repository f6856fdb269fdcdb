"""Tasks: the target A0, and joints that count as rigid."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.task import Task
from edtk.model.transform import transform

ROBOT = mixed_chain(5)
TOOL = transform([0.1, 0.2, -0.3], [0.3, 0.1, -0.2])
WRENCH = np.array([300.0, -200.0, 500.0, 10.0, -20.0, 30.0])


def task(q, wrench=WRENCH, unknown=(0, 2)):
    """A task of the mixed chain."""
    return Task(q=q, tool=TOOL, wrench=wrench, robot=ROBOT, unknown=unknown)


@pytest.mark.parametrize("batch", [(), (3,)])
def test_the_target_is_that_of_the_tasks_own_tool(batch):
    """A0 is Eq. (4) in the task's poses with its tool and load, not with the tool of the robot."""
    q = np.random.default_rng(0).uniform(-1, 1, size=(*batch, ROBOT.n))
    expected = ElastostaticModel(ROBOT.with_tool(TOOL), (0, 2)).regressor(q, WRENCH)
    assert expected.shape == (*batch, 3, 2)
    np.testing.assert_array_equal(task(q).target, expected)
    assert (ElastostaticModel(ROBOT, (0, 2)).regressor(q, WRENCH) != expected).any()


def test_one_load_for_all_poses_or_one_each():
    """The same load in every pose gives what a load a pose gives."""
    q = np.random.default_rng(1).uniform(-1, 1, size=(3, ROBOT.n))
    each = task(q, np.tile(WRENCH, (3, 1)))
    np.testing.assert_array_equal(task(q).target, each.target)
    assert task(q).rigid_joints == each.rigid_joints


def test_rigid_joints_are_revolute_and_not_known():
    """Joints count as rigid if no compliance is known; a prismatic one is not reported."""
    q = np.random.default_rng(2).uniform(-1, 1, size=ROBOT.n)
    assert [joint.name for joint in task(q).rigid_joints] == ["q4"]
    assert task(q, unknown=(0, 2, 3)).rigid_joints == ()
