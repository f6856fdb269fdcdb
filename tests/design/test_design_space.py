"""Design spaces: bounds, plans and their information, and kept experiments as a prior."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, LOADED, STUDY
from designs import KR270 as DESIGN

from edtk.design.candidate_source import CandidateSource, sample_feasible
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exchange import exchange
from edtk.design.exact.refine import refine
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_poses import RelaxOptions, relax_poses
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad

pytestmark = pytest.mark.slow

EPS = np.finfo(float).eps
ANY = replace(DESIGN, load=FreeLoad(2500.0))
on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)


def plans(space, b=2, k=5, seed=0):
    """Design variables (b, k, v) and repetitions (b, k) of random regular plans."""
    x = sample_feasible(space, b * k, seed).reshape(b, k, -1)
    return x, np.tile(np.arange(1.0, k + 1), (b, 1))


@on_every_load
def test_a_plan_has_the_wrenches_of_its_variables(space):
    """Poses and wrenches of a plan are those of the design variables, and tell what these tell."""
    x = sample_feasible(space, 8, 4)
    n = len(space.fixed)
    plan = space.plan(x, np.arange(1, 9))
    np.testing.assert_array_equal(plan.q, x[:, :n])
    np.testing.assert_array_equal(plan.wrench, space.load.wrench(x[:, n:]))
    M = space.problem(x).information(np.arange(1.0, 9))
    scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
    assert (np.abs(space.information(plan) - M) <= 64 * EPS * scale).all()
    assert (
        np.abs(space.at(x[None]).information(np.arange(1.0, 9)[None])[0] - M) <= 64 * EPS * scale
    ).all()
    A = space.model.regressor(plan.q, plan.wrench) / space.sigma[:, None]
    np.testing.assert_allclose(space.at(x).regressor, A, rtol=0, atol=1e-13 * np.abs(A).max())


def test_information_of_repetitions():
    """A pose with repetitions has the information of as many rows of it."""
    x, repeats = plans(ANY)
    plan = ANY.plan(x[0], repeats[0].astype(int))
    rows = np.repeat(np.arange(5), plan.repeats)
    spread = Plan(plan.q[rows], plan.wrench[rows], np.ones(len(rows), dtype=int))
    np.testing.assert_allclose(ANY.information(spread), ANY.information(plan), rtol=1e-11)
    np.testing.assert_allclose(
        ANY.information(plan.repeated(3)), 3 * ANY.information(plan), rtol=1e-12
    )


def test_wrenches_of_any_plan_are_its_own():
    """A plan counts under its own wrenches: twice the force is four times the information."""
    plan = DESIGN.plan(plans(DESIGN)[0][0], np.ones(5, dtype=int))
    np.testing.assert_allclose(
        DESIGN.information(replace(plan, wrench=2 * plan.wrench)),
        4 * DESIGN.information(plan),
        rtol=1e-12,
    )


@on_every_load
def test_bounds_and_what_moves(space):
    """Fixed joints are neither drawn nor moved; the index of a listed load is not moved."""
    n = len(space.fixed)
    d = len(space.load.limits.T)
    np.testing.assert_array_equal(space.limits[:, :n], space.workspace.robot.limits)
    np.testing.assert_array_equal(space.limits[:, n:], space.load.limits)
    assert space.drawn == [*space.free, *range(n, n + d)]
    assert space.movable == (space.free if isinstance(space.load, ListedLoad) else space.drawn)


@pytest.mark.parametrize("fixed", [4.0, -3.3])
def test_a_joint_fixed_outside_its_limits_is_rejected(fixed):
    """No experiment could be feasible: the joint is named at once."""
    with pytest.raises(ValueError, match="q1 is fixed outside its limits"):
        replace(DESIGN, fixed=np.array([fixed, 0, 0, 0, 0, 0]))


def kept_and_beside(space: DesignSpace, m: int, k: int = 3, seed: int = 8):
    """Some experiments that are there already, and the design of m more beside them."""
    kept = space.plan(sample_feasible(space, k, seed), np.arange(1, k + 1))
    return kept, space.with_kept(space.information(kept), m)


def assert_close(M, expected):
    """Equal to the rounding of sums, at the scale sqrt(m_ii m_jj)."""
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.abs(M - expected) <= 1e-12 * scale).all()


@on_every_load
def test_plans_beside_kept_experiments(space):
    """The information of m new experiments, however computed, is theirs and the kept ones'."""
    repeats = np.array([2, 1, 3])
    kept, beside = kept_and_beside(space, repeats.sum())
    x = sample_feasible(space, 3, 9)
    plan = space.plan(x, repeats)
    expected = space.information(kept) + space.information(plan)
    assert_close(space.information(kept + plan), expected)
    assert_close(beside.information(plan), expected)
    assert_close(beside.problem(x).information(repeats), expected)
    assert_close(beside.at(x[None]).information(repeats[None])[0], expected)
    np.testing.assert_array_equal(beside.at(x).regressor, space.at(x).regressor)


