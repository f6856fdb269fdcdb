"""Orders of plans against all permutations, and against orders known to be the cheapest."""

from itertools import pairwise, permutations

import numpy as np
import pytest

import edtk
from edtk.design.tours import (
    cheap_tour,
    cheapest_possible,
    short_tour,
    tour_seconds,
)

RNG = np.random.default_rng(3)
RUNS = edtk.candidates.full_factorial({"oven": ["left", "right"], "time": [10, 20, 30]})
OVENS = edtk.Problem.from_frame(RUNS, "oven + time + I(time**2)")


def _least(costs, before, after):
    """The cost of the cheapest order, by all of them."""
    orders = permutations(range(len(costs)))
    return min(tour_seconds(costs, before, after, np.array(order)) for order in orders)


@pytest.mark.parametrize("k", [2, 4, 6])
def test_tours_of_few_places_are_the_cheapest(k):
    """Whatever ways out, ways back and ends cost, up to eleven places are in the best order."""
    for _ in range(4):
        costs = RNG.uniform(size=(k, k))
        before, after = RNG.uniform(size=(2, k))
        none = np.zeros(k)
        least = _least(costs, before, none)
        assert tour_seconds(costs, before, none, cheap_tour(costs, before)) == pytest.approx(least)
        assert cheapest_possible(costs, before) <= least * (1 + 1e-12)
        same = costs + costs.T
        tour = short_tour(same, before, after)
        assert tour_seconds(same, before, after, tour) == pytest.approx(_least(same, before, after))


def test_tours_of_more_places_are_near_the_cheapest():
    """Exchanges and moves of places come within some per cent of dynamic programming."""
    for _ in range(10):
        costs = RNG.uniform(size=(9, 9))
        none = np.zeros(9)
        best = tour_seconds(costs, none, none, cheap_tour(costs, none))
        searched = cheap_tour(costs, none, best_up_to=0)
        assert sorted(searched) == list(range(9))
        assert best - 1e-12 <= tour_seconds(costs, none, none, searched) <= 1.1 * best


def test_order_of_a_factorial_changes_the_hardest_factor_least():
    """All 24 runs of a factorial in a Gray code: a proved order, found among all."""
    runs = edtk.candidates.full_factorial({"a": [0, 1], "b": [0, 1, 2], "c": [0, 1, 2, 3]})
    problem = edtk.Problem.from_frame(runs, "a + b + c")
    plan = edtk.plan(problem, size=24, most=1, starts=1)
    order = plan.order({"a": 100, "b": 10, "c": 1})
    assert sorted(order.experiments) == list(range(24))
    # One change of a, two of b for each of its levels, and three of c for each of these.
    assert order.cost == 100 + 2 * 2 * 10 + 6 * 3 * 1
    assert order.proved


def test_order_follows_columns_functions_and_costs_alike():
    """The same changes cost the same, however they are stated, and repeats stay together."""
    plan = edtk.plan(OVENS, size=9, starts=2)
    costs = np.array(
        [[3.0 * (a[0] != b[0]) + (a[1] != b[1]) for b in RUNS.values] for a in RUNS.values]
    )
    of_columns = plan.order({"oven": 3, "time": 1}, begin=0)
    of_levels = plan.order({"oven": lambda a, b: 3, "time": lambda a, b: 1}, begin=0)
    of_rows = plan.order(
        lambda a, b: 3 * (a["oven"] != b["oven"]) + (a["time"] != b["time"]), begin=0
    )
    of_costs = plan.order(costs, begin=0)
    for order in (of_columns, of_levels, of_rows, of_costs):
        assert np.array_equal(np.sort(order.experiments), plan.experiments)
        assert order.cost == of_columns.cost == order.bound
        ways = [0, *order.experiments]
        assert order.changes.tolist() == [costs[a, b] for a, b in pairwise(ways)]
    assert list(of_columns.to_frame().columns) == ["oven", "time", "change"]
    assert "none costs less" in of_columns.headline()


def test_order_of_costs_without_triangles_is_that_of_all_experiments():
    """A repeat may be made on the way between others where that is cheaper."""
    problem = edtk.Problem(np.eye(3)[:, None, :])
    plan = edtk.plan(problem, size=5, least=[3, 1, 1], starts=1)
    costs = np.array([[9.0, 1, 1], [1, 9, 9], [1, 9, 9]])
    order = plan.order(costs)
    assert order.experiments.tolist() == [0, 1, 0, 2, 0]
    assert order.cost == 4


def test_blocks_stay_in_their_order():
    """Experiments of a block stay together, each block begins where the last one ended."""
    problem = edtk.Problem.from_frame(RUNS, "0 + time + I(time**2)")
    plan = edtk.plan(problem, blocks=(4, 4), starts=2)
    order = plan.order({"time": 1})
    for block, own in zip(plan.block_counts, order.experiments.reshape(2, 4), strict=True):
        assert np.array_equal(np.bincount(own, minlength=6), block)
    assert order.bound <= order.cost


WRONG = {
    "shape": ({"transition": np.eye(3)}, "costs of shape (3, 3), expected (6, 6)"),
    "column": ({"transition": {"x": 1}}, "transition['x']: the frame has oven, time"),
    "sign": ({"transition": -np.ones((6, 6))}, "from candidate"),
    "value": ({"transition": lambda a, b: "dear"}, "'dear' from {'oven': 'left'"),
    "begin": ({"transition": {"oven": 1}, "begin": 6}, "expected a candidate, from 0 to 5"),
}


@pytest.mark.parametrize("case", sorted(WRONG))
def test_wrong_costs_are_named(case):
    """One line says what of the costs is wrong, and where."""
    options, words = WRONG[case]
    plan = edtk.plan(OVENS, size=9, starts=1)
    with pytest.raises(edtk.UserError) as error:
        plan.order(**options)
    assert words in str(error.value)


def test_plan_with_a_structure_of_errors_has_its_order():
    """Its errors hang together by the order, which is not changed afterwards."""
    plan = edtk.plan(OVENS, size=6, errors=edtk.Errors.split_plot("oven", 2), starts=1)
    with pytest.raises(edtk.UserError, match="part of a plan"):
        plan.order({"time": 1})
