"""Costs of exchanges about a part of the parameters: the lemmas give what inverses give."""

import numpy as np
import pytest

import criteria
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.design.problem import Problem

NAMES = ("A", "D", "E", "G", "O1", "O3", "O5")


@pytest.mark.parametrize("rows", [1, 3, 4])
@pytest.mark.parametrize("chosen", [True, False], ids=["parameters", "combinations"])
@pytest.mark.parametrize("name", NAMES)
def test_updates_are_the_costs_of_the_sums(name, chosen, rows):
    """``R + r U'U`` for badly scaled parameters, chosen ones or combinations of them."""
    rng = np.random.default_rng(rows)
    units = np.array([1.0, 1e-3, 1e2, 10.0, 1.0])
    problem = Problem(rng.normal(size=(30, rows, 5)) * units)
    K = np.eye(5)[:, [0, 3]] if chosen else rng.normal(size=(5, 2)) * units[:, None]
    criterion = criteria.create(name, interest=K)
    places = np.array([np.arange(8), np.arange(8, 16)])
    times = np.array([2.0, 1.0])
    rest = problem.plan_information(places, np.ones(places.shape))
    joined = np.broadcast_to(np.arange(30), (2, 30))
    found = exchange_costs(criterion, rest, problem.factors(joined), times)
    expected = criterion.cost(rest[:, None] + times[:, None, None, None] * problem.blocks(joined))
    np.testing.assert_allclose(found, expected, rtol=1e-8)
