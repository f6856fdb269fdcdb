"""The candidates with which column generation begins."""

import numpy as np
import pytest
from relaxations import WELL, blocks_of

from edtk.design.problem import Problem
from edtk.design.relaxation.column_generation import first_active_set


@pytest.mark.parametrize("case", WELL)
@pytest.mark.parametrize("size", [1, 4, 40])
def test_every_parameter_is_identified(case, size):
    """As many candidates as asked for, and at least one per parameter, have a regular design."""
    problem = Problem(WELL[case])
    active = first_active_set(problem, size)
    assert len(active) == len(np.unique(active)) == min(max(size, 4), problem.n)
    assert np.linalg.matrix_rank(np.sum(problem.blocks(active), axis=0)) == 4


def test_greedy():
    """The first choice tells most, relative to the mean; the next one most beside it."""
    rows = np.diag([3.0, 2.0, 1.0])[:, None, :]
    active = first_active_set(Problem(np.concatenate([rows, 0.9 * rows])), 3)
    assert sorted(active % 3) == [0, 1, 2]
    assert (active < 3).all()


def test_all_candidates_if_the_sample_does_not_do():
    """A direction that one candidate in ten thousand excites is not left open."""
    rows = np.zeros((10_001, 1, 2))
    rows[:, 0, 0] = 1
    rows[1, 0] = 0, 1
    assert 1 in first_active_set(Problem(rows), 5)


def test_prior():
    """A parameter that only the prior tells about needs no candidate."""
    blocks = blocks_of(0)
    blocks[..., 3] = 0
    problem = Problem(blocks, prior=np.diag([0.0, 0, 0, 1.0]))
    assert len(first_active_set(problem, 4)) == 4
