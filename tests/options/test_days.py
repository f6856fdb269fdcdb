"""Days: what visits and load changes cost, for springs as for geometry."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
import pytest
from arm import ROBOT, arm
from click.testing import CliRunner
from loaded_arm import STUDY, plan_geometry

import edtk
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.cli import main
from edtk.design.exact import day_search, visit_search
from edtk.design.exact.day import DayCosts, DayPlan
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax_poses import relaxed_in_time
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.study.plan_study import RunOptions, day_costs, plan_study
from edtk.study.study import Study
from edtk.system.workers import Workers

pytestmark = pytest.mark.usefixtures("shortest_searches")

FORCES = [[0, 0, -100], [80, 0, 0], [60, 0, -60]]
COSTS = {"visit": 1, "loaded_visit": 2, "load_change": 4, "budget": 20}
# The weights of its links load a pose without any other load.
HEAVY = ROBOT | {
    "joints": [
        joint | {"mass_kg": mass, "center_m": [0.3, 0, 0.1]}
        for joint, mass in zip(ROBOT["joints"], (20, 10), strict=True)
    ]
}


def one_pose(**keys: object) -> Study:
    """Springs in one pose, so that the loads are all there is to choose."""
    joints = {"unknown": ["q1", "q2"], "fixed_deg": {"q1": 10, "q2": -60}}
    given = {"load": {"list_F_N": FORCES}, "optimise": ["A"], "costs": COSTS} | keys
    return arm(joints=joints, **given)


def every_day(study: Study, costs: DayCosts, most: int) -> list[tuple[float, Plan]]:
    """All plans within a budget, with their costs by the criterion."""
    q = np.deg2rad([[10.0, -60.0]])
    wrenches = np.array([[*F, 0, 0, 0] for F in study.specification.load.list_F_N], dtype=float)
    criterion = study.criterion("A")
    found = []
    for m in range(1, most + 1):
        for loads in combinations_with_replacement(range(len(wrenches)), m):
            chosen, repeats = np.unique(loads, return_counts=True)
            plan = Plan(np.repeat(q, len(chosen), axis=0), wrenches[chosen], repeats)
            if costs.spent(plan) <= costs.budget:
                found.append((float(criterion.cost(study.information(plan))), plan))
    return found


@pytest.mark.cell("`[costs]` of visits and load changes", "springs")
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"costs": COSTS | {"load_change": 1.5, "budget": 18}},
        {"costs": COSTS | {"load_changes": 3, "load_change": 1}},
        {
            "robot": HEAVY,
            "measurement": {"sigma_mm": 0.1, "reference": "nominal"},
            "load": {"list_F_N": [[0, 0, 0], *FORCES[1:3]]},
            "costs": {"visit": 1, "loaded_visit": 3, "load_change": 2, "budget": 12},
        },
    ],
    ids=["dear", "cheap", "rounds", "absolute"],
)
def test_no_day_is_better(keys: dict[str, object]) -> None:
    """The search finds the best of all plans within the budget, and its bound is below it."""
    study = one_pose(**keys)
    found = plan_study(study, None)
    assert isinstance(found, DayPlan)
    costs = day_costs(study)
    assert costs is not None
    most = int(costs.budget / costs.prices(np.array([[0.0] * 6, [1.0] * 6])).min())
    best, _ = min(every_day(study, costs, most), key=lambda one: one[0])
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.lower_bound.cost <= best * (1 + 1e-9)
    assert found.spent == costs.spent(found.plan) <= costs.budget


def test_the_size_may_be_given() -> None:
    """A budget may pay for a size under one load only."""
    five = plan_study(one_pose(), 5)
    assert five.plan.experiments == 5
    assert len(np.unique(five.plan.wrench, axis=0)) == 1
    with pytest.raises(edtk.UserError, match=r"costs\.budget: 6 experiments cost 22 or more"):
        plan_study(one_pose(), 6)


@pytest.mark.parametrize("turn", [4, 5])
def test_bounds_of_one_kind_make_the_bound_of_a_day(
    turn: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where time ends before all sets are searched, the bounds on candidates count for all sets."""
    calls = iter(range(100))

    def cut_short(*arguments: Any) -> tuple[RelaxedPlan, bool]:
        relaxed, interrupted = relaxed_in_time(*arguments)
        searched = relaxed.searched_bound
        if next(calls) >= turn:
            relaxed = replace(relaxed, searched_bound=None, searched_sensitivities=None)
        elif searched is not None:  # as of a search that has not come to its end
            weaker = replace(searched, cost=0.9 * searched.cost)
            relaxed = replace(relaxed, searched_bound=weaker)
        return relaxed, interrupted

    monkeypatch.setattr(day_search, "relaxed_in_time", cut_short)
    study = arm(load={"list_F_N": FORCES[:2]}, costs=COSTS, candidates=20)
    found = edtk.plan(study, certificate=tmp_path / "c.json")
    told = edtk.verify(tmp_path / "c.json", study)
    assert told.valid, told.summary()
    assert found.lower_bound.cost <= found.cost * (1 + 1e-9)


