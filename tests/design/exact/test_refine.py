"""Refinement of plans under constraints, many at once."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, LOADED, STUDY, log_cost_slope
from designs import KR270 as DESIGN
from pairs import some_pairs
from scipy.optimize import minimize, nnls

import criteria
from edtk.design.candidate_source import sample_feasible
from edtk.design.exact.refine import refine
from edtk.robots.constraints.height import Height
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.workspace import Workspace

pytestmark = pytest.mark.slow

every = pytest.mark.parametrize("name", criteria.available())
LARGEST = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])


def start_of(b, k, seed, space=DESIGN):
    """Design variables (b, k, v) and repetitions (b, k) of random plans."""
    return sample_feasible(space, b * k, seed).reshape(b, k, -1), np.tile(
        1.0 + np.arange(k) % 2, (b, 1)
    )


def cost(criterion, x, repeats, space=DESIGN):
    return criterion.cost(space.at(x).information(repeats))


@pytest.mark.parametrize(("name", "iterations"), some_pairs(criteria.available(), [25, 1]))
def test_never_worse_and_feasible(name, iterations):
    """Plans from feasible starts are feasible and no worse; fixed joints are kept."""
    criterion = STUDY.criterion(name)
    start, repeats = start_of(4, 3, 0)
    before = start.copy()
    x, costs = refine(DESIGN, criterion, start, repeats, iterations=iterations)
    np.testing.assert_array_equal(start, before)
    np.testing.assert_allclose(costs, cost(criterion, x, repeats), rtol=1e-12)
    assert (costs <= cost(criterion, start, repeats)).all()
    assert DESIGN.at(x).feasible.all()
    np.testing.assert_array_equal(x[..., 0], start[..., 0])


@pytest.mark.parametrize(
    ("name", "space"),
    some_pairs(criteria.available(), ["kr270 free", "odd fixed", "odd free"]),
)
def test_every_criterion_improves(name, space):
    """All random plans get better by a tenth, under every criterion, on any robot and load."""
    space = LOADED[space]
    criterion = STUDY.criterion(name) if space.model.p == 5 else criteria.create(name, np.eye(3, 4))
    start, repeats = start_of(3, 3, 1, space)
    x, costs = refine(space, criterion, start, repeats, iterations=20)
    assert (costs < 0.9 * cost(criterion, start, repeats, space)).all()
    assert space.at(x).feasible.all()


def test_singular_start_comes_back():
    """A singular start is returned without an error, and the other start is refined."""
    start, repeats = start_of(2, 3, 0)
    repeats[0] = [1, 0, 0]
    x, costs = refine(DESIGN, STUDY.criterion("D"), start, repeats)
    np.testing.assert_array_equal(x[0], start[0])
    assert costs[0] == np.inf
    assert costs[1] < cost(STUDY.criterion("D"), start, repeats)[1]


def test_infeasible_start_becomes_feasible():
    """A start outside the workspace is never better than the feasible plan that comes back."""
    start, repeats = start_of(1, 3, 0)
    start[0, 0, 2] += 0.6
    assert not DESIGN.at(start).feasible.all()
    x, costs = refine(DESIGN, STUDY.criterion("D"), start, repeats)
    assert DESIGN.at(x).feasible.all()
    assert np.isfinite(costs).all()


def test_what_cannot_be_mended_has_infinite_cost():
    """A plan with a pose outside that stays outside is not offered as a good one."""
    nowhere = replace(DESIGN, workspace=Workspace(DESIGN.workspace.robot, (Height(9.0),)))
    start, repeats = start_of(2, 3, 0)
    x, costs = refine(nowhere, STUDY.criterion("D"), start, repeats)
    np.testing.assert_array_equal(x, start)
    assert (costs == np.inf).all()


def test_smooth_optimum_is_stationary():
    """At a refined D plan the slope is a non-negative combination of the slopes of the active
    constraints.

    The descent ends where a step gains less than 1e-7, which leaves a slope of sqrt(2 * 1e-7 *
    curvature), the latter below 50 per squared radian.
    """
    criterion = STUDY.criterion("D")
    start, repeats = start_of(4, 3, 1)
    x, _ = refine(DESIGN, criterion, start, repeats, iterations=300)
    here = DESIGN.at(x)
    slope = log_cost_slope(DESIGN, criterion, x, repeats)[1]
    slack = here.slack
    G = here.slack_gradient
    lower, upper = DESIGN.limits
    walls = np.concatenate([np.eye(DESIGN.size), -np.eye(DESIGN.size)])
    for g, pose, s, rows in zip(
        *(a.reshape(12, *a.shape[2:]) for a in (slope, x, slack, G)), strict=True
    ):
        rows = np.concatenate([rows, walls])
        active = rows[np.concatenate([s, pose - lower, upper - pose]) < 1e-4][:, DESIGN.free]
        A = np.vstack([active, np.zeros((1, len(DESIGN.free)))]).T
        assert nnls(A, g)[1] < np.sqrt(2 * 1e-7 * 50)


def test_published_plan_of_four_is_improved():
    """The best of eight refined plans of four experiments beats that of Table 4 by 5 % in rho0."""
    criterion = STUDY.criterion("rho0")
    published = STUDY.published_plans()["table_4_4"]
    assert published.experiments == 4
    x, costs = refine(DESIGN, criterion, start_of(8, 4, 0)[0], np.ones((8, 4)))
    assert DESIGN.at(x[costs.argmin()]).feasible.all()
    assert costs.min() < 0.95 * float(criterion.cost(DESIGN.information(published)))


def slsqp(space, criterion, x, repeats):
    """The cost of the best feasible iterate of scipy's SLSQP from the same start."""
    move = np.ix_(range(len(x)), space.movable)
    shape = (len(x), len(space.movable))
    best = [np.inf]

    def full(y):
        whole = x.copy()
        whole[move] = y.reshape(shape)
        return whole

    def f(y):
        here = space.at(full(y)[None])
        M = here.information(repeats[None])
        value = float(np.log(criterion.cost(M))[0])
        if here.feasible.all():
            best.append(value)
        if not np.isfinite(value):
            return 1e3, np.zeros(y.shape)
        G = criterion.gradient(M) / np.exp(value)
        slope = here.slope(2 * repeats[:, None, None] * (here.regressor @ G[:, None]))
        return value, slope[0][..., space.movable].ravel()

    def slack(y):
        return space.at(full(y)).slack.ravel()

    def slack_gradient(y):
        G = space.at(full(y)).slack_gradient[..., space.movable]
        J = np.zeros((*G.shape[:2], *shape))
        J[np.arange(len(x)), :, np.arange(len(x))] = G
        return J.reshape(-1, np.prod(shape))

    minimize(
        f,
        x[move].ravel(),
        jac=True,
        method="SLSQP",
        bounds=np.tile(space.limits[:, space.movable].T, (len(x), 1)),
        constraints={"type": "ineq", "fun": slack, "jac": slack_gradient},
        options={"maxiter": 300, "ftol": 1e-10},
    )
    return np.exp(min(best))


