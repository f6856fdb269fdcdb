"""Long lists of candidates: over parts of them first, proved over all."""

import numpy as np
import pytest
from relaxations import GAP, check, criterion_of, every_base, off_centre

from edtk.design.problem import Problem
from edtk.design.relaxation import relax as improve
from edtk.design.relaxation.relax import _most_sensitive, relax


@pytest.fixture
def short(monkeypatch):
    """Two thousand candidates are many."""
    monkeypatch.setattr(improve, "LONG_LIST", 2000)


@every_base
def test_same_optimum(name, monkeypatch):
    """The cost is that of the relaxation over all candidates at once, and the bound is valid."""
    problem = Problem(off_centre(4, 5000))
    whole = relax(problem, criterion_of(name))
    monkeypatch.setattr(improve, "LONG_LIST", 2000)
    found = relax(problem, criterion_of(name))
    check(found, problem, name)
    assert found.gap <= GAP
    assert found.cost == pytest.approx(whole.cost, rel=GAP)


def test_part_that_tells_too_little(short):
    """A parameter that no candidate of the first part tells is told by the others."""
    rows = off_centre(4, 5000)
    rows[:, :, 3] = 0.0
    rows[[7, 101, 4321], :, 3] = 1.0
    problem = Problem(rows)
    found = relax(problem, criterion_of("D"))
    check(found, problem, "D")
    assert found.gap <= GAP
    assert np.isin([7, 101, 4321], found.support).any()


def test_candidates_that_are_all_alike(short):
    """Where all candidates are as sensitive, no part of them is near, and all are taken."""
    x = np.tile([-1.0, 1.0], 2500)
    problem = Problem(np.column_stack([np.ones(5000), x])[:, None, :])
    found = relax(problem, criterion_of("D"))
    assert found.cost == pytest.approx(1.0)
    assert found.gap <= GAP


def test_progress(short):
    """Progress is told after each part, and the gap falls."""
    told = []
    relax(Problem(off_centre(4, 5000)), criterion_of("D"), progress=lambda i, g: told.append(g))
    assert len(told) >= 2
    assert told[-1] <= GAP < told[0]


def test_most_sensitive():
    """Those of the largest sensitivities to any multiplier come, about a fiftieth, and the last."""
    rng = np.random.default_rng(0)
    sensitivities = rng.normal(size=(2, 100_000))
    last = np.array([5, 17])
    found = _most_sensitive(sensitivities, last)
    assert (np.diff(found) > 0).all()
    assert np.isin(last, found).all()
    assert np.isin(sensitivities.argmax(axis=1), found).all()
    assert 1000 < len(found) < 4000