@pytest.mark.parametrize("turn", range(5))
def test_ctrl_c_ends_a_day_wherever_it_comes(turn: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted while the bound of any set of loads is sought, a day has a plan and ends.

    Three sets of loads have a first bound each, and then a sharper one each. The bound of the day
    rests on all first ones, after which no other is sought.
    """
    sets, calls = 3, 0

    def interrupted_once(*arguments: Any) -> tuple[RelaxedPlan, bool]:
        nonlocal calls
        calls += 1
        relaxed, _ = relaxed_in_time(*arguments)
        return relaxed, calls == turn + 1

    monkeypatch.setattr(day_search, "relaxed_in_time", interrupted_once)
    study = arm(load={"list_F_N": FORCES[:2]}, costs=COSTS, candidates=20)
    found = edtk.plan(study, workers=1)
    assert found.ended == "interrupted"
    assert calls == max(turn + 1, sets)
    assert found.lower_bound.cost <= found.cost * (1 + 1e-9)


@pytest.mark.parametrize(
    ("error", "turn", "ended"),
    [
        (RelaxationError("no solver found a design"), 3, "failed"),
        (RankDeficientError("one direction is open"), 5, "failed"),
        (KeyboardInterrupt(), 1, "interrupted"),
        (KeyboardInterrupt(), 4, "interrupted"),
    ],
)
def test_a_first_plan_is_given_whatever_ends_a_later_search(
    error: BaseException,
    turn: int,
    ended: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is raised before the bound of one of three sets of loads leaves the plans of all."""
    calls = iter(range(100))

    def raising_once(*arguments: Any) -> tuple[RelaxedPlan, bool]:
        if next(calls) == turn:
            raise error
        return relaxed_in_time(*arguments)

    monkeypatch.setattr(day_search, "relaxed_in_time", raising_once)
    study = arm(load={"list_F_N": FORCES[:2]}, costs=COSTS, candidates=20)
    found = edtk.plan(study, workers=1, certificate=tmp_path / "c.json")
    assert found.ended == ended
    assert edtk.verify(tmp_path / "c.json", study).valid


def test_ctrl_c_before_any_plan_of_a_day_leaves_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is there to give, and nobody waits for a second set of loads."""
    calls = 0

    def interrupted(*arguments: Any) -> tuple[RelaxedPlan, bool]:
        nonlocal calls
        calls += 1
        raise KeyboardInterrupt

    monkeypatch.setattr(day_search, "relaxed_in_time", interrupted)
    with pytest.raises(KeyboardInterrupt):
        edtk.plan(arm(load={"list_F_N": FORCES[:2]}, costs=COSTS, candidates=20), workers=1)
    assert calls == 1


@pytest.mark.parametrize(
    "load", [{"list_F_N": FORCES[:2]}, {"F_max_N": 90, "direction": [0, 0, -1]}]
)
def test_certificates_of_days(load: dict[str, object], tmp_path: Path) -> None:
    """The claims are recomputed, and hold for the study's costs alone.

    Of forces along a direction the largest one tells most.
    """
    study = arm(load=load, costs=COSTS)
    found = edtk.plan(study, certificate=tmp_path / "c.json")
    assert edtk.verify(tmp_path / "c.json", study).valid
    assert found.spent == 19
    dearer = study.replace(costs=COSTS | {"visit": 2})
    assert not edtk.verify(tmp_path / "c.json", dearer).valid
    largest = np.linalg.norm(found.plan.wrench, axis=1)
    assert largest == pytest.approx([90.0] * len(largest) if "F_max_N" in load else largest)


def test_forces_of_any_direction_have_no_sets() -> None:
    """Where changes cost something they are refused; where none does, each pose has its own."""
    free = {"load": {"F_max_N": 90}, "costs": COSTS}
    with pytest.raises(edtk.UserError, match=r"load\.F_max_N: poses that choose"):
        plan_study(arm(**free), None)
    found = plan_study(arm(**free | {"costs": COSTS | {"load_change": 0}}), None)
    assert found.plan.experiments == 6
    assert found.cost == pytest.approx(plan_study(arm(**free | {"costs": None}), 6).cost)


def test_days_of_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It prints what the day costs, and two workers find what one finds."""
    monkeypatch.chdir(tmp_path)
    arm(load={"list_F_N": FORCES[:2]}).to_toml("study.toml")
    costs = '[costs]\nvisit = 1\nloaded_visit = 2\nload_change = 4\nunit = "min"\n'
    Path("study.toml").write_text(Path("study.toml").read_text() + costs)
    words = ["plan", "study.toml", "--cost-budget", "20", "--out"]
    for workers in ("1", "2"):
        result = CliRunner().invoke(main, [*words, f"{workers}.csv", "--workers", workers])
        assert result.exit_code == 0
        expected = "5 experiments, each without its load and with it, and 1 load change of 4 min"
        assert f"costs 19 min of 20 min: {expected}" in result.stdout
    assert Path("1.csv").read_bytes() == Path("2.csv").read_bytes()


def test_sheets_and_runs_of_days(tmp_path: Path) -> None:
    """The poses of a load follow each other, and `run` compares plans that the budget pays for."""
    study = arm(load={"list_F_N": FORCES[:2]}, costs=COSTS | {"load_change": 1}, sizes=[4])
    q = np.deg2rad([[10, 20], [50, -60], [12, 22], [55, -60]])
    wrench = np.array([[*FORCES[i], 0, 0, 0] for i in (0, 1, 1, 0)], dtype=float)
    sheet = edtk.template(study, Plan(q, wrench, np.array([1, 2, 1, 1])))
    assert (np.diff(sheet["Fz_N"]) != 0).sum() == 1
    run = edtk.run(study, tmp_path)
    (best,) = [case for case in run.cases if case.kind == "optimised" and case.optimised == "D"]
    costs = day_costs(study)
    assert costs is not None
    assert costs.spent(best.plan) <= 20
    assert "optimised plans cost 20 at most" in (tmp_path / "report.md").read_text()


def answers_of_others(workers: Workers, pieces: Sequence[Callable[[], object]]) -> object:
    """What other processes answer to copies of the pieces, the last one first."""
    copies = [cloudpickle.loads(cloudpickle.dumps(piece)) for piece in pieces]
    return reversed([(i, piece()) for i, piece in enumerate(copies)])


@pytest.mark.cell("`plan --workers` and `--dask`", "parameters")
def test_plans_of_geometry_do_not_depend_on_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans that are improved side by side come out as together."""
    one = plan_geometry(STUDY, 8)
    monkeypatch.setattr(visit_search, "LONG_RELAXATION", 0.0)
    monkeypatch.setattr(Workers, "_run_in_parallel", answers_of_others)
    two = plan_geometry(STUDY, 8, options=RunOptions(workers=Workers(2)))
    assert two.plan.to_dict() == one.plan.to_dict()
    assert two.lower_bound == one.lower_bound


@pytest.mark.cell("`relax --workers` and `--dask`")
@pytest.mark.parametrize("study", [STUDY, arm()], ids=["geometry", "springs"])
def test_relaxations_do_not_depend_on_workers(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Candidates beyond memory are gone over by others, with the same weights at the end."""
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.capacity", lambda *_: 150)
    monkeypatch.setattr(Workers, "_run_in_parallel", answers_of_others)
    one, two = (edtk.relax(study, "D", candidates=2000, workers=number) for number in (1, 2))
    assert two.candidates == 2000
    expected, found = one.to_dict(), two.to_dict()
    del expected["seconds"], found["seconds"]
    assert found == expected


@pytest.mark.cell("free and bounded loads", "parameters")
def test_forces_of_visits() -> None:
    """Of forces along a direction, nothing and the largest are enough; any force is no worse."""
    sizes = {"F_max_N": 100, "direction": [0, 0, -2]}
    given = plan_geometry(STUDY, 6, "D")
    along = plan_geometry(STUDY.replace(load=sizes), 6, "D")
    assert along.cost == pytest.approx(given.cost, rel=1e-12)
    anyhow = plan_geometry(STUDY.replace(load={"F_max_N": 100}), 6, "D")
    assert anyhow.cost <= given.cost * (1 + 1e-6)
    assert anyhow.efficiency <= 1 + 1e-6
    sizes = np.linalg.norm(anyhow.plan.wrench[:, :3], axis=1)
    assert sizes.max() == pytest.approx(100, rel=1e-6)


def test_slopes_by_the_force_of_a_visit() -> None:
    """They are differences of the rows, for every variable of a visit."""
    study = STUDY.replace(load={"F_max_N": 100}, noise={"repeatability_deg": 0.01})
    space = GeometryQuestion.of(study).space
    x = space.draw(np.random.default_rng(1).random((3, 5)))
    G = np.diag(np.arange(1.0, space.p + 1))
    B = 2 * space.at(x).regressor @ G
    slope = space.at(x).slope(B)
    for j in range(x.shape[1]):
        step = 1e-6 * np.eye(x.shape[1])[j]
        ends = [
            np.einsum("krp,pq,krq->k", A, G, A)
            for A in (space.rows(x + step), space.rows(x - step))
        ]
        assert slope[:, j] == pytest.approx(
            (ends[0] - ends[1]) / 2e-6, rel=1e-5, abs=1e-6 * abs(slope).max()
        )


def test_certificates_of_forces_of_visits(tmp_path: Path) -> None:
    """Draws of forces are made again, and the bound over them is found again."""
    study = STUDY.replace(load={"F_max_N": 100})
    edtk.plan(study, 6, "D", certificate=tmp_path / "c.json")
    assert edtk.verify(tmp_path / "c.json", study).valid


def test_changes_of_positions_are_pairs(tmp_path: Path) -> None:
    """Visits of geometry that are read loaded less unloaded cost both, and others one."""
    changes = {"sigma_mm": 0.1, "reference": "unloaded"}
    prices = {"visit": 1, "loaded_visit": 2, "load_change": 3, "budget": 21}
    study = STUDY.replace(measurement=changes, costs=prices)
    found = edtk.plan(study, criterion="D", certificate=tmp_path / "c.json")
    loaded = int(found.plan.repeats[found.plan.wrench.any(axis=1)].sum())
    assert loaded > 0
    assert found.spent == 3 * loaded + (found.plan.experiments - loaded) + 3
    assert found.spent <= 21
    assert edtk.verify(tmp_path / "c.json", study).valid


@pytest.mark.parametrize("study", [STUDY, arm()], ids=["geometry", "springs"])
def test_plans_beside_excluded_poses_are_verified(study: Study, tmp_path: Path) -> None:
    """A certificate holds the poses that are excluded, which the study does not name."""
    plan = Plan(np.deg2rad([[10.0, 20.0]]), np.array([[0, 0, -100.0, 0, 0, 0]]), np.array([1]))
    plan.to_csv(tmp_path / "p.csv", study.robot)
    edtk.plan(study, 4, "D", exclude=tmp_path / "p.csv", certificate=tmp_path / "c.json")
    assert edtk.verify(tmp_path / "c.json", study, exclude=tmp_path / "p.csv").valid
    assert not edtk.verify(tmp_path / "c.json", study).valid
