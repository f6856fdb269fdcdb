"""Experiments: information, slacks and their derivatives, in batches of any shape."""

import numpy as np
import pytest
from designs import LOADED

from edtk.design.candidate_source import sample_feasible
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad

pytestmark = pytest.mark.slow

on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)
moving = pytest.mark.parametrize(
    "space",
    [d for d in LOADED.values() if d.load.moves],
    ids=[name for name, d in LOADED.items() if d.load.moves],
)


@moving
def test_slope(space, derivative):
    """The derivative of <B, A/sigma> by every design variable is its finite difference.

    Truncation is h^4/30 of a fifth derivative, which for sines is of the size of A; by the load A
    is linear.
    """
    x = sample_feasible(space, 6, 1)
    assert space.size == len(space.fixed) + len(space.load.limits.T)
    for one in x:
        A = space.at(one).regressor
        B = np.random.default_rng(0).normal(size=A.shape) / np.abs(A).max(
            axis=1, keepdims=True
        )  # rows in m or rad
        slope = space.at(one).slope(B)
        assert slope.shape == (space.size,)
        expected = derivative(lambda y, B=B: np.array([(B * space.at(y).regressor).sum()]), one)[0]
        np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-9 * np.abs(slope).max())
        assert (np.abs(slope) > 1e-4 * np.abs(slope).max())[space.movable].all()


@moving
def test_slack_gradient(space, derivative):
    """The derivative of every slack is its finite difference, and each slack has a label."""
    here = space.at(x := sample_feasible(space, 30, 2))
    assert here.slack.shape == (30, len(space.labels))
    used = 0
    for one, slope in zip(x, here.slack_gradient, strict=True):
        if abs(space.workspace.robot.forward(one[:6])[2, 2]) > 0.8:  # near a pole of the tilt
            continue
        used += 1
        np.testing.assert_allclose(
            slope, derivative(lambda y: space.at(y).slack, one), rtol=0, atol=1e-8
        )
    assert used >= 5


@on_every_load
def test_experiments_of_any_shape(space):
    """Experiments in a batch of any shape are those one by one."""
    x = sample_feasible(space, 6, 3).reshape(2, 3, -1)
    whole = space.at(x)
    for i in np.ndindex(2, 3):
        one = space.at(x[i])
        assert whole.feasible[i] == one.feasible
        B = np.random.default_rng(1).normal(size=whole.regressor.shape)
        pairs = [(whole.slope(B)[i], one.slope(B[i]))]
        pairs += [
            (getattr(whole, name)[i], getattr(one, name))
            for name in ("regressor", "slack", "slack_gradient")
        ]
        for a, b in pairs:
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * np.abs(b).max(initial=1))
        np.testing.assert_allclose(
            whole.packed[:, *i], one.packed, rtol=0, atol=1e-13 * np.abs(one.packed).max()
        )


@on_every_load
def test_some_experiments(space):
    """What is chosen from experiments is, bit by bit, what they are when computed anew."""
    x = sample_feasible(space, 9, 4)
    chosen = np.array([7, 0, 0, 3])
    some = space.at(x)[chosen]
    anew = space.at(x[chosen])
    for name in ("x", "regressor", "packed", "slack", "slack_gradient", "feasible"):
        np.testing.assert_array_equal(getattr(some, name), getattr(anew, name))
    B = np.random.default_rng(0).normal(size=anew.regressor.shape)
    np.testing.assert_array_equal(some.slope(B), anew.slope(B))


@on_every_load
def test_feasible_means_bounds_and_constraints(space):
    """An experiment is feasible where no slack is negative and all variables are within bounds."""
    rng = np.random.default_rng(5)
    lower, upper = space.limits
    whole = sample_feasible(space, 300, 5)
    x = whole + 0.05 * (upper - lower) * rng.normal(size=whole.shape) * (
        rng.random(whole.shape) < 0.3
    )
    if isinstance(space.load, ListedLoad):
        x[:, -1] = whole[:, -1]
    n = len(space.fixed)
    force = np.linalg.norm(space.load.wrench(x[:, n:])[:, :3], axis=1)
    allowed = force <= space.load.largest if isinstance(space.load, FreeLoad) else True
    expected = (
        space.workspace.contains(x[:, :n]) & allowed & ((x >= lower) & (x <= upper)).all(axis=1)
    )
    assert 20 < expected.sum() < 280
    np.testing.assert_array_equal(space.at(x).feasible, expected)
    assert space.at(whole).feasible.all()
