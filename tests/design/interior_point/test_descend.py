"""Constrained descent: feasible, never worse, and at the projection where that is known.

Half the squared distance to a target is convex with curvature one. Over a convex set its minimiser
is the projection, and a point whose value is within `accuracy` of the least is within
sqrt(2 accuracy) of it.
"""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from designs import DESIGNS, LOADED

from edtk.design.candidate_source import sample_feasible
from edtk.design.interior_point.descend import descend as descended
from edtk.design.interior_point.objective import Local, Objective
from edtk.design.interior_point.step import Landscape
from edtk.robots.constraints.height import Height
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.workspace import Workspace

pytestmark = pytest.mark.slow

on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)
ACCURACY = 1e-9
NEAR = np.sqrt(2 * ACCURACY)


class Given(Objective):
    """An objective by a function: values (b,) and gradients (b, k, v) of experiments and starts."""

    def __init__(self, function):
        self.function = function

    def value(self, here, start):
        """What the function says."""
        return self.function(here, start)[0]

    def local(self, near, start):
        """Value and gradient of the function, and the differences of its gradient as what couples
        all variables.
        """
        b, k = near.x.shape[:2]
        d = len(near.span)
        h = 1e-6
        f, g = self.function(near.space.at(near.x), start)
        H = np.zeros((b, k, d, k, d))
        for i, a in np.ndindex(k, d):
            x = near.x.copy()
            x[:, i, near.space.movable[a]] += h * near.span[a]
            H[:, i, a] = near.first(self.function(near.space.at(x), start)[1] - g) / h
        H = H.reshape(b, k * d, k * d)
        own = np.zeros((b, k, d, d))
        return Local(f, near.first(g), own, 0.5 * (H + np.swapaxes(H, 1, 2)))


def descend(space, x, function, *arguments, **options):
    """The descent of an objective that is given by a function."""
    return descended(space, x, Given(function), *arguments, **options)


def distance_to(targets):
    """Half the squared distance of each start (b, k, v) to its targets (b, k, v)."""

    def objective(here, start):
        away = here.x - targets[start]
        return 0.5 * np.square(away).sum(axis=(1, 2)), away

    return objective


def groups(space, b, k, seed):
    """Feasible starts (b, k, v)."""
    return sample_feasible(space, b * k, seed).reshape(b, k, -1)


def held(space):
    """Indices of the variables that do not move."""
    return np.setdiff1d(np.arange(space.size), space.movable)


def values(objective, space, x):
    """Values (b,) of starts (b, k, v)."""
    return objective(space.at(x), np.arange(len(x)))[0]


def farthest(targets):
    """The largest squared distance to some experiments: it has kinks."""

    def objective(here, start):
        away = np.square(here.x[:, :, None] - targets).sum(axis=-1)
        rows = np.arange(len(away))
        worst = away.reshape(len(away), -1).argmax(axis=1)
        i, t = np.divmod(worst, len(targets))
        g = np.zeros_like(here.x)
        g[rows, i] = 2 * (here.x[rows, i] - targets[t])
        return away[rows, i, t], g

    return objective


def along(slope):
    """A linear objective: it leads out of the feasible set."""
    return lambda here, start: (
        (slope * here.x).sum(axis=(1, 2)),
        np.broadcast_to(slope, here.x.shape),
    )


@on_each
@pytest.mark.parametrize("k", [1, 3])
def test_the_nearest_point_of_the_joint_limits(space, k):
    """Without a workspace the nearest poses to any target are the target clipped to the limits."""
    box = replace(space, workspace=Workspace(space.workspace.robot))
    lower, upper = box.workspace.robot.limits
    start = groups(box, 6, k, 0)
    target = np.random.default_rng(k).uniform(1.5 * lower, 1.5 * upper, size=start.shape)
    expected = start.copy()
    expected[..., box.free] = np.clip(target, lower, upper)[..., box.free]
    assert (expected != target)[..., box.free].any()
    end = descend(box, start, distance_to(target), accuracy=ACCURACY)
    assert np.linalg.norm((end - expected).reshape(6, -1), axis=1).max() <= NEAR
    assert box.at(end).feasible.all()


