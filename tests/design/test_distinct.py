"""Which experiments count as one."""

import numpy as np
import pytest
from designs import DESIGNS, KR270, symmetric

from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import sample_feasible
from edtk.design.information import distinct

on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)


def test_symmetric_poses_count_as_one():
    """Of poses that symmetry maps onto each other the first stays.

    Full turns of q4 and q6, the flipped wrist, the mirrored arm and any q1 change no information.
    """
    q = sample_feasible(KR270, 12, 3)
    every = np.concatenate([symmetric(x) for x in q])
    problem = KR270.problem(every)
    chosen = distinct(problem.blocks(), whitener(problem.mean), 1e-6)
    np.testing.assert_array_equal(chosen, 8 * np.arange(12))
    shuffled = np.random.default_rng(0).permutation(len(every))
    chosen = shuffled[distinct(problem.blocks(shuffled), whitener(problem.mean), 1e-6)]
    assert sorted(chosen // 8) == list(range(12))


@on_each
@pytest.mark.parametrize("tolerance", [0.0, 0.5])
def test_distinct_keeps_the_first_of_each_kind(space, tolerance):
    """What is dropped is like one before it that is kept, and what is kept is unlike all those."""
    problem = space.problem(np.repeat(sample_feasible(space, 60, 4), 2, axis=0))
    T = whitener(problem.mean)
    W = T.T @ problem.blocks() @ T
    chosen = distinct(problem.blocks(), T, tolerance)
    assert chosen[0] == 0
    assert (np.diff(chosen) > 0).all()
    for i, w in enumerate(W):
        before = chosen[chosen < i]
        away = np.linalg.norm(W[before] - w, axis=(1, 2)) / np.linalg.norm(w)
        assert (i in chosen) == (away > tolerance).all()
    assert len(chosen) == 60 if tolerance == 0 else len(chosen) < 60


def test_distinct_does_not_depend_on_units():
    """Parameters in other units, from 1e-7 to 1e4, change nothing."""
    S = np.diag([1e-7, 1e4, 1e-3, 1.0, 1e2])
    problem = KR270.problem(sample_feasible(KR270, 100, 5))
    T = whitener(problem.mean)
    blocks = problem.blocks()
    chosen = distinct(blocks, T, 0.5)
    assert 10 < len(chosen) < 90
    np.testing.assert_array_equal(distinct(S @ blocks @ S, np.linalg.inv(S) @ T, 0.5), chosen)


def test_distinct_stops_early():
    """With a limit the choice is the beginning of the choice without one."""
    problem = KR270.problem(sample_feasible(KR270, 100, 5))
    T = whitener(problem.mean)
    chosen = distinct(problem.blocks(), T, 0.5)
    for most in (1, 7, len(chosen), 1000):
        fewer = distinct(problem.blocks(), T, 0.5, most)
        np.testing.assert_array_equal(fewer, chosen[:most])


def test_no_more_are_looked_at_than_are_asked_for():
    """Of many parameters each takes a while, in which nobody hears Ctrl-C: they come one by one."""
    rng = np.random.default_rng(0)
    asked = []

    def blocks():
        for i in range(1000):
            asked.append(i)
            rows = rng.normal(size=(2, 40))
            yield rows.T @ rows

    chosen = distinct(blocks(), np.eye(40), 1e-6, most=5)
    assert chosen.tolist() == [0, 1, 2, 3, 4]
    assert len(asked) <= 6
