"""Plans of studies of geometry: values that are true, loads that pay, budgets that are kept."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY, plan_geometry

import edtk
from edtk.calibration.geometry_plan import GeometryPlan
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.cli import main
from edtk.design.bound import BoundKind
from edtk.design.plan import Plan
from edtk.design.relaxation import search_continuum
from edtk.study.plan_study import RunOptions
from edtk.study.study import Study
from edtk.system.errors import UserError

FREE = {"load_change": 8, "visit": 2}


@pytest.fixture(scope="module", autouse=True)
def small_screen() -> Iterator[None]:
    """Two joints need no twenty thousand fresh poses to choose starts of ascents from."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_continuum, "SCREEN", 500)
        yield


def priced(**costs: object) -> Study:
    """The study with costs of its own."""
    return STUDY.replace(costs=FREE | costs)


def deviations(found: GeometryPlan) -> np.ndarray:
    """L (p, p) with covariance ``L L'`` by plain stacking of weighted rows, without squares."""
    plan = found.whole
    A = found.question.rows(plan.q, plan.wrench).reshape(-1, found.question.model.p) / 0.1
    weights = np.repeat(plan.repeats, 3).astype(float)
    return np.linalg.inv(np.linalg.qr(np.sqrt(weights)[:, None] * A, mode="r"))


@pytest.fixture(scope="module")
def eight() -> GeometryPlan:
    """Eight visits, without regard to costs."""
    return plan_geometry(STUDY, 8)


@pytest.mark.cell("`[noise] discrepancy_mm`, the model's error, stated", "parameters")
def test_what_the_model_leaves_out_spreads_the_visits(eight: GeometryPlan, tmp_path: Path) -> None:
    """Visits that share an error are poses of their own, of which the certificate proves all."""
    study = STUDY.replace(noise={"discrepancy_mm": 0.3})
    found = edtk.plan(study, 8, certificate=tmp_path / "c.json")
    assert isinstance(found, GeometryPlan)
    own = np.unique(np.column_stack([found.plan.q, found.plan.wrench]), axis=0)
    assert len(own) == 8 > len(eight.plan.q)
    assert 0.85 < found.efficiency <= 1 + 1e-6
    proved = json.loads((tmp_path / "c.json").read_text())
    checked = edtk.verify(proved, study)
    assert checked.valid, checked.summary()
    proved["setting"]["noise"]["discrepancy"] = [0.2e-3] * 3
    assert not edtk.verify(proved).valid
    # The plan of exact models is worth less where they are not, and a pose twice is no two poses.
    space = found.question.space
    cost = found.relaxed.criterion.cost
    assert found.cost < float(cost(space.information(eight.plan)))
    once, twice = (space.information(eight.plan.repeated(times)) for times in (1, 10**6))
    assert np.linalg.eigvalsh(twice - once).min() > 0
    assert float(cost(twice)) > 0.3 * float(cost(once))


def test_value_and_bound(eight: GeometryPlan) -> None:
    """The value is that of the poses as they are written, and no plan can be much better."""
    assert eight.whole.experiments == 8
    assert eight.efficiency == pytest.approx(1, abs=0.02)
    assert eight.efficiency <= 1 + 1e-6
    rows = eight.question.rows(np.deg2rad([[10, -60]]), np.array([[0, 0, -50, 0, 0, 0]]))[0]
    expected = np.linalg.norm(rows @ deviations(eight))
    assert 1e3 * eight.value == pytest.approx(expected, rel=1e-9)
    assert eight.to_dict()["rho0_mm"] == pytest.approx(expected, rel=1e-9)
    assert eight.violation == 0.0


