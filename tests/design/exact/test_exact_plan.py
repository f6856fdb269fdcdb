"""What an exact plan says of itself."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from designs import KR270, LOADED, STUDY

from criteria import create
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource, sample_feasible
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.measure.pose_table import WRENCH_COLUMNS


@cache
def exact(name="D", beside=False, space=KR270):
    """A made-up plan of two poses and five experiments, on request beside one that is kept."""
    criterion = STUDY.criterion("rho0") if name == "rho0" else create(name)
    x = sample_feasible(space, 3, 4)
    kept = space.plan(x[2:], np.array([1])) if beside else None
    if kept is not None:
        space = space.with_kept(space.information(kept), 5)
    plan = space.plan(x[:2], np.array([3, 2]))
    cost = float(criterion.cost(space.information(plan)))
    best = cost * 5**criterion.degree
    largest = LargestSensitivities(np.ones(1), x[:1])
    relaxed = RelaxedPlan(
        source=CandidateSource(space, 0),
        candidates=10,
        criterion=criterion,
        x=x[:2],
        weights=np.array([0.6, 0.4]),
        cost=best,
        proved_bound=Bound.of(criterion, 0.9 * best, best, BoundKind.PROVED_ON_CANDIDATES),
        searched_bound=Bound.of(criterion, 0.8 * best, best, BoundKind.SEARCHED),
        multipliers=np.eye(5)[None],
        proved_sensitivities=largest,
        searched_sensitivities=largest,
        solver="none",
        iterations=0,
    )
    return ExactPlan(relaxed, plan, kept, cost, 32, 3, 4, 1.25, "stagnation")


@pytest.mark.parametrize("name", ["D", "rho0", "O2", "O4"])
@pytest.mark.parametrize("beside", [False, True])
def test_bound_and_efficiency(name, beside):
    """The bound of m experiments is that of one, divided by m to the degree.

    The bound that speaks of all poses is taken where there is one.
    """
    plan = exact(name, beside)
    assert plan.lower_bound.cost == pytest.approx(0.8 * plan.cost, rel=1e-12)
    assert plan.efficiency == pytest.approx(0.8, rel=1e-12)
    proved = replace(plan, relaxed=replace(plan.relaxed, searched_bound=None))
    assert proved.efficiency == pytest.approx(0.9, rel=1e-12)


@pytest.mark.parametrize("name", ["D", "rho0", "O2", "O4"])
def test_printed_values(name):
    """Value and bound are printed by the formula: a maximised value is below its bound."""
    plan = exact(name)
    M = KR270.information(plan.plan)
    maximised = plan.relaxed.criterion.sense == "max"
    assert plan.value == pytest.approx(float(plan.relaxed.criterion.value(M)), rel=1e-9)
    assert plan.bound / plan.value == pytest.approx(1 / 0.8 if maximised else 0.8, rel=1e-12)


@pytest.mark.parametrize("name", ["D", "rho0"])
def test_whole(name):
    """The whole plan has what was there first, and its value is the plan's."""
    assert exact(name).whole is exact(name).plan
    plan = exact(name, True)
    assert plan.whole.repeats.tolist() == [1, 3, 2]
    np.testing.assert_array_equal(plan.whole.q, np.concatenate([plan.kept.q, plan.plan.q]))
    value = float(plan.relaxed.criterion.value(KR270.information(plan.whole)))
    assert plan.value == pytest.approx(value, rel=1e-9)


def test_violation():
    """The violation is that of the worst new pose; kept poses do not count."""
    assert exact().violation == 0
    plan = exact(beside=True)
    low = Plan(np.array([[0, 0.7, 1.0, 0, 0, 0]]), plan.plan.wrench[:1], np.array([1]))
    worst = -float(KR270.workspace.slack(low.q).min())
    assert worst > 0
    assert replace(plan, plan=plan.plan + low).violation == worst
    assert replace(plan, kept=low).violation == 0


