"""Plans that give up a part of their criterion for a second one, and no more than that."""

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from arm import arm
from geometry_sheets import run
from loaded_arm import STUDY
from short_search import short_search

import criteria
import edtk
from edtk.study.give_up import Exchange
from edtk.study.study import Study
from edtk.system.errors import UserError

pytestmark = pytest.mark.slow

TEST_POSE = {
    "q_deg": [10, -60],
    "tool": {"position_mm": [500, 0, 0]},
    "load": {"F_N": [0, 0, -50]},
}
TESTED = arm(candidates=100, criterion="rho0", test_pose=TEST_POSE)
KINDS = {"springs": (TESTED, "q1", "k1"), "parameters": (STUDY, "k_q2", "k_q2")}


def problem_of(a: float) -> np.ndarray:
    """Information about two parameters, each seen by an experiment of its own."""
    return np.diag([1 - a, a])


@pytest.mark.parametrize("allowed", [0.01, 0.2, 0.6])
def test_the_weight_is_that_of_the_constrained_optimum(allowed: float) -> None:
    """Of two parameters the second is told best with weight (1 + sqrt x)/2 where A gives up x.

    A costs ``1/a + 1/(1 - a)``, 4 at best: ``4 a (1 - a) >= 1 - x``.
    """
    problem = edtk.Problem(np.eye(2)[:, None, :])
    exchange = Exchange.of(criteria.create("A"), criteria.create("c", c=[0, 1]), allowed)

    @cache
    def relaxed(weight: float) -> SimpleNamespace:
        found = edtk.relax(problem, exchange.compound(weight))
        return SimpleNamespace(information=problem.information(found.weights), cost=found.cost)

    best = edtk.relax(problem, exchange.first)
    assert best.cost == pytest.approx(4)
    weight = exchange.weight_of(best, relaxed, allowed)
    a = relaxed(weight).information[1, 1]
    assert a == pytest.approx((1 + np.sqrt(allowed)) / 2, abs=1e-3)
    assert exchange.given_up(relaxed(weight).information, best.cost) <= allowed
    others = np.linspace(0.01, 0.99, 99)
    within = [b for b in others if exchange.given_up(problem_of(b), best.cost) <= allowed]
    costs = [exchange.second.cost(problem_of(b)) for b in within]
    assert exchange.second.cost(problem_of(a)) <= min(costs) * (1 + 2e-3)


def test_a_second_criterion_may_cost_all_that_is_allowed() -> None:
    """Where the best of the second gives up little, it is had as it is."""
    problem = edtk.Problem(np.eye(2)[:, None, :])
    exchange = Exchange.of(criteria.create("A"), criteria.create("D"), 0.5)
    best = edtk.relax(problem, exchange.first)

    def relaxed(weight: float) -> SimpleNamespace:
        found = edtk.relax(problem, exchange.compound(weight))
        return SimpleNamespace(information=problem.information(found.weights), cost=found.cost)

    assert exchange.weight_of(best, relaxed, 0.5) > 0.999


@pytest.mark.cell("`plan --for` and `--give-up`")
@pytest.mark.parametrize("kind", KINDS)
def test_no_more_is_given_up_than_allowed(kind: str, tmp_path: Path) -> None:
    """The plan is better for the parameter, within the bound of rho0, and its certificate holds."""
    study, name, told = KINDS[kind]
    proof = tmp_path / "proof.json"
    alone = edtk.plan(study, 6, "rho0", workers=1)
    found = edtk.plan(study, 6, "rho0", workers=1, second=name, give_up=20, certificate=proof)
    one = found.compromise
    assert one is not None
    assert one.second == f"Ds of {told}"
    assert one.value_alone == pytest.approx(alone.value, rel=1e-12)
    assert one.given_up == pytest.approx(1 - alone.value / found.value, abs=1e-12)
    assert 0 < one.given_up <= 0.2
    assert found.bound == pytest.approx(alone.bound, rel=1e-9)
    assert found.efficiency >= 0.8 * alone.efficiency * (1 - 1e-9)
    # Ds of one parameter is one over its variance.
    space = alone.relaxed.space
    names = space.model.parameters if kind == "springs" else space.parameters
    i = list(names).index(told)
    variances = []
    for plan in (alone, found):
        M = plan.relaxed.space.information(plan.whole)
        variances.append(np.linalg.inv(M)[i, i])
    assert one.times == pytest.approx(variances[0] / variances[1], rel=1e-6)
    assert one.times > 1.02
    assert edtk.verify(proof, study).valid
    text = str(found.summary())
    assert f"gained      Ds of {told} = " in text
    assert " of 20 % allowed: " in text
    assert found.to_dict()["compromise"]["given_up_percent"] == pytest.approx(100 * one.given_up)


