"""Batches of a search for exact plans, each of which depends on nothing but itself."""

import pickle
from functools import cache

import numpy as np
import pytest
from designs import KR270, LOADED, STUDY
from threadpoolctl import threadpool_info, threadpool_limits

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.exact import find_plan
from edtk.design.exact.find_plan import Batch, Batches
from edtk.design.exact.refine import draw_starts
from edtk.design.relaxation.relax_poses import relax_poses

pytestmark = pytest.mark.slow


@cache
def relaxed(name, space):
    """A criterion, and its relaxation over a few candidates."""
    criterion = STUDY.criterion("rho0") if name == "rho0" else create(name)
    source = CandidateSource(space, 0, "sobol", workers=1)
    return criterion, relax_poses(source, 200, criterion)


@cache
def batch(name="rho0", m=4, k=4, seed=(0,), space=KR270):
    """A batch after that relaxation."""
    criterion, plan = relaxed(name, space)
    return Batch(space, criterion, m, k, plan.x, plan.weights, seed)


@cache
def answer(*args):
    """What it comes back with."""
    return alone(batch(*args))


def alone(work, seconds=np.inf):
    """The answer of a batch that is done by itself."""
    return Batches((work,), seconds)()[0]


def assert_equal(one, other):
    """Two answers are the same, bit by bit."""
    assert one[0].tobytes() == other[0].tobytes()
    assert one[1].x.tobytes() == other[1].x.tobytes()
    assert one[1].repeats.tobytes() == other[1].repeats.tobytes()


def assert_sound(work, costs, plans):
    """The plans kept are feasible, of m experiments, with their costs, the best first."""
    assert plans.x.shape == (len(costs), work.places, work.space.size)
    assert 1 <= len(costs) <= find_plan.ELITE
    assert work.space.at(plans.x).feasible.all()
    assert (plans.repeats.sum(axis=1) == work.m).all()
    assert ((plans.repeats >= 0) & (plans.repeats == np.round(plans.repeats))).all()
    assert (np.diff(costs) >= 0).all()
    assert np.isfinite(costs).all()
    M = work.space.at(plans.x).information(plans.repeats)
    slip = 64 * M.shape[-1] * np.finfo(float).eps * np.linalg.cond(M).max()
    np.testing.assert_allclose(costs, work.criterion.cost(M), rtol=slip)


CASES = [("rho0", 4, 4), ("D", 7, 3), ("O2", 3, 3)]


@pytest.mark.parametrize("args", CASES)
def test_what_it_comes_back_with(args):
    """Plans of criteria with and without kinks are feasible and have the stated costs."""
    assert_sound(batch(*args), *answer(*args))


@pytest.mark.parametrize("kind", ["bounded", "listed", "free"])
def test_loads(kind):
    """Loads that are chosen along with the poses stay in their family."""
    args = ("D", 3, 3, (0,), LOADED[f"kr270 {kind}"])
    assert_sound(batch(*args), *answer(*args))


@pytest.mark.parametrize("args", CASES)
def test_better_than_its_starts(args):
    """The best plan is cheaper than the rounded relaxation, which every batch starts from."""
    work = batch(*args)
    from_pool = CandidateSource(work.space, 0, workers=1).take(10)
    support = CandidateSource(work.space, 0, "sobol", workers=1).take(200)
    chosen = [int(np.flatnonzero((support.x == x).all(axis=1))[0]) for x in work.support]
    first = draw_starts(
        work.criterion,
        work.m,
        work.places,
        support[np.array(chosen)],
        work.weights,
        from_pool,
        1,
        (0,),
    )
    before = work.criterion.cost(work.space.at(first.x).information(first.repeats))
    assert answer(*args)[0][0] < before[0] * (1 - 1e-3)


def test_it_depends_on_itself_alone():
    """A pickled copy gives the same answer, whatever the number of threads around it."""
    copy = pickle.loads(pickle.dumps(Batches((batch(),))))
    with threadpool_limits(2):
        assert_equal(copy()[0], answer())


@pytest.mark.parametrize("args", CASES)
def test_company_does_not_matter(args):
    """Batches that are done together come back with what each of them does alone, bit by bit."""
    seeds = [(0,), (1,)]
    together = Batches(tuple(batch(*args, seed) for seed in seeds))()
    for own, seed in zip(together, seeds, strict=True):
        assert_equal(own, answer(*args, seed))


def test_one_thread(monkeypatch):
    """Batches compute in one thread, so that the rounding of products is always the same."""
    monkeypatch.setattr(
        Batches, "_run", lambda self: [pool["num_threads"] for pool in threadpool_info()]
    )
    with threadpool_limits(2):
        assert set(Batches((batch(),))()) == {1}


def test_seeds_differ():
    """Another seed takes other starts: what comes out is not the same bit by bit."""
    assert answer()[1].x.tobytes() != answer("rho0", 4, 4, (1,))[1].x.tobytes()


@pytest.mark.parametrize("args", CASES)
def test_no_time(args):
    """A batch without time makes its starts, no descent, and returns feasible plans."""
    early = alone(batch(*args), 0.0)
    assert_sound(batch(*args), *early)
    assert early[0][0] >= answer(*args)[0][0] * (1 - 1e-9)
