"""Criteria that do not depend on the amount of information."""

import numpy as np
import pytest
from relaxations import blocks_of

from criteria import create
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import (
    experiment_blocks,
    is_normalised,
    normalised,
    original_weights,
)

PROBLEM = Problem(blocks_of(0) * np.linspace(0.1, 10, 60)[:, None, None])
BESIDE = Problem.of_information(PROBLEM.packed, prior=np.diag([1.0, 2.0, 3.0, 4.0]))
either = pytest.mark.parametrize("problem", [PROBLEM, BESIDE], ids=["alone", "beside a prior"])


def test_other_criteria_keep_their_problem():
    """A criterion of a degree above zero is solved on the problem itself, with its own weights."""
    weights = np.array([0.5, 1.5])
    criterion = create("A")
    assert not is_normalised(criterion)
    assert normalised(BESIDE, criterion) is BESIDE
    scaled = original_weights(BESIDE, criterion, np.array([3, 7]), weights)
    np.testing.assert_array_equal(scaled, [0.25, 0.75])


@either
def test_degree_zero(problem):
    """Weights of candidates of unit trace and those of the candidates give parallel designs."""
    criterion = create("O2")
    assert is_normalised(criterion)
    scaled = normalised(problem, criterion)
    traces = np.trace(experiment_blocks(scaled, np.arange(60)), axis1=1, axis2=2)
    np.testing.assert_allclose(traces, 1, rtol=1e-12)
    chosen = np.array([2, 30, 41, 59])
    weights = np.array([0.1, 0.2, 0.3, 0.4])
    M = np.tensordot(weights, experiment_blocks(scaled, chosen), axes=1)
    original = original_weights(problem, criterion, chosen, weights)
    assert original.sum() == pytest.approx(1, abs=1e-15)
    own = np.tensordot(original, experiment_blocks(problem, chosen), axes=1)
    np.testing.assert_allclose(own / np.trace(own), M / np.trace(M), rtol=0, atol=1e-14)


def test_candidates_without_information():
    """A candidate without information gets no weight."""
    problem = Problem(np.concatenate([np.zeros((1, 2, 4)), blocks_of(1, 5)]))
    weights = original_weights(problem, create("O2"), np.array([0, 3]), np.array([0.5, 0.5]))
    np.testing.assert_array_equal(weights, [0, 1])


@either
def test_experiment_blocks(problem):
    """Weights of sum one make the information matrix of a design of them, the prior included."""
    chosen = np.array([5, 8, 13])
    weights = np.zeros(60)
    weights[chosen] = 0.2, 0.3, 0.5
    M = np.tensordot(weights[chosen], experiment_blocks(problem, chosen), axes=1)
    np.testing.assert_allclose(M, problem.information(weights), rtol=1e-12)