@pytest.mark.parametrize("name", ["A", "D", "O5", "rho0"])
def test_against_slsqp(name):
    """From half of the same starts at least, scipy's SLSQP ends no lower than we do, to 1e-4.

    Two descents may come down in different valleys, so that single starts may differ either way.
    """
    criterion = STUDY.criterion(name)
    start, repeats = start_of(4, 3, 5)
    costs = refine(DESIGN, criterion, start, repeats)[1]
    theirs = np.array([slsqp(DESIGN, criterion, x, r) for x, r in zip(start, repeats, strict=True)])
    assert (theirs < cost(criterion, start, repeats)).all()
    assert (costs <= theirs * (1 + 1e-4)).sum() >= 2


@pytest.mark.parametrize("name", [n for n in criteria.available() if criteria.get(n).monotone])
def test_the_whole_of_a_bounded_load_is_used(name):
    """Under a monotone criterion every refined experiment ends at the largest force.

    The interior point keeps ``mu/z`` away from the bound, with z the slope of the log cost by the
    force; where that is below 1e-5, an experiment that is worth next to nothing, it may be further
    away by mu/1e-5 with mu below 1e-9.
    """
    space = replace(DESIGN, load=BoundedLoad(LARGEST))
    criterion = STUDY.criterion(name)
    start, repeats = start_of(2, 3, 2, space)
    x, _ = refine(space, criterion, start, repeats)
    assert start[..., -1].max() < 1
    assert (x[..., -1] > 1 - 1e-4).all()


