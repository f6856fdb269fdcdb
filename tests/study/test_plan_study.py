"""The exact plan of a study: its bound, its limits in time, and questions without an answer."""

from pathlib import Path

import numpy as np
import pytest
from arm import arm

from edtk.design.plan import Plan
from edtk.study.plan_study import RunOptions, plan_study
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate

pytestmark = pytest.mark.slow

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
ARM = arm()
PAPERS = STUDY.published_plans()
SOON = 0.5  # seconds after which a search may end


def part(plan, rows):
    """Some rows of a plan."""
    return Plan(plan.q[rows], plan.wrench[rows], plan.repeats[rows])


@pytest.mark.parametrize("name", ["rho0", "E"])
def test_kept_experiments_count_and_the_bound_holds_beside_them(name):
    """New poses complete the kept ones, and no completion is better than the bound."""
    papers = PAPERS["table_4_4"]
    kept = part(papers, slice(0, 2))
    rest = part(papers, slice(2, None))
    found = plan_study(STUDY, 4, name, kept=kept)
    assert found.whole.experiments == 4
    np.testing.assert_array_equal(found.whole.q[:2], kept.q)
    assert found.value == pytest.approx(evaluate(STUDY, found.whole).criteria[name], rel=1e-9)
    cost = STUDY.criterion(name).cost
    rng = np.random.default_rng(1)
    everything = np.concatenate([plan.q for plan in PAPERS.values()])
    drawn = [everything[rng.choice(len(everything), 2)] for _ in range(20)]
    completions = [rest, *(STUDY.space.plan(q, np.ones(2, dtype=int)) for q in drawn)]
    completions += [STUDY.space.plan(rest.q[[i]], np.array([2])) for i in range(2)]
    costs = [float(cost(STUDY.space.information(kept + completion))) for completion in completions]
    assert found.lower_bound.cost <= found.cost <= costs[0]
    assert found.lower_bound.cost <= min(costs)
    assert 0.5 < found.efficiency <= 1


def test_kept_repetitions_count():
    """Kept experiments count with their repetitions, so that only one is new."""
    kept = PAPERS["table_4_3"].repeated(2)
    found = plan_study(STUDY, 7, "A", kept=kept, budget=SOON)
    assert found.plan.experiments == 1
    assert found.whole.experiments == 7


def test_a_short_budget_still_gives_a_plan():
    """Any budget gives a bound and a feasible plan; the text says what the bound is on."""
    found = plan_study(STUDY, 3, "A", budget=1e-6)
    assert found.ended == "budget"
    assert found.starts == 16
    assert found.plan.experiments == 3
    assert found.violation == 0
    assert 0 < found.bound < found.value < np.inf
    assert 1 > found.bound_gap > 1e-3
    assert found.efficiency <= 1
    too_optimistic = f"may be up to {100 * found.bound_gap:.2g} % too optimistic"
    assert f"its search was stopped early: it {too_optimistic}" in found.summary()
    assert "over the candidates and these poses alone" in found.summary()


def test_interrupted_search_has_its_best_plan(monkeypatch):
    """Ctrl-C leaves the best plan so far, and nothing before there is a first design."""

    def after(stage):
        def progress(label, number):
            if stage in label:
                raise KeyboardInterrupt

        return progress

    monkeypatch.setattr("edtk.study.plan_study.STARTS", 64)
    found = plan_study(ARM, 3, "A", options=RunOptions(progress=after("starts")))
    assert (found.ended, found.starts) == ("interrupted", 16)
    assert found.value == pytest.approx(evaluate(ARM, found.whole).criteria["A"], rel=1e-9)
    early = plan_study(ARM, 3, "A", options=RunOptions(progress=after("continuum")))
    assert (early.ended, early.starts) == ("interrupted", 16)
    assert (
        found.value
        <= early.value
        == pytest.approx(evaluate(ARM, early.whole).criteria["A"], rel=1e-9)
    )
    assert early.bound <= early.value
    with pytest.raises(KeyboardInterrupt):
        plan_study(ARM, 3, "A", options=RunOptions(progress=after("candidates")))


def test_progress_tells_of_bound_and_starts():
    """Lines of progress are about the bound first, then about the starts."""
    labels = []
    options = RunOptions(progress=lambda label, number: labels.append(label))
    plan_study(ARM, 3, "A", options=options)
    assert labels[0].startswith("bound: ")
    assert labels[-1] == "16 starts"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"size": 1},
            ["size", "1 experiment cannot identify 5 parameters", "smallest number is 2"],
        ),
        (
            {"size": 3, "distinct": 1},
            ["distinct", "1 distinct pose cannot", "smallest number is 2"],
        ),
        ({"size": 3, "distinct": 4}, ["distinct 4", "at most 3"]),
        (
            {"size": 3, "kept": PAPERS["table_4_3"]},
            ["size 3", "3 experiments are kept", "more than that"],
        ),
        ({"size": 4, "distinct": 2, "kept": PAPERS["table_4_3"]}, ["distinct 2", "at most 1"]),
        ({"size": 3, "criterion": "O6"}, ["unknown criterion 'O6'"]),
    ],
)
def test_what_cannot_be_done_is_one_line(given, words):
    """Every question without an answer is refused with the option and what was expected."""
    with pytest.raises(UserError) as caught:
        plan_study(STUDY, **{"criterion": "A", "budget": SOON, **given})
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)