@pytest.mark.cell("`give_up` of a study")
@pytest.mark.parametrize("kind", KINDS)
def test_a_study_says_what_its_plans_give_up(kind: str) -> None:
    """Its plan is that of a call which says so."""
    study, name, _ = KINDS[kind]
    says = study.replace(give_up={"criterion": name, "percent": 20})
    with short_search():
        called = edtk.plan(study, 6, "rho0", workers=1, second=name, give_up=20)
        found = edtk.plan(says, 6, "rho0", workers=1)
    np.testing.assert_array_equal(found.plan.q, called.plan.q)
    assert found.compromise == called.compromise
    with pytest.raises(UserError, match=r"give_up\.percent"):
        study.replace(give_up={"criterion": name, "percent": 0})


def test_a_call_that_says_otherwise_has_its_own() -> None:
    """It may give up less than the study allows, for the criterion of the study."""
    says = TESTED.replace(give_up={"criterion": "q1", "percent": 20})
    with short_search():
        found = edtk.plan(says, 6, "rho0", workers=1, give_up=3).compromise
    assert found is not None
    assert found.allowed == pytest.approx(0.03)
    assert found.second == "Ds of k1"


@pytest.mark.parametrize("study", [TESTED, STUDY], ids=["springs", "parameters"])
def test_a_day_gives_up_too(study: Study) -> None:
    """Within a budget of costs the bound and the days of other loads are those of rho0 alone."""
    costs = {"visit": 2, "load_change": 2, "budget": 10}
    study = study.replace(costs=costs)
    alone = edtk.plan(study, criterion="rho0", workers=1)
    found = edtk.plan(study, criterion="rho0", workers=1, second="D", give_up=10)
    assert found.spent <= 10
    assert found.value <= alone.value / 0.9 * (1 + 1e-12)
    assert found.bound == pytest.approx(alone.bound, rel=1e-9)
    assert found.tried == pytest.approx(alone.tried)


def test_nothing_is_gained_where_nothing_can_be() -> None:
    """A criterion that is given up for itself stays as it is, and says so."""
    found = edtk.plan(TESTED, 4, "D", workers=1, second="D", give_up=3)
    assert found.compromise is not None
    assert abs(found.compromise.given_up) < 1e-6
    assert found.compromise.times == pytest.approx(1, abs=1e-6)


def test_rho0_may_be_a_part_of_a_compound_criterion() -> None:
    """A study's criterion of several has the task for those that need one, and names them."""
    several = {"name": "compound", "criteria": ["rho0", "D"], "weights": [3, 1]}
    study = TESTED.replace(criterion=several)
    M = np.diag([2.0, 3.0]) * 1e12
    rho0, D = (study.criterion(name).cost(M) for name in ("rho0", "D"))
    degree = study.criterion("rho0").degree
    assert study.criterion("compound").cost(M) == pytest.approx(
        (rho0 ** (1 / degree)) ** 0.75 * D**0.25
    )
    assert edtk.plan(TESTED, 4, several, workers=1).value > 0


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    """One line each, before a search: criteria that are no part of two, names, percent alone."""
    path = tmp_path / "study.toml"
    TESTED.to_toml(path)
    for words, said in (
        (("--for", "E"), "--for E: criterion 'compound': 'E' cannot be a part of it"),
        (("--for", "q9"), "'q9' is no"),
        (("--give-up", "3"), "--give-up 3.0: expected a second criterion"),
    ):
        code, out, err = run("plan", path, "--size", "4", *words)
        assert (code, out, err.strip().count("\n")) == (2, "", 0)
        assert said in err
    code, out, _ = run("plan", path, "--size", "4", "--for", "q1", "--give-up", "9", "--json")
    assert code == 0
    assert json.loads(out)["compromise"]["give_up_percent"] == pytest.approx(9)
