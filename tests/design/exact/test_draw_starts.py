"""Where a search for exact plans starts."""

from functools import cache

import numpy as np
import pytest
from designs import KR270, STUDY

from edtk.design.candidate_source import Candidates, CandidateSource
from edtk.design.exact.apportion import apportion
from edtk.design.exact.refine import draw_starts
from edtk.design.relaxation.relax_poses import relax_poses

RHO0 = STUDY.criterion("rho0")
SIZE = 12


@cache
def relaxed():
    """A relaxation with fewer support points than the largest number of places in these tests."""
    return relax_poses(CandidateSource(KR270, 0, "sobol", workers=1), 200, RHO0)


@cache
def made(m, k, seed=0):
    """Starts of m experiments at k places."""
    plan = relaxed()
    support = Candidates(plan.x, KR270.problem(plan.x))
    fresh = CandidateSource(KR270, 9, workers=1).take(30)
    return draw_starts(RHO0, m, k, support, plan.weights, fresh, SIZE, (seed,))


def costs(some):
    """Costs (b,) of starts."""
    M = KR270.problem(some.x.reshape(-1, KR270.size)).blocks().reshape(*some.repeats.shape, 5, 5)
    return RHO0.cost(np.einsum("bk,bkij->bij", some.repeats, M))


@pytest.mark.parametrize(("m", "k"), [(3, 3), (4, 2), (12, 12), (25, 16)])
def test_what_all_have_in_common(m, k):
    """Each start has k feasible experiments, and whole repetitions of sum m."""
    some = made(m, k)
    assert some.x.shape == (SIZE, k, KR270.size)
    assert some.repeats.shape == (SIZE, k)
    assert (some.repeats.sum(axis=1) == m).all()
    assert (some.repeats >= 0).all()
    assert (some.repeats == np.round(some.repeats)).all()
    assert KR270.at(some.x).feasible.all()


@pytest.mark.parametrize(("m", "k"), [(3, 3), (4, 2), (12, 12), (25, 16)])
def test_the_first_is_the_apportionment(m, k):
    """The first start is the apportionment of the k heaviest poses, whatever the seed."""
    plan = relaxed()
    heaviest = np.argsort(-plan.weights, kind="stable")[:k]
    expected = apportion(plan.weights[heaviest], m)
    for seed in (0, 1):
        x = made(m, k, seed).x[0]
        repeats = made(m, k, seed).repeats[0]
        assert repeats[: len(heaviest)].tolist() == expected.tolist()
        assert not repeats[len(heaviest) :].any()
        np.testing.assert_array_equal(x[: len(heaviest)], plan.x[heaviest])


def test_the_support_is_smaller_than_the_places():
    """The largest case above has places to spare beyond the support."""
    assert len(relaxed().weights) < 16


@pytest.mark.parametrize(("m", "k"), [(4, 4), (7, 3)])
def test_exchanged_ones_are_best_in_their_pool(m, k):
    """Neither places nor repetitions of every second start can be improved from the pool."""
    plan = relaxed()
    some = made(m, k)
    pool = Candidates(plan.x, KR270.problem(plan.x)) + CandidateSource(KR270, 9, workers=1).take(30)
    blocks = pool.problem.blocks()
    found = costs(some)
    for i in range(1, SIZE, 2):
        own = KR270.problem(some.x[i]).blocks()
        r = some.repeats[i]
        M = np.tensordot(r, own, 1)
        for j in np.flatnonzero(r):
            assert RHO0.cost(M + r[j] * (blocks - own[j])).min() >= found[i] * (1 - 1e-9)
            others = [RHO0.cost(M + own[n] - own[j]) for n in range(k) if n != j]
            assert m == k or min(others) >= found[i] * (1 - 1e-9)
    assert np.median(found[1::2]) < np.median(found[2::2])


def test_drawn_by_weight():
    """Every fourth start has support points only, and the others have fresh experiments too."""
    plan = relaxed()

    def known(i):
        return [(x == plan.x).all(axis=1).any() for x in made(12, 12).x[i]]

    assert all(all(known(i)) for i in range(4, SIZE, 4))
    assert not any(all(known(i)) for i in range(2, SIZE, 4))


def test_seeds():
    """The same seed makes the same starts; another makes others."""
    again = made.__wrapped__(4, 4)
    np.testing.assert_array_equal(made(4, 4).x, again.x)
    np.testing.assert_array_equal(made(4, 4).repeats, again.repeats)
    assert (made(4, 4, 1).x[1:] != again.x[1:]).any()