def test_poses_near_each_other_have_their_own_value(eight: GeometryPlan) -> None:
    """The value of a plan is that of its poses, also where they all but leave a direction open."""
    question = eight.question
    q = np.tile(eight.plan.q, (2, 1))
    q[:, 1] = np.deg2rad(-60) + 2e-5 * np.arange(len(q))
    near = Plan(q, np.tile(eight.plan.wrench, (2, 1)), np.tile(eight.plan.repeats, 2))
    B = question.space.rows_of(near) * np.sqrt(near.repeats)[:, None, None]
    _, s, V = np.linalg.svd(B.reshape(-1, question.model.p), full_matrices=False)
    criterion = question.criterion("rho0")
    expected = np.linalg.norm(criterion.target @ (V.T / s))
    by_squares = float(criterion.cost(question.information(near)))
    assert abs(by_squares / expected - 1) > 1e-9  # squares have lost digits
    assert question.cost(criterion, near) == pytest.approx(expected, rel=1e-9)
    evaluated = edtk.evaluate(question.study, near).criteria["rho0"]
    assert evaluated == pytest.approx(expected, rel=1e-9)


def test_a_plan_is_better_than_chance(eight: GeometryPlan) -> None:
    """No plan of as many random visits comes near it."""
    question = eight.question
    rng = np.random.default_rng(0)
    criterion = question.criterion("rho0")
    values = []
    for _ in range(200):
        q = rng.uniform(*STUDY.robot.limits, (8, 2))
        wrench = np.array(LOAD) * rng.integers(0, 2, 8)[:, None]
        plan = edtk.Plan(q, wrench, np.ones(8, dtype=int))
        values.append(criterion.value(question.space.information(plan)))
    assert eight.value < min(values)


@pytest.mark.cell("listed loads", "parameters")
def test_the_poses_say_which_are_loaded(eight: GeometryPlan) -> None:
    """The table of poses holds every visit once, in JSON, text and file alike."""
    data = eight.to_dict()
    loaded = sum(one["loaded"] for one in data["poses"])
    assert loaded + sum(one["unloaded"] for one in data["poses"]) == 8
    is_loaded = eight.whole.wrench.any(axis=1)
    assert eight.whole.repeats[is_loaded].sum() == loaded
    assert data["loads"] == [[0.0] * 6, [float(x) for x in LOAD]]
    assert f"{loaded} visits under load, F = (0, 0, -100) N" in eight.summary()
    assert data["costs"] is None
    assert "<table" in eight._repr_html_()


def test_a_load_change_is_paid_for() -> None:
    """Within a budget a plan of both loads has fewer visits, and the better plan is taken."""
    dear = plan_geometry(priced(load_change=8), cost_budget=20, criterion="D")
    assert dear.spent is not None
    assert dear.spent <= 20
    assert set(dear.tried) == {(0, 1), (1,)}  # without a load the springs are open
    assert dear.whole.experiments == 10
    assert dear.whole.wrench.any(axis=1).all()
    assert dear.to_dict()["costs"] == {
        "spent": 20.0,
        "budget": 20.0,
        "load_changes": 0,
        "unit": "",
    }
    cheap = plan_geometry(priced(load_change=0), cost_budget=20, criterion="D")
    assert cheap.value >= dear.value * (1 - 1e-4)


@pytest.mark.cell("`[costs]` of visits and load changes", "parameters")
def test_visits_of_different_prices() -> None:
    """Where loaded visits cost more, the bound counts costs, and no plan exceeds the budget."""
    found = plan_geometry(priced(loaded_visit=5, load_change=1), cost_budget=31)
    visits = found.poses.visits.sum(axis=0)
    assert found.spent == visits @ [2, 5] + (1 if visits.all() else 0)
    assert found.spent <= 31
    assert 0.8 < found.efficiency <= 1 + 1e-6


@pytest.mark.cell("`plan --keep`", "parameters")
def test_kept_visits_count() -> None:
    """Visits that were made already are part of the plan, and cost nothing more."""
    kept = edtk.Plan(np.deg2rad([[30.0, 40.0]]), np.array([LOAD], dtype=float), np.array([2]))
    found = plan_geometry(priced(), 5, kept=kept)
    assert found.whole.experiments == 5
    assert found.plan.experiments == 3
    assert found.spent == 2 * 3 + 8 * (len(set(found.plan.wrench[:, 2])) - 1)
    assert found.poses_kept.sum() == 2
    assert found.summary().count("2 of them kept") == 1
    assert found.value == pytest.approx(
        found.question.criterion("rho0").value(found.question.space.information(found.whole))
    )


