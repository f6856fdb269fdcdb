"""Tasks: the target A0."""

from dataclasses import replace

import numpy as np
import pytest
from chains import mixed_chain

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.task import Task
from edtk.robots.rotations import transform
from edtk.robots.workspace import neighbourhood

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


@pytest.mark.parametrize("lever", [0.0, 0.4])
def test_the_target_of_a_neighbourhood_is_the_mean_square(lever):
    """|target dk|^2 is the mean of |A_i dk|^2 over the poses, in at most p rows."""
    rng = np.random.default_rng(4)
    q = rng.uniform(-1, 1, size=ROBOT.n)
    robust = replace(task(q), within=0.5, lever=lever)
    dk = rng.normal(size=2)
    poses = neighbourhood(ROBOT, q, 0.5)
    squares = np.square(robust.harm(poses) @ dk).sum(axis=-1)
    assert robust.target.shape == (2, 2)
    assert np.square(robust.target @ dk).sum() == pytest.approx(squares.mean(), rel=1e-12)
    np.testing.assert_array_equal(robust.regressor, task(q).target)


def test_a_rotation_counts_as_the_displacement_at_the_lever():
    """The squared error is |dp|^2 + lever^2 |phi|^2, of the six rows of the pose."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, size=ROBOT.n)
    dk = rng.normal(size=2)
    moved = ElastostaticModel(ROBOT.with_tool(TOOL), (0, 2), "pose").regressor(q, WRENCH) @ dk
    expected = np.hypot(np.linalg.norm(moved[:3]), 0.7 * np.linalg.norm(moved[3:]))
    assert np.linalg.norm(replace(task(q), lever=0.7).target @ dk) == pytest.approx(expected)
