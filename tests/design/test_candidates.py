"""Sampling of the feasible set."""

import numpy as np
import pytest

from edtk.design import EmptyFeasibleSetError, sample_feasible
from edtk.model import Height, Radius, Tilt, Workspace, load_robot, transform

FREE = [1, 2, 3, 4, 5]
FIXED = np.array([0.3, 0, 0, 0, 0, 0])
ROBOT = load_robot("kuka_kr270").with_tool(transform((0.6115, 0.0, -0.460)))
WORKSPACE = Workspace(ROBOT, (Height(0.8), Radius(0.6), Tilt(np.pi / 6)))


def draw(n, seed=0, workspace=WORKSPACE, **options):
    return sample_feasible(workspace, n, np.random.default_rng(seed), FREE, FIXED, **options)


def test_all_feasible():
    """As many poses come as are asked for, and each satisfies every constraint."""
    q = draw(3000)
    assert q.shape == (3000, 6)
    assert WORKSPACE.contains(q).all()


def test_seeded():
    """The seed decides the sample, and a smaller sample is the head of a larger one."""
    np.testing.assert_array_equal(draw(500), draw(500))
    np.testing.assert_array_equal(draw(100), draw(500)[:100])
    assert (draw(5, seed=1) != draw(5)).any()


def test_fixed_joints_are_kept():
    """Joints that are not free keep their value; the others all vary."""
    q = draw(50)
    assert (q[:, 0] == FIXED[0]).all()
    assert (np.ptp(q[:, FREE], axis=0) > 0).all()


def test_uniform_where_nothing_constrains():
    """Without constraints each joint is uniform in its limits: its mean has standard error width/sqrt(12 n)."""
    n = 20_000
    lower, upper = ROBOT.limits[:, FREE]
    z = (draw(n, workspace=Workspace(ROBOT))[:, FREE].mean(axis=0) - (lower + upper) / 2) / (upper - lower)
    assert np.abs(z * np.sqrt(12 * n)).max() < 4.5


def test_empty_set_names_the_constraint():
    """Where no pose is feasible the constraint that excludes all of them is named."""
    workspace = Workspace(ROBOT, (Height(0.8), Height(9.0)))
    with pytest.raises(EmptyFeasibleSetError, match=r"height p_z > 9000 mm.*100 %"):
        draw(1, workspace=workspace, chunk=256, patience=3)


def test_none():
    """No poses are an empty array."""
    assert draw(0).shape == (0, 6)
