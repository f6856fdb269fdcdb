"""The best weights of nodes of a proof: no multiplier is needed that bounds them better."""

from dataclasses import replace

import numpy as np
import pytest

import criteria
import edtk
from criteria import Relaxable
from edtk.design.exact.exact_nodes import NEAR, Merits, Nodes
from edtk.design.exact.exact_weights import best_weights
from edtk.design.information import sensitivity_rows
from edtk.system.typing import Array

N = 40


def node_of(name: str, seed: int, budget: bool, most: int | None) -> tuple[Merits, Nodes, Array]:
    """A node of two groups, of three and of four experiments, and the costs of candidates."""
    rng = np.random.default_rng(seed)
    problem = edtk.Problem(rng.normal(size=(N, 2, 3)))
    costs = rng.uniform(0.5, 1.0, N)
    features = [sensitivity_rows(np.ones((3, 3)))[:, None] * problem.packed]
    K = np.zeros(6)
    if budget:
        features.append(-costs[None])
        K = np.append(K, 4.2)
    criterion = criteria.create(name)
    assert isinstance(criterion, Relaxable)
    limits = None if most is None else np.full(N, most)
    F = np.ascontiguousarray(np.concatenate(features).T)
    merits = Merits(criterion, F, K, 0.0, 7, limits, int(budget))
    two = np.array([0, 1])
    nodes = Nodes(
        np.arange(N), np.zeros(N), np.array([0, 15]), np.array([3, 4]), two, two[:1], two[1:]
    )
    return merits, nodes, costs


@pytest.mark.parametrize("name", ["A", "D", "O5"])
@pytest.mark.parametrize("budget", [False, True])
@pytest.mark.parametrize("most", [None, 1])
def test_the_best_weights_are_within_limits_and_near_their_bound(
    name: str, budget: bool, most: int | None
) -> None:
    """They sum to the counts, obey limits and funds, and their own multiplier proves them best."""
    for seed in range(4):
        merits, nodes, costs = node_of(name, seed, budget, most)
        weights = best_weights(merits, nodes, np.zeros(N), 0.0)
        assert (weights >= 0).all()
        assert np.add.reduceat(weights, nodes.heads) == pytest.approx(nodes.counts, rel=1e-6)
        assert most is None or (weights <= most + 1e-9).all()
        assert not budget or weights @ costs <= 4.2 * (1 + 1e-6)
        some = replace(nodes, weights=weights)
        X = merits.information(some, weights)
        told = merits.tell(some, merits.priced(some, merits.multipliers(X)))
        assert merits.merits(some)[0] <= told.merit[0] <= merits.merits(some)[0] * (1 + 2 * NEAR)


def test_a_budget_lowers_what_weights_reach() -> None:
    """The funds of the test above bind: without them the same node has a larger merit."""
    for seed in range(4):
        of = [node_of("A", seed, budget, None) for budget in (False, True)]
        free, bound = (
            merits.merits(replace(nodes, weights=best_weights(merits, nodes, np.zeros(N), 0.0)))[0]
            for merits, nodes, _ in of
        )
        assert bound < free * (1 - NEAR)