@on_each
def test_candidates_beside_kept_experiments_are_the_same(space):
    """A source beside kept experiments has the same candidates, and their share as the prior."""
    m = 4
    kept, beside = kept_and_beside(space, m)
    alone, more = (CandidateSource(d, 3).take(200) for d in (space, beside))
    np.testing.assert_array_equal(alone.x, more.x)
    np.testing.assert_array_equal(alone.problem.packed, more.problem.packed)
    np.testing.assert_array_equal(more.problem.prior, space.information(kept) / m)
    assert alone.problem.prior is None


@pytest.mark.parametrize("name", ["rho0", "D", "E", "O2", "O4", "O5"])
def test_no_plan_beside_kept_experiments_beats_the_bound(name):
    """The relaxation beside kept experiments bounds all plans of m more candidates.

    Exchanged plans come within a fifth of the bound, so that a bound 20 % too low would be noticed
    as well.
    """
    m = 4
    criterion = STUDY.criterion(name)
    kept, beside = kept_and_beside(DESIGN, m)
    source = CandidateSource(beside, 0)
    relaxed = relax_poses(source, 400, criterion)
    bound = relaxed.proved_bound.scaled(m).cost
    pool = source.take(400)
    rng = np.random.default_rng(0)
    costs = []
    for _ in range(4):
        places, reached = exchange(pool.problem, criterion, rng.integers(0, 400, m))
        plan = DESIGN.plan(pool.x[places], np.ones(m, dtype=int))
        costs.append(float(criterion.cost(DESIGN.information(kept) + DESIGN.information(plan))))
        assert costs[-1] == pytest.approx(reached, rel=1e-8)
    assert bound * (1 - 1e-9) <= min(costs) <= 1.2 * bound
    alone = float(criterion.cost(DESIGN.information(kept)))
    assert min(costs) < alone or not criterion.monotone


def test_no_refined_plan_beside_kept_experiments_beats_the_searched_bound():
    """Refined plans over all poses stay above the searched bound, and within a fifth of it."""
    m = 4
    criterion = STUDY.criterion("rho0")
    kept, beside = kept_and_beside(DESIGN, m)
    relaxed = relax_poses(
        CandidateSource(beside, 0), 400, criterion, True, RelaxOptions(tolerance=1e-3)
    )
    x, costs = refine(
        beside, criterion, sample_feasible(beside, 12 * m, 1).reshape(12, m, -1), np.ones((12, m))
    )
    bound = relaxed.searched_bound.scaled(m).cost
    assert bound * (1 - 1e-9) <= costs.min() <= 1.2 * bound
    M = DESIGN.information(kept + DESIGN.plan(x[costs.argmin()], np.ones(m, dtype=int)))
    assert float(criterion.cost(M)) == pytest.approx(costs.min(), rel=1e-9)