@on_each
def test_the_nearest_force_of_a_ball(space):
    """The nearest force to a target outside the ball is the longest one in its direction."""
    ball = replace(space, workspace=Workspace(space.workspace.robot), load=FreeLoad(800.0))
    start = groups(ball, 8, 2, 1)
    n = len(space.fixed)
    rng = np.random.default_rng(1)
    unit = rng.normal(size=(8, 2, 3))
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    reach = rng.uniform(0.2, 3.0, size=(8, 2, 1))
    assert 2 < (reach > 1).sum() < 14

    def objective(here, which):
        u = here.x[..., n:]
        off = ball.load.wrench(u)[..., :3] / 800.0 - (reach * unit)[which]
        slope = np.zeros_like(here.x)
        slope[..., n:] = np.einsum(
            "bkf,bkfd->bkd", off, ball.load.derivative(u)[..., :3, :] / 800.0
        )
        return 0.5 * np.square(off).sum(axis=(1, 2)), slope

    end = descend(ball, start, objective, accuracy=ACCURACY)
    force = ball.load.wrench(end[..., n:])[..., :3] / 800.0
    assert (
        np.linalg.norm((force - np.minimum(reach, 1) * unit).reshape(8, -1), axis=1).max() <= NEAR
    )
    assert ball.at(end).feasible.all()


@on_each
@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8])
def test_accuracy_is_that_of_the_objective(space, accuracy):
    """Where the least value is known the answer exceeds it by no more than was asked for."""
    box = replace(space, workspace=Workspace(space.workspace.robot))
    lower, upper = box.workspace.robot.limits
    start = groups(box, 6, 2, 2)
    target = np.random.default_rng(3).uniform(1.5 * lower, 1.5 * upper, size=start.shape)
    best = start.copy()
    best[..., box.free] = np.clip(target, lower, upper)[..., box.free]
    objective = distance_to(target)
    excess = values(objective, box, descend(box, start, objective, accuracy=accuracy)) - values(
        objective, box, best
    )
    assert (excess <= accuracy).all()
    assert (excess >= -1e-12).all()


@on_each
def test_a_feasible_target_nearby_is_reached(space):
    """A feasible pose among feasible neighbours is reached, inside the workspace's constraints."""
    step = 0.05
    rng = np.random.default_rng(0)
    target = groups(space, 60, 1, 1)
    start = target.copy()
    start[..., space.free] += step * rng.normal(size=start[..., space.free].shape)
    room = (space.at(target).slack.min(axis=-1, initial=np.inf) > 4 * step) & space.at(
        start
    ).feasible
    start = start[room[:, 0]]
    target = target[room[:, 0]]
    assert len(start) >= 5
    end = descend(space, start, distance_to(target), accuracy=ACCURACY)
    assert np.linalg.norm((end - target)[:, 0], axis=-1).max() <= NEAR


@on_every_load
@pytest.mark.parametrize("iterations", [1, 5, 30])
def test_feasible_and_never_worse(space, iterations):
    """Feasible experiments come back, none worse than its start, whatever is minimised.

    However early the descent ends. Variables that do not move, such as the index of a listed
    wrench, keep their values.
    """
    rng = np.random.default_rng(2)
    targets = rng.uniform(*space.limits, size=(4, space.size))
    objectives = [along(rng.normal(size=(2, space.size))), farthest(targets)]
    for objective in objectives:
        start = groups(space, 4, 2, 2)
        before = start.copy()
        end = descend(space, start, objective, iterations)
        np.testing.assert_array_equal(start, before)
        assert space.at(end).feasible.all()
        assert (values(objective, space, end) <= values(objective, space, start)).all()
        assert (values(objective, space, end) < values(objective, space, start)).any()
        np.testing.assert_array_equal(end[..., held(space)], start[..., held(space)])
    if isinstance(space.load, ListedLoad):
        assert space.size - 1 in held(space)


@on_each
def test_experiments_of_a_start_move_together(space):
    """A start's experiments move together: two that are pulled towards each other meet."""
    start = groups(space, 20, 1, 5)
    away = start.copy()
    away[..., space.free] += 0.02
    pair = np.concatenate([start, away], axis=1)
    pair = pair[space.at(pair).feasible.all(axis=1)]
    assert len(pair) >= 5

    def apart(here, start):
        d = here.x[:, 0] - here.x[:, 1]
        return 0.5 * np.square(d).sum(axis=1), np.stack([d, -d], axis=1)

    end = descend(space, pair, apart, accuracy=ACCURACY)
    np.testing.assert_allclose(end[:, 0], end[:, 1], rtol=0, atol=NEAR)


@on_each
def test_an_infeasible_start_becomes_feasible(space):
    """A start outside comes inside, and one inside is not disturbed by those beside it."""
    inside = groups(space, 10, 1, 6)
    outside = inside.copy()
    rng = np.random.default_rng(0)
    for i in range(1, 10):
        while space.at(outside[i]).feasible.all():
            outside[i, 0, space.free] = inside[i, 0, space.free] + 0.3 * rng.normal(
                size=len(space.free)
            )
    end = descend(space, outside, distance_to(inside), accuracy=ACCURACY)
    assert space.at(end).feasible.all()
    assert np.linalg.norm(end[0] - inside[0]) <= NEAR