@pytest.mark.parametrize("beside", [False, True])
def test_json(beside):
    """A program gets plain numbers; each pose has degrees, wrench, and whether it is kept."""
    plan = exact("rho0", beside)
    data = json.loads(json.dumps(plan.to_dict(), allow_nan=False))
    assert data["criterion"] == "rho0"
    assert data["experiments"] == 5 + beside
    for key in ("value", "bound", "efficiency", "starts", "found", "optima", "ended", "seconds"):
        assert data[key] == getattr(plan, key)
    assert data["constraint_violation"] == 0
    assert data["bound_searched"] is True
    assert [row["kept"] for row in data["plan"]] == [True] * beside + [False] * 2
    assert [row["repeats"] for row in data["plan"]] == plan.whole.repeats.tolist()
    np.testing.assert_allclose(
        [row["q_deg"] for row in data["plan"]], np.rad2deg(plan.whole.q), rtol=1e-14
    )
    np.testing.assert_array_equal([row["wrench"] for row in data["plan"]], plan.whole.wrench)


@pytest.mark.parametrize("beside", [False, True])
def test_round_trip(beside):
    """A plan comes back from its plain numbers bit by bit, by way of JSON, with its relaxation."""
    plan = exact("rho0", beside)
    back = ExactPlan.from_dict(plan.relaxed, json.loads(json.dumps(plan.to_dict())))
    assert back.to_dict() == plan.to_dict()
    for name in ("q", "wrench", "repeats"):
        np.testing.assert_array_equal(getattr(back.whole, name), getattr(plan.whole, name))
    assert (back.cost, back.kept is None) == (plan.cost, plan.kept is None)


def test_frame():
    """The table has a pose a row, repetitions first, and wrenches where they may differ."""
    angles = [f"q{i}_deg" for i in range(1, 7)]
    alone = exact("rho0").to_frame()
    assert list(alone) == ["repeats", *angles]
    assert alone["repeats"].tolist() == [3, 2]
    np.testing.assert_allclose(alone[angles], np.rad2deg(exact("rho0").plan.q), rtol=1e-14)
    beside = exact("rho0", True).to_frame()
    assert list(beside) == ["repeats", *angles, *WRENCH_COLUMNS, "kept"]
    assert beside["kept"].tolist() == [True, False, False]
    assert "Fz_N" in exact("D", space=LOADED["kr270 free"]).to_frame()


def test_json_without_a_bound():
    """A bound that says nothing is null in JSON, and a proved one is not called searched."""
    plan = exact("D")
    nothing = replace(plan.relaxed.proved_bound, cost=0.0)
    relaxed = replace(plan.relaxed, proved_bound=nothing, searched_bound=None)
    data = replace(plan, relaxed=relaxed).to_dict()
    assert data["bound"] is None
    assert data["efficiency"] == 0
    assert data["bound_searched"] is False
    json.dumps(data, allow_nan=False)


def test_summary():
    """The summary has value and bound in mm, efficiency, the search, and a line per pose."""
    plan = exact("rho0")
    lines = plan.summary().splitlines()
    assert lines[0].startswith("rho0, ")
    assert lines[0].endswith("; 5 experiments in 2 poses")
    assert lines[1].split() == ["value", f"{1e3 * plan.value:.6g}", "mm"]
    assert lines[2].split()[:3] == ["bound", f"{1e3 * plan.bound:.6g}", "mm"]
    assert "not proved" in lines[2]
    assert lines[3].split() == ["efficiency", "80.00", "%"]
    assert lines[4] == "32 starts in 1.2 s ended in 4 different plans, 3 times in this one"
    assert lines[5].split() == ["repeats", *(f"q{i}_deg" for i in range(1, 7))]
    assert [line.split()[0] for line in lines[6:]] == ["3", "2"]
    assert lines[6].split()[1:] == [f"{x:.3f}" for x in np.rad2deg(plan.plan.q[0])]
    proved = replace(plan, relaxed=replace(plan.relaxed, searched_bound=None))
    assert "over the candidates" in proved.summary().splitlines()[2]
    assert "mm" not in exact("D").summary()


def test_summary_of_wrenches():
    """Wrenches are shown where they may differ: for designed loads, beside kept experiments."""
    assert "Fz_N" not in exact("D").summary()
    assert "Fz_N" in exact("D", space=LOADED["kr270 free"]).summary()
    beside = exact("D", True).summary().splitlines()
    assert "Fz_N" in beside[5]
    assert beside[0].endswith("6 experiments in 3 poses, 1 of them there already")
    assert [line.endswith("kept") for line in beside[6:]] == [True, False, False]