@pytest.mark.parametrize("name", ["A", "D", "rho0"])
@pytest.mark.parametrize("robot", DESIGNS)
def test_a_free_force_is_as_large_as_it_may_be(name, robot):
    """Whatever the direction, twice the force is worth four times as much: |F| ends at the limit.

    The slack 1 - r ends at ``mu/z``, with mu below 1e-9 and z the slope of the log cost by the
    force. That is above 1e-2: the slopes of all experiments sum to twice the degree, and both are
    needed for all parameters.
    """
    space = replace(DESIGNS[robot], load=FreeLoad(2500.0))
    criterion = STUDY.criterion(name) if robot == "kr270" else criteria.create(name, np.eye(3, 4))
    start, repeats = start_of(2, 2, 3, space)
    x, _ = refine(space, criterion, start, repeats, iterations=800)
    n = len(space.fixed)
    force = np.linalg.norm(space.load.wrench(x[..., n:])[..., :3], axis=-1)
    assert (force > (1 - 1e-6) * 2500).all()
    assert (force <= 2500 * (1 + 1e-12)).all()
    before = space.load.wrench(start[..., n:])[..., :3]
    turned = (
        (space.load.wrench(x[..., n:])[..., :3] * before).sum(axis=-1)
        / np.linalg.norm(before, axis=-1)
        / 2500
    )
    assert (turned < 0.99).any()  # the direction is designed too


def test_a_listed_load_is_not_moved():
    """Poses move, each under the wrench that it began with."""
    space = LOADED["kr270 listed"]
    criterion = STUDY.criterion("rho0")
    start, repeats = start_of(6, 3, 4, space)
    assert len(np.unique(start[..., -1])) == 3
    x, costs = refine(space, criterion, start, repeats, iterations=40)
    np.testing.assert_array_equal(x[..., -1], start[..., -1])
    assert (costs < cost(criterion, start, repeats, space)).all()


def test_free_forces_are_worth_more_than_one():
    """The best plan over any direction of the force is cheaper than over a single direction."""
    criterion = STUDY.criterion("rho0")
    repeats = np.ones((8, 3))
    vertical = refine(DESIGN, criterion, start_of(8, 3, 6)[0], repeats)
    best = vertical[0][vertical[1].argmin()]
    any_force = replace(DESIGN, load=FreeLoad(2500.0))
    x = np.concatenate([best, np.tile([1.0, -np.pi / 2, 0.0], (3, 1))], axis=-1)[None]
    same = float(cost(criterion, x, repeats[:1], any_force)[0])
    assert same == pytest.approx(vertical[1].min(), rel=1e-12)
    assert refine(any_force, criterion, x, repeats[:1])[1][0] < 0.99 * same


def test_kinks():
    """Sharper soft maxima after blunter ones never make a plan worse, and may make it better."""
    criterion = STUDY.criterion("E")
    start, repeats = start_of(4, 3, 7)
    blunt, sharp = (
        refine(DESIGN, criterion, start, repeats, sharpness=s)[1]
        for s in ((10.0,), (10.0, 50.0, 250.0))
    )
    assert (sharp <= blunt).all()
    assert (sharp < blunt * (1 - 1e-4)).any()


def test_repeatable():
    """The same plans come back from the same starts, to the last bit."""
    start, repeats = start_of(4, 3, 8)
    first, again = (refine(DESIGN, STUDY.criterion("rho0"), start, repeats) for _ in range(2))
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])


def test_no_constraints_at_all():
    """Without a workspace the joint limits alone are kept."""
    box = replace(DESIGN, workspace=Workspace(DESIGN.workspace.robot))
    start, repeats = start_of(3, 3, 9, box)
    x, costs = refine(box, STUDY.criterion("D"), start, repeats)
    lower, upper = box.limits
    assert ((x >= lower) & (x <= upper)).all()
    assert (costs < cost(STUDY.criterion("D"), start, repeats, box)).all()
