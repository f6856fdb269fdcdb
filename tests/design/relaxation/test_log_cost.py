"""The log cost of plans: value, slope and curvature by all design variables."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, KR270, LOADED, STUDY, log_cost_slope

import criteria
from edtk.design.candidate_source import sample_feasible
from edtk.design.interior_point.objective import Neighbourhood
from edtk.design.relaxation.settle import LogCost
from edtk.robots.loads.free_load import FreeLoad

pytestmark = pytest.mark.slow

every = pytest.mark.parametrize("name", criteria.available())
ANY = replace(KR270, load=FreeLoad(2500.0))
ALL = replace(KR270, free=list(range(6)))


def plans(space, b=2, k=5, seed=0):
    """Design variables (b, k, v) and repetitions (b, k) of random regular plans."""
    return sample_feasible(space, b * k, seed).reshape(b, k, -1), np.tile(
        np.arange(1.0, k + 1), (b, 1)
    )


def moved(space, plan):
    """The movable variables (k d,) of a plan, and the plans (1, k, v) of such variables."""

    def back(flat):
        x = plan.copy()
        x[:, space.movable] = flat.reshape(len(plan), -1)
        return x[None]

    return plan[:, space.movable].ravel(), back


def log_cost_of(space, criterion, repeats, back):
    """The log cost of a plan as a function of its movable variables; the value alone is cheap."""
    objective = LogCost(criterion, repeats[None])
    return lambda flat: objective.value(space.at(back(flat)), np.array([0]))[0]


@every
@pytest.mark.parametrize("space", [KR270, ANY], ids=["one force", "any force"])
def test_slope(space, name, derivative):
    """The slope of the log cost is its finite difference, where the extreme eigenvalues are
    simple.

    Poses of a random plan have eigenvalues well apart; wrenches, where they are free, and
    repetitions differ.
    """
    criterion = STUDY.criterion(name)
    x, repeats = plans(space, 1)
    value, slopes = log_cost_slope(space, criterion, x, repeats)
    for plan, r, own, slope in zip(x, repeats, value, slopes, strict=True):
        M = space.information(space.plan(plan, r.astype(int)))
        assert (np.diff(np.log(np.linalg.eigvalsh(M))) > 0.05).all()
        assert own == pytest.approx(np.log(float(criterion.cost(M))), rel=1e-11)
        start, back = moved(space, plan)
        f = log_cost_of(space, criterion, r, back)
        expected = derivative(f, start, h=2e-4).reshape(slope.shape)
        np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-7 * np.abs(slope).max())


@every
@pytest.mark.parametrize(
    "space", [d for d in LOADED.values() if d.load.moves], ids=lambda d: type(d.load).__name__
)
def test_curvature(space, name):
    """Second derivatives, own and joint together, are central differences of the slopes.

    A neighbour is 1e-6 of the range away, in poses and in M, whose inverse may have a third
    derivative a thousand times the second.
    """
    criterion = STUDY.criterion(name) if space.model.p == 5 else criteria.create(name, np.eye(3, 4))
    x, repeats = plans(space, 1, 4)
    near = Neighbourhood(space, x)
    _, _, own, joint = LogCost(criterion, repeats).local(near, np.arange(1))
    H = joint[0].copy()
    d = len(space.movable)
    h = 1e-5
    for i in range(4):
        H[i * d : (i + 1) * d, i * d : (i + 1) * d] += own[0, i]
    beside = np.tile(x, (2 * 4 * d, 1, 1)).reshape(2, 4, d, 4, -1)
    for i, a in np.ndindex(4, d):
        beside[:, i, a, i, space.movable[a]] += np.array([h, -h]) * near.span[a]
    beside = beside.reshape(2 * 4 * d, 4, -1)
    slopes = log_cost_slope(space, criterion, beside, np.tile(repeats, (len(beside), 1)))[1]
    up, down = (slopes * near.span).reshape(2, 4 * d, 4 * d)
    expected = (up - down) / (2 * h)
    np.testing.assert_allclose(H, H.T, rtol=0, atol=1e-12 * np.abs(H).max())
    np.testing.assert_allclose(H, expected, rtol=0, atol=5e-3 * np.abs(H).max())


@every
def test_value_is_that_of_the_local_model(name):
    """The value alone is the one that comes with its derivatives, for the right repetitions."""
    criterion = STUDY.criterion(name)
    x, repeats = plans(KR270, 3)
    repeats = repeats * np.array([[1.0], [2.0], [3.0]])
    cost = LogCost(criterion, repeats)
    some = np.array([2, 0])
    alone = cost.value(KR270.at(x[some]), some)
    np.testing.assert_allclose(
        alone, cost.local(Neighbourhood(KR270, x[some]), some)[0], rtol=1e-12
    )
    expected = criterion.cost(KR270.at(x[some]).information(repeats[some]))
    np.testing.assert_allclose(alone, np.log(expected), rtol=1e-12)


def test_base_joint_does_not_matter():
    """The cost under a vertical load does not depend on the vertical joint 1."""
    x, repeats = plans(ALL)
    slope = log_cost_slope(ALL, STUDY.criterion("rho0"), x, repeats)[1]
    np.testing.assert_allclose(slope[..., 0], 0, atol=1e-10 * np.abs(slope).max())
    assert np.abs(slope[..., 1:]).min() > 1e-6 * np.abs(slope).max()


def test_singular_plan():
    """A singular plan has infinite log cost and zero slope, and does not affect its neighbour."""
    x, repeats = plans(KR270)
    repeats[0, 1:] = 0
    near = Neighbourhood(KR270, x)
    value, slope, own, joint = LogCost(STUDY.criterion("D"), repeats).local(near, np.arange(2))
    assert value[0] == np.inf
    assert not any(part[0].any() for part in (slope, own, joint))
    assert np.isfinite(value[1])
    assert all(part[1].any() for part in (slope, own, joint))


@pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
def test_slope_beside_kept_experiments(space, derivative):
    """Beside kept experiments, too, the slope of the log cost is its finite difference."""
    beside = space.with_kept(space.problem(sample_feasible(space, 3, 9)).mean, 3)
    x = sample_feasible(space, 3, 6)[None]
    repeats = np.ones((1, 3))
    criterion = criteria.create("D")
    slope = log_cost_slope(beside, criterion, x, repeats)[1][0]
    assert (
        np.abs(slope - log_cost_slope(space, criterion, x, repeats)[1][0]).max()
        > 1e-3 * np.abs(slope).max()
    )
    start, back = moved(space, x[0])
    expected = derivative(log_cost_of(beside, criterion, repeats[0], back), start, h=2e-4)
    np.testing.assert_allclose(
        slope, expected.reshape(slope.shape), rtol=0, atol=1e-7 * np.abs(slope).max()
    )
