"""The best design and the best proof of several steps."""

import numpy as np
import pytest
from relaxations import WELL, criterion_of, solved

from edtk.design.problem import Problem
from edtk.design.relaxation.incumbent import Incumbent
from edtk.design.relaxation.proof import Proof, Step, WarmStart

PROBLEM = Problem(WELL["off-centre"])


def step_of(weights, Z):
    """A step with some weights, and a multiplier with the bound that it proves for A."""
    M = PROBLEM.information(weights)
    largest = float(PROBLEM.sensitivities(Z).max())
    bound = criterion_of("A").lower_bound(Z[None], np.array([largest]), M)
    active = np.flatnonzero(weights)
    last = WarmStart(active, weights[active], Z)
    cost = float(criterion_of("A").cost(M))
    return Step(active, weights[active], M, cost, Proof(Z, largest, bound), "some solver", last)


def test_design_and_proof_are_kept_apart():
    """A step with a better design and a worse proof improves the design alone, and vice versa."""
    criterion = criterion_of("A")
    even = np.full(30, 1 / 30)
    good = -criterion.gradient(PROBLEM.information(even))
    poor = np.eye(4)
    uneven = np.arange(1.0, 31.0)
    uneven /= uneven.sum()
    better, worse = sorted(
        (even, uneven), key=lambda w: float(criterion.cost(PROBLEM.information(w)))
    )
    none = np.empty((0, 4, 4))
    incumbent = Incumbent(PROBLEM, criterion, None)
    incumbent.update(step_of(worse, good), none, np.empty(0))
    gap = incumbent.gap
    incumbent.update(step_of(better, poor), none, np.empty(0))
    assert incumbent.gap < gap
    assert incumbent.iterations == 2
    np.testing.assert_array_equal(incumbent.multipliers, good[None])
    r = incumbent.relaxation(PROBLEM, 1e-6)
    assert r.cost == pytest.approx(float(criterion.cost(PROBLEM.information(better))), rel=1e-12)
    assert r.certify(PROBLEM) == pytest.approx((r.cost, r.proved_bound.cost), rel=1e-12)
    # Caratheodory: thirty candidates with weight become at most p(p+1)/2 + 1.
    assert len(r.support) <= 11


def test_multipliers_that_prove_nothing_more_are_dropped():
    """Multipliers beside the one that proves the bound are no part of the result."""
    optimum = solved("A", "off-centre")
    good = optimum.multipliers[0]
    others = np.stack([np.eye(4), np.diag([1.0, 2, 3, 4])])
    largest = PROBLEM.sensitivities(others).max(axis=1)
    incumbent = Incumbent(PROBLEM, criterion_of("A"), others)
    incumbent.update(step_of(optimum.weights, good), others, largest)
    assert len(incumbent.multipliers) == 3
    r = incumbent.relaxation(PROBLEM, 1e-6)
    np.testing.assert_array_equal(r.multipliers, good[None])
    assert r.gap <= 1e-6