def test_kept_visits_beside_different_prices() -> None:
    """The search judges plans of any number of visits beside all that was measured already."""
    kept = edtk.Plan(np.deg2rad([[30.0, 40.0]]), np.array([LOAD], dtype=float), np.array([4]))
    found = plan_geometry(priced(loaded_visit=5, load_change=0), cost_budget=20, kept=kept)
    assert min(found.tried.values()) == pytest.approx(found.cost, rel=1e-4)
    assert found.efficiency <= 1 + 1e-6


@pytest.mark.parametrize(
    ("keys", "arguments", "message"),
    [
        ({}, {}, "size: expected the number of visits"),
        ({}, {"size": 4, "cost_budget": 3.0}, "cost_budget 3.0: 4 visits cost 4 or more"),
        (
            {"load": {"F_max_N": 10}, "costs": FREE},
            {"cost_budget": 4.0},
            r"load\.F_max_N: poses that choose",
        ),
        ({"costs": {"budget": 3}}, {"size": 4}, "costs.budget: 4 visits cost 4 or more .got 3"),
        (
            {"costs": {"budget": 2}},
            {"criterion": "D"},
            "costs.budget: so few visits cannot tell 6 parameters apart; expected 3 or more",
        ),
        ({}, {"size": 10**6}, "more than 500 new visits"),
        ({}, {"size": 1, "criterion": "D"}, "size 1: so few visits cannot tell 6 parameters"),
        (
            {"interest": {"parameters": ["compliance"]}},
            {"size": 1, "criterion": "A"},
            "size 1: so few visits cannot tell what A needs",
        ),
    ],
)
def test_what_cannot_be_planned(
    keys: dict[str, object], arguments: dict[str, object], message: str
) -> None:
    """One line names the argument or the key."""
    with pytest.raises(edtk.UserError, match=message):
        plan_geometry(STUDY.replace(**keys), **arguments)


def test_fixed_joints_leave_something_open() -> None:
    """What no feasible pose tells is named; a task that depends on it is refused."""
    fixed = STUDY.replace(joints={"fixed_deg": {"q2": -60}}, criterion="D", test_pose=None)
    question = GeometryQuestion.of(fixed)
    assert question.model.p < question.structural.p
    assert len(question.untold) == question.structural.p - question.model.p
    other = fixed.replace(test_pose={**STUDY.to_dict()["test_pose"], "q_deg": [10, 20]})
    with pytest.raises(edtk.UserError, match="test_pose: depends on what no feasible pose tells"):
        GeometryQuestion.of(other).criterion("rho0")


