"""Plans whose counts obey more than a size: least counts, several budgets, sums, and marginals."""

import itertools
import re

import numpy as np
import pandas as pd
import pytest

import criteria
import edtk
from edtk.system.errors import UserError

OVENS = edtk.candidates.full_factorial({"oven": ["left", "right", "top"], "time": [10, 20, 30]})
FRAME = edtk.Problem.from_frame(OVENS, "1 + oven + time")


def used(plan: edtk.ProblemPlan, column: str) -> dict[object, int]:
    """How often each level of a column is measured."""
    return pd.Series(plan.counts).groupby(OVENS[column]).sum().to_dict()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_no_plan_within_the_limits_is_better(seed: int) -> None:
    """All plans of a small problem are listed: the best one is found, and no bound is above it."""
    rng = np.random.default_rng(seed)
    n, m = 6, 4
    problem = edtk.Problem(rng.normal(size=(n, 1, 2)))
    criterion = criteria.create(("D", "A", "E", "O1", "G", "D")[seed])
    costs = rng.uniform(0.5, 2, (2, n))
    least = np.bincount([seed % n], minlength=n)
    half = (rng.random(n) < 0.5).astype(float)
    plans = [
        np.bincount(chosen, minlength=n)
        for chosen in itertools.combinations_with_replacement(range(n), m)
    ]
    budget = np.mean([costs @ counts for counts in plans], axis=0)

    def obeys(counts: np.ndarray) -> bool:
        affordable = (costs @ counts <= budget).all()
        return bool((counts >= least).all() and 1 <= half @ counts <= 3 and affordable)

    best = min(criterion.cost(problem.information(one)) for one in plans if obeys(one))
    found = edtk.plan(
        problem,
        m,
        criterion,
        least=least,
        costs=costs,
        cost_budget=budget,
        constraints=[(half, 1, 3)],
        starts=16,
    )
    assert obeys(found.counts)
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.lower_bound.cost <= best * (1 + 1e-9)
    np.testing.assert_allclose(found.spent, costs @ found.counts)


@pytest.mark.slow
def test_levels_are_used_as_often_as_asked() -> None:
    """Of columns: one number for all levels, limits for each, or limits for some."""
    found = edtk.plan(FRAME, 9, constraints=[{"oven": 3}], starts=4)
    assert used(found, "oven") == {"left": 3, "right": 3, "top": 3}
    marginals = {"oven": {"left": (1, 2)}, "time": (3, 3)}
    found = edtk.plan(FRAME, 9, constraints=[marginals], starts=4)
    assert 1 <= used(found, "oven")["left"] <= 2
    assert used(found, "time") == {10: 3, 20: 3, 30: 3}


@pytest.mark.slow
def test_an_expression_of_columns_counts() -> None:
    """Coefficients are what it gives for each candidate."""
    sums = [("oven == 'left'", None, 1), ("time", 0, 120)]
    found = edtk.plan(FRAME, 8, constraints=sums, starts=4)
    assert used(found, "oven")["left"] <= 1
    assert OVENS["time"] @ found.counts <= 120


@pytest.mark.slow
def test_limits_count_in_blocks_too() -> None:
    """A candidate that must be measured may be in any block."""
    problem = edtk.Problem.from_frame(OVENS, "0 + time + I(time**2)")
    least = 2 * np.eye(9, dtype=int)[4]
    limits = {"least": least, "constraints": [{"oven": 3}], "starts": 4}
    found = edtk.plan(problem, 9, blocks=[3, 3, 3], **limits)  # type: ignore[call-overload]
    assert found.counts[4] >= 2
    assert used(found, "oven") == {"left": 3, "right": 3, "top": 3}


@pytest.mark.slow
def test_a_proof_is_beside_least_counts() -> None:
    """What every plan has is no choice: the others are proved to be the best."""
    least = np.eye(9, dtype=int)[4]
    found = edtk.plan(FRAME, 6, least=least, prove=20)
    assert found.proved_exact
    others = [
        np.bincount([4, *chosen], minlength=9)
        for chosen in itertools.combinations_with_replacement(range(9), 5)
    ]
    best = min(criteria.create("D").cost(FRAME.information(counts)) for counts in others)
    assert found.cost == pytest.approx(best, rel=1e-9)


def test_costs_that_are_nearly_alike_are_told_apart() -> None:
    """A solver's tolerance exceeds no budget: the plan obeys it, or there is none."""
    problem = edtk.Problem(np.random.default_rng(0).normal(size=(6, 1, 2)))
    differences = np.array([0, 0, 1, 3, 2, 5.0])
    costs = np.stack([1 + 1e-5 * differences, np.ones(6)])
    found = edtk.plan(problem, 4, costs=costs, cost_budget=[4, 4], starts=4)
    assert found.counts[:2].sum() == 4
    assert re.search(r"^The new experiments cost 4\S* and 4\.$", found.summary(), re.MULTILINE)
    costs = np.stack([1 + 1e-7 * differences, np.ones(6)])
    with pytest.raises(UserError, match="no whole counts within all limits"):
        edtk.plan(problem, 4, costs=costs, cost_budget=[4 + 3e-7, 4], starts=4)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"constraints": 3}, "constraints: expected a list of"),
        ({"constraints": [3]}, r"constraints\[0\] 3: expected \(coefficients"),
        ({"constraints": [{"over": 3}]}, r"constraints\[0\]: no column 'over'"),
        ({"constraints": [{"oven": {"up": 3}}]}, "no candidate has oven = 'up'"),
        ({"constraints": [("over == 1", 1, 2)]}, "'over == 1': name 'over' is not defined"),
        ({"constraints": [{"oven": 2}]}, r"obeys .*oven = left.* and size together"),
        ({"constraints": [([1] * 8, 0, 1)]}, r"constraints\[0\]"),
        ({"least": 1.5}, "least: expected whole numbers"),
        ({"least": -1}, "least: expected a number, zero or more"),
        ({"least": 2}, "least: asks for 18 new experiments, expected 9 or fewer"),
        ({"least": 1, "most": 0}, "least: candidate 0: 1 or more, but most allows 0"),
        ({"costs": np.ones((2, 9)), "cost_budget": [9]}, "cost_budget .*expected 2 numbers"),
        ({"costs": np.ones((2, 9)), "cost_budget": [9, 3]}, "cost 9 or more"),
        ({"constraints": [{"oven": 3}], "prove": 1}, "sums of counts have no proof"),
    ],
)
def test_what_cannot_be_obeyed_is_one_line(keys: dict[str, object], said: str) -> None:
    """It names the argument, and those of the constraints that contradict each other."""
    with pytest.raises(UserError, match=said) as refused:
        edtk.plan(FRAME, 9, **keys)  # type: ignore[call-overload]
    assert "\n" not in str(refused.value)
