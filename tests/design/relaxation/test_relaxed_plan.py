"""A relaxed plan: it recomputes its own proof, and what it prints and writes can be read."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from designs import DESIGNS, KR270, LOADED, STUDY

from criteria import create
from criteria.criterion import unit_of
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.measure.pose_table import WRENCH_COLUMNS

pytestmark = pytest.mark.slow

NAMES = ["A", "D", "E", "G", "O1", "O2", "O3", "O5", "rho0"]
every = pytest.mark.parametrize("name", NAMES)
either = pytest.mark.parametrize("searched", [False, True], ids=["candidates", "all poses"])


@cache
def plan_of(name, space="kr270"):
    """A plan over a few candidates."""
    criterion = STUDY.criterion(name) if space == "kr270" else create(name)
    return relax_poses(CandidateSource(DESIGNS[space], 0), 300, criterion)


def as_if_searched(plan):
    """The same plan with a bound over all poses that is 3 % lower than the proved one."""
    searched = Bound.of(
        plan.criterion, 0.97 * plan.proved_bound.cost, plan.cost, BoundKind.SEARCHED
    )
    return replace(plan, searched_bound=searched, searched_sensitivities=plan.proved_sensitivities)


def slip(plan):
    """Relative error to which a cost and a bound are defined in rounding: 64 p eps cond(M)."""
    M = plan.information
    return 64 * len(M) * np.finfo(float).eps * np.linalg.cond(M)


@every
def test_certify_does_not_believe_what_it_is_told(name):
    """Cost and bound are recomputed: wrong ones in the plan make no difference."""
    plan = plan_of(name)
    wrong = replace(plan.proved_bound, cost=0.9 * plan.cost)
    too_high = replace(wrong, cost=plan.cost, kind=BoundKind.SEARCHED)
    cost, bound = replace(
        plan, cost=0.5 * plan.cost, proved_bound=wrong, searched_bound=too_high
    ).certify()
    assert cost == pytest.approx(plan.cost, rel=slip(plan))
    assert bound == pytest.approx(plan.proved_bound.cost, rel=slip(plan))


@every
def test_certify_takes_the_weights_of_the_plan(name):
    """Other weights have the cost of their information, above the bound."""
    plan = plan_of(name)
    even = replace(plan, weights=np.full(len(plan.weights), 1 / len(plan.weights)))
    cost, bound = even.certify()
    M = KR270.problem(plan.x).blocks().mean(axis=0)
    assert cost == pytest.approx(float(plan.criterion.cost(M)), rel=slip(even))
    assert cost > plan.cost > bound * (1 - slip(plan))


@pytest.mark.parametrize("name", ["A", "D", "E", "O1", "O3", "O5", "rho0"])
def test_certify_is_never_fooled_by_a_multiplier(name):
    """The bound of any positive semidefinite multiplier is not above the optimal cost."""
    plan = plan_of(name)
    rng = np.random.default_rng(0)
    V = np.linalg.cholesky(plan.multipliers[0] + 1e-9 * np.trace(plan.multipliers[0]) * np.eye(5))
    for _ in range(5):
        B = V @ (np.eye(5) + 0.1 * rng.normal(size=(5, 5)))
        _, bound = replace(plan, multipliers=(B @ B.T)[None]).certify()
        assert bound <= plan.cost * (1 + slip(plan))


def test_certify_counts_the_poses_of_the_plan_too():
    """The bound holds for the plan itself, whose poses may not be candidates."""
    plan = plan_of("D")
    alone = replace(plan, candidates=1, x=plan.x[:3], weights=np.full(3, 1 / 3))
    cost, bound = alone.certify()
    assert bound <= cost


@every
def test_values_and_bounds_in_printed_form(name):
    """The value is the criterion as printed in its formula, and the bound is on its better side."""
    plan = as_if_searched(plan_of(name))
    assert plan.value == pytest.approx(
        float(plan.criterion.value(plan.information)), rel=slip(plan)
    )
    data = plan.to_dict()
    value, bound, searched = (data[key] for key in ("value", "bound", "bound_searched"))
    if plan.criterion.sense == "min":
        assert searched < bound <= value * (1 + slip(plan))
    else:
        assert searched > bound >= value * (1 - slip(plan))
    assert bound == pytest.approx(value, rel=1e-6)  # the gap that was asked for
    assert (
        data["gap"] == plan.gap == pytest.approx(1 - plan.proved_bound.cost / plan.cost, abs=1e-15)
    )


@either
def test_best_bound(searched):
    """The best bound is that over all poses where one was searched."""
    plan = as_if_searched(plan_of("A")) if searched else plan_of("A")
    assert plan.best_bound == (plan.searched_bound if searched else plan.proved_bound)


@either
@every
def test_json(name, searched):
    """JSON has the promised keys with plain numbers, the heaviest pose first."""
    plan = as_if_searched(plan_of(name)) if searched else plan_of(name)
    data = json.loads(json.dumps(plan.to_dict(), allow_nan=False))
    promised = {"value", "bound", "gap", "support", "solver", "iterations", "seconds"}
    extra = {"criterion", "bound_searched", "candidates", "multipliers", "seed", "sampling"}
    extra |= {"bounds", "exact"}
    assert promised <= set(data) <= promised | extra
    assert set(data["seconds"]) == {"candidates", "solve", "continuous"}
    assert (data["criterion"], data["candidates"]) == (name, 300)
    assert (data["bound_searched"] is None) == (not searched)
    assert data["iterations"] >= 1
    assert data["solver"] == plan.solver
    weights = [pose["weight"] for pose in data["support"]]
    assert weights == sorted(weights, reverse=True)
    assert sum(weights) == pytest.approx(1, abs=1e-12)
    assert all(set(pose) == {"q_deg", "wrench", "weight"} for pose in data["support"])
    assert all(pose["wrench"] == KR270.load.always.tolist() for pose in data["support"])
    q = np.deg2rad([pose["q_deg"] for pose in data["support"]])
    M = KR270.problem(q).information(weights)
    assert float(plan.criterion.value(M)) == pytest.approx(data["value"], rel=slip(plan) + 1e-12)


@either
def test_dictionary_gives_the_same_plan(searched):
    """A plan that went through JSON is the same to the last bit, in the order of its poses."""
    plan = as_if_searched(plan_of("rho0")) if searched else plan_of("rho0")
    data = json.loads(json.dumps(plan.to_dict(), allow_nan=False))
    again = RelaxedPlan.from_dict(plan.source, plan.criterion, data)
    assert again.to_dict() == plan.to_dict()
    np.testing.assert_array_equal(again.x, plan.x)
    assert (again.proved_bound, again.searched_bound) == (plan.proved_bound, plan.searched_bound)


@pytest.mark.parametrize("space", DESIGNS)
def test_csv(space, tmp_path):
    """Columns are joints in degrees or millimetres, and weight; the heaviest pose is first."""
    plan = plan_of("D", space)
    plan.to_csv(tmp_path / "new" / "plan.csv")
    table = pd.read_csv(tmp_path / "new" / "plan.csv")
    kinds = [joint.kind for joint in plan.space.workspace.robot.joints]
    units = ["mm" if kind == "prismatic" else "deg" for kind in kinds]
    assert list(table) == [*(f"q{j + 1}_{unit}" for j, unit in enumerate(units)), "weight"]
    order = np.argsort(-plan.weights)
    factors = np.where(np.array(units) == "mm", 1e-3, np.pi / 180)
    np.testing.assert_allclose(table.to_numpy()[:, :-1] * factors, plan.x[order], rtol=1e-9)
    np.testing.assert_allclose(table["weight"], plan.weights[order], rtol=1e-9)
    assert (np.diff(table["weight"]) <= 0).all()


LOADS = ["kr270 bounded", "kr270 listed", "kr270 free", "odd free"]
with_loads = pytest.mark.parametrize("name", LOADS)


@cache
def loaded(name):
    """A plan whose loads are designed too."""
    return relax_poses(CandidateSource(LOADED[name], 0), 300, create("D"))


@with_loads
def test_plan_of_designed_loads(name):
    """Poses and wrenches, the heaviest first and once each, are worth what the weights say."""
    plan = loaded(name)
    order = np.argsort(-plan.weights)
    n = len(plan.space.fixed)
    np.testing.assert_array_equal(plan.plan.q, plan.x[order, :n])
    np.testing.assert_array_equal(plan.plan.wrench, plan.space.load.wrench(plan.x[order, n:]))
    assert (plan.plan.repeats == 1).all()
    A = plan.space.model.regressor(plan.plan.q, plan.plan.wrench) / plan.space.sigma[:, None]
    M = np.einsum("k,kri,krj->ij", plan.weights[order], A, A)
    assert float(plan.criterion.cost(M)) == pytest.approx(plan.cost, rel=slip(plan))
    cost, bound = plan.certify()
    assert cost == pytest.approx(plan.cost, rel=slip(plan))
    assert bound == pytest.approx(plan.proved_bound.cost, rel=1e-6)


@with_loads
def test_tables_of_designed_loads(name, tmp_path):
    """Where wrenches are designed, CSV, JSON and summary have them beside the poses."""
    plan = loaded(name)
    plan.to_csv(tmp_path / "plan.csv")
    table = pd.read_csv(tmp_path / "plan.csv")
    assert list(table)[6:] == [*WRENCH_COLUMNS, "weight"]
    np.testing.assert_allclose(table[list(WRENCH_COLUMNS)], plan.plan.wrench, rtol=1e-9, atol=1e-9)
    data = plan.to_dict()["support"]
    np.testing.assert_array_equal([pose["wrench"] for pose in data], plan.plan.wrench)
    header, *rows = plan.summary().splitlines()[3:]
    assert header.split() == ["weight", *table.columns[:-1]]
    numbers = np.array([row.split() for row in rows], dtype=float)
    np.testing.assert_allclose(numbers[:, 7:], plan.plan.wrench, rtol=0, atol=0.51e-3)
    assert {len(row) for row in (header, *rows)} == {len(header)}


def test_csv_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    """An interruption in the middle of writing leaves the file that was there, and no other."""
    path = tmp_path / "plan.csv"
    plan_of("D").to_csv(path)
    before = path.read_text()

    def half(table, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(pd.DataFrame, "to_csv", half)
    with pytest.raises(KeyboardInterrupt):
        plan_of("A").to_csv(path)
    assert path.read_text() == before
    assert [file.name for file in tmp_path.iterdir()] == ["plan.csv"]


@either
@every
def test_summary(name, searched):
    """A person reads value, proved and searched bound with their unit, and poses."""
    plan = as_if_searched(plan_of(name)) if searched else plan_of(name)
    head, *lines = plan.summary().splitlines()
    assert head.startswith(f"{name}, {plan.criterion.title}")
    assert head.endswith(f"{plan.criterion.sense}imised")
    factor = 1e3 if name == "rho0" else 1.0
    unit = f" {unit_of(plan.criterion, plan.space.units)}".rstrip()
    assert lines[0].split(maxsplit=1)[1] == f"{factor * plan.value:.7g}{unit}"
    assert "proved on 300 candidates" in lines[1]
    assert f" {factor * plan.bound:.7g}{unit} " in lines[1]
    assert "not proved" not in lines[1]
    if searched:
        assert "searched over all poses" in lines[2]
        assert "not proved" in lines[2]
        assert f" {factor * plan.searched_bound.value:.7g}{unit} " in lines[2]
    header, *rows = lines[2 + searched :]
    assert header.split() == ["weight", *(f"q{j}_deg" for j in range(1, 7))]
    numbers = np.array([row.split() for row in rows], dtype=float)
    order = np.argsort(-plan.weights)
    np.testing.assert_allclose(numbers[:, 0], plan.weights[order], rtol=0, atol=0.51e-5)
    np.testing.assert_allclose(
        np.deg2rad(numbers[:, 1:]), plan.x[order], rtol=0, atol=np.deg2rad(0.51e-3)
    )
    assert {len(row) for row in (header, *rows)} == {len(header)}


def test_numbers_of_a_summary_stand_below_each_other():
    """Value and bounds begin in the same column, whatever the number of candidates."""
    for n in (3, 2000, 1_000_000):
        lines = replace(as_if_searched(plan_of("rho0")), candidates=n).summary().splitlines()[1:4]
        assert len({line.index(" 0.0") for line in lines}) == 1