def test_springs_that_no_load_bends() -> None:
    """A load along the axes of both joints turns neither, and the plan says so."""
    question = GeometryQuestion.of(STUDY.replace(load={"F_N": [0, -100, 0]}))
    assert [words.split(" moves")[0] for words in question.untold] == [
        "the compliance of joint q1",
        "the compliance of joint q2",
    ]
    assert question.model.p == question.structural.p


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`edtk plan` prints JSON with the keys of other plans, and writes a file of visits."""
    monkeypatch.chdir(tmp_path)
    STUDY.to_toml("study.toml")
    words = ["plan", "study.toml", "--size", "5", "--json", "--out", "plan.csv"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert {"value", "bound", "efficiency", "plan", "poses", "rank", "parameters"} <= set(found)
    assert edtk.load_study("study.toml").load_plan("plan.csv").experiments == 5
    for option, reason in (
        (["--distinct", "2"], "2 distinct poses cannot identify 6 parameters; the smallest number"),
        (["--distinct", "6"], "expected at most 5, the number of new visits"),
        (["--detect", "x=1mm"], "no fault 'x'; expected one of load_size"),
        (["--detect", "tool_x=1mm,tool_x=2mm"], "tool_x is there twice"),
        (["--detect", "tool_x=0mm"], "tool_x=0mm: expected a size other than 0"),
        (["--detect", ""], "expected pairs like tool_z=5mm"),
        (["--dask", "tcp://h:1"], "no Dask scheduler answers at tcp://h:1"),
    ):
        refused = CliRunner().invoke(main, ["plan", "study.toml", "--size", "5", *option])
        assert refused.exit_code == 2
        assert reason in refused.stderr


@pytest.mark.cell("`plan --distinct`", "parameters")
def test_few_different_visits() -> None:
    """Eight visits of three kinds repeat them as often as is best; more kinds are no worse."""
    three = plan_geometry(STUDY, 8, "D", distinct=3)
    assert sorted(three.plan.repeats) == [2, 3, 3]  # as whole numbers share eight evenly
    four = plan_geometry(STUDY, 8, "D", distinct=4)
    assert len(four.plan.q) <= 4
    assert three.plan.experiments == four.plan.experiments == 8
    # Another search, of robots, finds 79.80 and 84.10.
    assert three.value == pytest.approx(79.8037, rel=1e-4)
    assert four.value == pytest.approx(84.0985, rel=2e-3)
    assert four.efficiency <= 1 + 1e-6


@pytest.mark.parametrize("costs", [{"load_change": 8}, {"loaded_visit": 5, "load_change": 1}])
def test_few_different_visits_within_a_budget(costs: dict[str, float]) -> None:
    """They are repeated as often as the budget pays for, and more kinds are no worse."""
    study = priced(**costs)
    three = plan_geometry(study, criterion="D", cost_budget=31, distinct=3)
    free = plan_geometry(study, criterion="D", cost_budget=31)
    assert len(three.plan.q) <= 3 < three.plan.experiments
    assert three.spent is not None
    assert 31 - 5 < three.spent <= 31
    assert 0.9 * free.value < three.value < free.value * (1 + 2e-3)
    assert three.efficiency <= 1 + 1e-6
    if "loaded_visit" in costs:
        return
    other = plan_geometry(study, criterion="D", cost_budget=31, options=RunOptions(seed=5))
    # Plans of one start were apart by 5 %.
    assert other.value == pytest.approx(free.value, rel=1e-3)


def test_too_few_different_visits_within_a_budget() -> None:
    """One pose under one load does not tell four parameters, however often it is visited."""
    with pytest.raises(UserError, match="distinct 1: so few different visits cannot tell"):
        plan_geometry(priced(loaded_visit=5), criterion="D", cost_budget=31, distinct=1)


@pytest.mark.parametrize("study", [STUDY, priced(budget=20)], ids=["size", "costs"])
def test_without_time_there_is_a_first_plan(study: Study) -> None:
    """Any time gives a plan that tells all, and bounds that hold on the candidates and for it."""
    size = 8 if study is STUDY else None
    first = plan_geometry(study, size, budget=1e-9)
    assert first.ended == "budget"
    assert np.isfinite(first.cost)
    assert first.violation == 0.0
    assert 0 < first.efficiency <= 1
    assert first.lower_bound.kind is BoundKind.PROVED_ON_CANDIDATES
    assert "over the candidates and these poses alone" in first.summary()
    if study is not STUDY:
        assert first.spent is not None
        assert first.spent <= 20
        assert set(first.proofs) == set(plan_geometry(study).proofs)


@pytest.mark.parametrize("study", [STUDY, priced(budget=20)], ids=["size", "costs"])
def test_ctrl_c_leaves_a_plan_while_the_bound_is_sought(study: Study) -> None:
    """As soon as there is a first plan it is what Ctrl-C leaves, with the bound so far."""
    size = 8 if study is STUDY else None

    def enough(label: str, number: float) -> None:
        if "continuum" in label:
            raise KeyboardInterrupt

    found = plan_geometry(study, size, options=RunOptions(progress=enough))
    assert found.ended == "interrupted"
    assert np.isfinite(found.cost)
    assert 0 < found.efficiency <= 1
    assert found.whole.experiments <= 8 if size else found.spent is not None
