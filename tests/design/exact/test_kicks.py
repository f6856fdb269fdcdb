"""Kicks of the best plans of a search: feasible, deterministic, never worse, and worth it."""

from functools import cache

import numpy as np
import pytest
from designs import KR270, STUDY

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.exact import search_record as kicks
from edtk.design.exact.find_plan import Batches, SearchOptions, find_plan
from edtk.design.exact.refine import refine
from edtk.design.exact.search_record import Kicks, Plans
from edtk.design.relaxation.relax_poses import relax_poses

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("whole_searches")]


def criterion(name):
    """The study's rho0, or another criterion."""
    return STUDY.criterion("rho0") if name == "rho0" else create(name)


@cache
def refined(name, m):
    """Costs and plans of m experiments, refined from random poses, the best first."""
    x = CandidateSource(KR270, 5, workers=1).take(4 * m).x.reshape(4, m, -1)
    x, costs = refine(KR270, criterion(name), x, np.ones((4, m)), 40, (30.0,))
    order = np.argsort(costs)
    return costs[order], Plans(x[order], np.ones((4, m)))


def kicked(name, m, seconds=np.inf):
    """The plans after kicks."""
    costs, plans = refined(name, m)
    known = plans.x.reshape(-1, KR270.size)
    work = Kicks(KR270, criterion(name), (costs, plans), known, (7,))
    return Batches((work,), seconds)()[0]


@pytest.mark.parametrize(("name", "m"), [("rho0", 3), ("O3", 2)])
def test_better_plans(name, m, monkeypatch):
    """Of plans from four random starts kicks make better ones, feasible and of the same size."""
    monkeypatch.setattr(kicks, "KICK_TURNS", 1)
    costs, plans = kicked(name, m)
    before, _ = refined(name, m)
    assert costs[0] < before[0] * (1 - 1e-3)
    assert (np.diff(costs) >= 0).all()
    assert KR270.at(plans.x).feasible.all()
    assert (plans.repeats.sum(axis=1) == m).all()
    M = KR270.at(plans.x).information(plans.repeats)
    np.testing.assert_allclose(costs, criterion(name).cost(M), rtol=1e-9)


def test_the_same_again(monkeypatch):
    """The same plans and the same seed give the same answer, bit by bit."""
    monkeypatch.setattr(kicks, "KICK_TURNS", 2)
    (one, first), (two, second) = kicked("rho0", 3), kicked("rho0", 3)
    assert one.tobytes() == two.tobytes()
    assert first.x.tobytes() == second.x.tobytes()


def test_no_time():
    """Without time the plans come back as they are."""
    costs, plans = kicked("rho0", 3, seconds=0.0)
    before, as_they_were = refined("rho0", 3)
    assert costs.tolist() == before.tolist()
    assert plans.x.tobytes() == as_they_were.x.tobytes()


def test_a_search_ends_with_kicks(monkeypatch):
    """A search is never worse for its kicks, and counts no starts for them."""
    relaxed = relax_poses(CandidateSource(KR270, 0, workers=1), 200, STUDY.criterion("rho0"))
    options = SearchOptions(starts=16)
    found = find_plan(relaxed, 3, options=options)
    monkeypatch.setattr(kicks, "KICK_TURNS", 0)
    without = find_plan(relaxed, 3, options=options)
    assert found.cost <= without.cost
    assert found.starts == without.starts == 16
