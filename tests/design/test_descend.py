"""Constrained descent: feasible, never worse, and at the projection where that is known."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS

from edtk.design import sample_feasible
from edtk.design.descend import descend
from edtk.model import Workspace

on_each = pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
TOLERANCE = 1e-10  # descend's own, on the objective


def distance_to(target):
    """Half the squared distance to target poses."""
    return lambda q: (0.5 * float(np.square(q - target).sum()), q - target)


@on_each
@pytest.mark.parametrize("k", [1, 3])
def test_the_nearest_point_of_the_joint_limits(design, k):
    """Without a workspace the poses nearest to any target are the target clipped to the limits, fixed joints aside.

    An objective that is TOLERANCE above its least value is sqrt(2 TOLERANCE) away from it, as its curvature is one.
    """
    box = replace(design, workspace=Workspace(design.workspace.robot))
    lower, upper = box.workspace.robot.limits
    rng = np.random.default_rng(k)
    start = sample_feasible(box, k, 0)
    target = rng.uniform(1.5 * lower, 1.5 * upper, size=start.shape)
    expected = start.copy()
    expected[:, box.free] = np.clip(target, lower, upper)[:, box.free]
    assert (expected != target)[:, box.free].any()
    end = descend(box, start, distance_to(target))
    np.testing.assert_allclose(end, expected, rtol=0, atol=np.sqrt(2 * TOLERANCE))
    assert box.workspace.contains(end).all()


@on_each
def test_a_feasible_target_nearby_is_reached(design):
    """A feasible pose among feasible neighbours is reached, with the workspace's constraints in place."""
    step, reached = 0.05, 0
    for target in sample_feasible(design, 40, 1):
        start = target.copy()
        start[design.free] += step * np.random.default_rng(reached).normal(size=len(design.free))
        if design.workspace.slack(target).min() < 4 * step or not design.workspace.contains(start):
            continue
        reached += 1
        end = descend(design, start[None], distance_to(target))
        np.testing.assert_allclose(end[0], target, rtol=0, atol=np.sqrt(2 * TOLERANCE))
    assert reached >= 5


@on_each
@pytest.mark.parametrize("iterations", [1, 5, 100])
def test_feasible_and_never_worse(design, iterations):
    """Whatever is minimised and however early it ends: feasible poses come back, none worse than where they began.

    The objectives: a slope that leads out of the feasible set, and the largest of several distances, which has kinks.
    """
    rng = np.random.default_rng(2)
    slope = rng.normal(size=(2, design.workspace.robot.n))

    def linear(q):
        return float((slope * q).sum()), slope

    targets = rng.uniform(*design.workspace.robot.limits, size=(4, design.workspace.robot.n))

    def farthest(q):
        away = np.square(q[:, None] - targets).sum(axis=-1)
        f = np.zeros_like(q)
        worst = np.unravel_index(away.argmax(), away.shape)
        f[worst[0]] = 2 * (q[worst[0]] - targets[worst[1]])
        return float(away.max()), f

    for objective in (linear, farthest):
        for seed in range(2):
            start = sample_feasible(design, 2, (seed, 2))
            kept = start.copy()
            end = descend(design, start, objective, iterations)
            np.testing.assert_array_equal(start, kept)
            assert design.workspace.contains(end).all()
            assert objective(end)[0] <= objective(start)[0]
            held = np.setdiff1d(np.arange(start.shape[1]), design.free)
            np.testing.assert_array_equal(end[:, held], start[:, held])


@on_each
def test_poses_move_together(design):
    """An objective that couples the poses is minimised over all of them: two poses pulled together meet."""
    start = sample_feasible(design, 1, 5)
    away = start.copy()
    away[0, design.free] += 0.02
    pair = np.concatenate([start, away])
    assert design.workspace.contains(pair).all()

    def apart(q):
        d = q[0] - q[1]
        return 0.5 * float(d @ d), np.stack([d, -d])

    end = descend(design, pair, apart)
    np.testing.assert_allclose(end[0], end[1], rtol=0, atol=np.sqrt(2 * TOLERANCE))


@on_each
def test_an_infeasible_start_becomes_feasible(design):
    """From outside the workspace the descent comes back inside, as nothing outside counts as better."""
    inside = sample_feasible(design, 1, 6)
    outside, rng = inside.copy(), np.random.default_rng(0)
    while design.workspace.contains(outside).all():
        outside[0, design.free] = inside[0, design.free] + 0.3 * rng.normal(size=len(design.free))
    assert design.workspace.contains(descend(design, outside, distance_to(inside))).all()


@on_each
def test_an_infinite_objective_leaves_the_start(design):
    """Where the objective is infinite everywhere the start comes back, without a warning."""
    start = sample_feasible(design, 2, 7)
    end = descend(design, start, lambda q: (np.inf, np.zeros_like(q)))
    np.testing.assert_array_equal(end, start)