def test_what_cannot_be_mended_stays():
    """A start that cannot be made feasible comes back as it was."""
    space = replace(
        DESIGNS["kr270"], workspace=Workspace(DESIGNS["kr270"].workspace.robot, (Height(9.0),))
    )
    start = groups(DESIGNS["kr270"], 3, 2, 0)
    np.testing.assert_array_equal(descend(space, start, distance_to(0 * start)), start)


@on_each
def test_from_a_corner(space):
    """A start in a corner of the joints' box leaves it for a target inside."""
    box = replace(space, workspace=Workspace(space.workspace.robot))
    lower, upper = box.limits
    start = groups(box, 4, 1, 3)
    corner = start.copy()
    corner[:2, 0, box.free] = lower[box.free]
    corner[2:, 0, box.free] = upper[box.free]
    target = start.copy()
    target[..., box.free] = (0.9 * lower + 0.1 * upper)[box.free]
    assert box.at(corner).feasible.all()
    end = descend(box, corner, distance_to(target), accuracy=ACCURACY)
    assert np.linalg.norm((end - target)[:, 0], axis=-1).max() <= NEAR


@on_each
def test_few_steps_leave_the_feasible_set(space, monkeypatch):
    """Steps are as long as constraints allow to second order: nine in ten stay within them."""
    inside = []
    point = Landscape.point

    def looked(self, y, start):
        found = point(self, y, start)
        inside.extend((found.slack > 0).all(axis=(1, 2)))
        return found

    monkeypatch.setattr(Landscape, "point", looked)
    start = groups(space, 12, 2, 4)
    slope = np.random.default_rng(2).normal(size=start.shape[-1])
    descend(space, start, along(slope))
    assert np.mean(inside) > 0.9


@on_each
def test_an_infinite_objective_leaves_the_start(space):
    """A start of infinite value comes back, without a warning, and the others descend."""
    start = groups(space, 4, 2, 7)

    def objective(here, which):
        f, g = along(np.ones((2, space.size)))(here, which)
        return np.where(which == 2, np.inf, f), g

    end = descend(space, start, objective, 30)
    np.testing.assert_array_equal(end[2], start[2])
    assert all((end[i] != start[i]).any() for i in (0, 1, 3))
    everywhere = descend(
        space, start, lambda here, which: (np.full(len(which), np.inf), np.zeros_like(here.x))
    )
    np.testing.assert_array_equal(everywhere, start)


@on_each
def test_the_same_again(space):
    """The same batch gives the same answer, to the last bit."""
    start = groups(space, 5, 2, 8)
    objective = farthest(groups(space, 1, 4, 9)[0])
    np.testing.assert_array_equal(
        descend(space, start, objective, 30), descend(space, start, objective, 30)
    )


@on_each
def test_starts_do_not_see_each_other(space):
    """Each start ends where it ends alone, and the objective is told which starts it sees."""
    box = replace(space, workspace=Workspace(space.workspace.robot))
    start = groups(box, 5, 2, 8)
    target = start + np.array([0, 1e-3, 0.1, 1, 10])[:, None, None]
    together = descend(box, start, distance_to(target), accuracy=ACCURACY)
    for i in range(5):
        alone = descend(box, start[i : i + 1], distance_to(target[i : i + 1]), accuracy=ACCURACY)
        assert np.linalg.norm(together[i] - alone[0]) <= 2 * NEAR


def test_time_is_looked_at_before_each_step(monkeypatch):
    """A descent whose time is over ends with what it has: no worse, and feasible."""
    space = DESIGNS["kr270"]
    asked = []
    start = groups(space, 3, 2, 10)
    objective = along(np.ones((2, space.size)))

    def third():
        asked.append(None)
        return len(asked) == 3

    with monkeypatch.context() as patch:
        patch.setattr(import_module("edtk.design.interior_point.descend"), "out_of_time", third)
        end = descend(space, start, objective)
    assert len(asked) == 3
    np.testing.assert_array_equal(end, descend(space, start, objective, iterations=2))
    assert (end != descend(space, start, objective, iterations=9)).any()


@on_each
def test_nothing_to_do(space):
    """No starts, or none of the variables free: what was given comes back."""
    start = groups(space, 2, 1, 0)
    assert descend(space, start[:0], along(np.ones((1, space.size)))).shape == (0, 1, space.size)
    stiff = replace(space, free=[], fixed=start[0, 0, : len(space.fixed)])
    np.testing.assert_array_equal(descend(stiff, start, along(np.ones((1, space.size)))), start)
