"""Days: short in time over free ways, loads together, repetitions spread, and each step timed."""

import json
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from arm import arm
from click.testing import CliRunner
from loaded_arm import STUDY

import edtk
from edtk.calibration.template import visit_order
from edtk.calibration.timetable import day_of
from edtk.cell.legs import TOLERANCE, prove_legs
from edtk.cli import main
from edtk.design.exact.day import DayCosts
from edtk.design.plan import Plan

FORCE = np.array([0, 0, -100.0, 0, 0, 0])
TIMES = {"speed_deg_per_s": {"q1": 10, "q2": 30}, "dwell_s": 5, "spread_percent": 0}
POST = {"name": "post", "size_mm": [100, 900, 100], "position_mm": [1100, 0, 1000]}
LINKS = [
    {"name": "upper", "joint": "q1", "from_mm": [0, 0, 0], "to_mm": [700, 0, 0], "radius_mm": 30},
    {"name": "fore", "joint": "q2", "from_mm": [0, 0, 0], "to_mm": [500, 0, 0], "radius_mm": 30},
]
SCENE = {"bodies": False, "margin_mm": 10, "capsule": LINKS, "box": [POST], "home_deg": [-90, 0]}


def plan_of(q_deg, repeats=None, wrench=None):
    """A plan of poses [deg], once each under one force unless something else is said."""
    q = np.deg2rad(np.array(q_deg, dtype=float))
    times = np.ones(len(q), dtype=int) if repeats is None else np.array(repeats)
    return Plan(q, np.tile(FORCE, (len(q), 1)) if wrench is None else np.array(wrench), times)


def driving(plan, order, speeds=(10, 30)):
    """Time of direct legs between rows in an order [s]."""
    legs = np.abs(np.diff(np.rad2deg(plan.q[list(order)]), axis=0))
    return (legs / speeds).max(axis=1).sum()


@pytest.mark.cell("`[costs]` of times, and timetables", "springs")
def test_the_order_is_the_shortest_in_time():
    """Of few poses no order is shorter; slow joints count for more than angles."""
    rng = np.random.default_rng(2)
    plan = plan_of(rng.uniform(-100, 100, (6, 2)))
    day = day_of(arm(costs=TIMES), plan)
    best = min(driving(plan, order) for order in permutations(range(6)))
    assert driving(plan, day.order) == pytest.approx(best, abs=1e-3)
    assert edtk.template(arm(costs=TIMES), plan)["q1_deg"].to_numpy() == pytest.approx(
        np.rad2deg(plan.q[day.order, 0]), abs=1e-3
    )


@pytest.mark.cell("`[costs]` of times, and timetables", "parameters")
@pytest.mark.parametrize("study", [STUDY, arm()], ids=["geometry", "springs"])
def test_the_clock_adds_up(study):
    """Each step begins where the one before ends, and all stays are as the study says."""
    times = TIMES | {"warm_up_s": 600, "load_change_s": 120}
    study = study.replace(costs=times, load={"list_F_N": [[0, 0, -100], [0, 0, -50]]})
    wrench = np.outer([1, 0.5, 1, 0.5], FORCE)
    plan = plan_of([[0, 0], [30, 40], [60, -20], [-50, 10]], [2, 1, 1, 1], wrench)
    day = day_of(study, plan)
    assert day.steps[0].what == "warm-up"
    for before, step in pairwise(day.steps):
        assert step.start == before.end
    stays = {"warm-up": 600, "visit": 5, "load change": 120}
    for step in day.steps:
        assert step.end - step.start - step.driving == pytest.approx(stays[step.what])
    paired = study.kind.is_paired(study)
    visits = [step for step in day.steps if step.what == "visit"]
    assert len(visits) == 5 * (1 + paired)
    changes = sum(step.what == "load change" for step in day.steps)
    assert changes == DayCosts(paired=paired).changes_of(plan.wrench)
    assert (visit_order(study, plan) == day.order).all()
    for step in visits:
        assert day.order[step.visit - 1] == step.row
        assert (step.load == plan.wrench[step.row]).all() or (paired and not step.load.any())
    loads = [step.load[2] for step in visits]
    assert sum(a != b for a, b in pairwise(loads)) == changes
    assert day.to_dict()["seconds"] == day.steps[-1].end


def test_repetitions_are_spread_where_that_is_cheap():
    """There and back: the mean time of all poses is the same, so that an even drift is, too."""
    plan = plan_of([[0, 0], [10, 5], [20, -5], [30, 0]], [2, 2, 2, 2])
    wrench = np.zeros_like(plan.wrench)
    plan = Plan(plan.q, wrench, plan.repeats)
    together = day_of(STUDY.replace(costs=TIMES), plan)
    assert (np.diff(together.order)[::2] == 0).all()
    spread = day_of(STUDY.replace(costs=TIMES | {"spread_percent": 50}), plan)
    assert (spread.order == spread.order[::-1]).all()
    middle = {row: [] for row in range(4)}
    for step in spread.steps:
        middle[step.row].append(step.end - 2.5)
    means = [np.mean(times) for times in middle.values()]
    assert means == pytest.approx([means[0]] * 4)
    assert together.seconds < spread.seconds <= 1.5 * together.seconds


def test_more_load_changes_share_out_the_visits():
    """Where drift asks for more changes, each load is on several times."""
    costs = TIMES | {"load_changes": 3}
    wrench = np.outer([1, 1, 0.5, 0.5], FORCE)
    plan = plan_of([[0, 0], [30, 40], [60, -20], [-50, 10]], [2, 2, 2, 2], wrench)
    day = day_of(STUDY.replace(costs=costs, load={"list_F_N": [[0, 0, -100], [0, 0, -50]]}), plan)
    loads = [step.load[2] for step in day.steps if step.what == "visit"]
    assert sum(a != b for a, b in pairwise(loads)) == 3
    assert sorted(day.order.tolist()) == sorted([0, 1, 2, 3] * 2)


def test_ways_lead_around_what_stands():
    """Poses on both sides of a post are visited from home and back over free legs."""
    study = arm(costs=TIMES, scene=SCENE)
    plan = plan_of([[20, 0], [-20, 0], [30, 20], [-30, -20]])
    day = day_of(study, plan)
    assert not day.blocked
    assert day.in_a_cell
    assert any(step.via for step in day.steps)
    at = study.home
    for step in day.steps:
        if step.way is None:
            assert step.q == pytest.approx(at)
        else:
            assert step.way.q[0] == pytest.approx(at)
            assert step.way.q[-1] == pytest.approx(step.q)
            t = np.linspace(0, 1, 200)[:, None, None]
            along = step.way.q[:-1] + t * np.diff(step.way.q, axis=0)
            least = study.cell.clearance(along).least.min()
            assert least >= -TOLERANCE
            told = step.nearest.clearance
            assert least >= told - max(1e-3, 0.1 * told)
        at = step.q
    assert day.steps[-1].what == "home"
    changes = [step for step in day.steps if step.what == "load change"]
    assert all(step.q == pytest.approx(study.home) for step in changes)


def test_what_cannot_be_reached_is_named(tmp_path, monkeypatch):
    """Sheet and timetable say which row touches, and that no way leads there."""
    monkeypatch.chdir(tmp_path)
    study = arm(scene=SCENE)
    study.to_toml("study.toml")
    plan_of([[30, 0], [0, 0], [-30, 0]]).to_csv("plan.csv", study.robot)
    words = ["template", "study.toml", "plan.csv", "--out", "sheet.csv", "--timetable", "t.csv"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0
    assert "no way leads to where something touches: row 2 of the plan" in result.stderr
    assert "none found" in result.stdout
    table = pd.read_csv("t.csv")
    assert table["free"].tolist().count(False) >= 2
    assert set(table["plan_row"].dropna()) == {1, 2, 3}
    assert CliRunner().invoke(main, [*words[:-1], "t.json"]).exit_code == 0
    assert json.loads(Path("t.json").read_text())["free"] is False


@pytest.mark.cell("ways in `check`")
@pytest.mark.parametrize("study", [STUDY, arm()], ids=["geometry", "springs"])
def test_check_tells_of_ways(study, tmp_path, monkeypatch):
    """Free ways have their via poses; the exit code is 1 where a pose cannot be reached."""
    monkeypatch.chdir(tmp_path)
    bars = [
        {"name": f"bar {side}", "size_mm": [600, 900, 100], "position_mm": [600, 0, 1000 + side]}
        for side in (-200, 200)
    ]
    for boxes, free in ([POST], True), (bars, False):
        scene = {key: value for key, value in SCENE.items() if key != "home_deg"}
        study.replace(scene=scene | {"box": boxes}).to_toml("study.toml")
        q_deg = [[20, 0], [-20, 0]] if free else [[0, 0], [-90, 0]]
        plan_of(q_deg, wrench=np.zeros((2, 6))).to_csv("plan.csv", study.robot)
        result = CliRunner().invoke(main, ["check", "study.toml", "plan.csv", "--json"])
        assert result.exit_code == (0 if free else 1)
        found = json.loads(result.stdout)
        assert found["free"] is free
        assert all(pose["clearance_mm"] > 0 for pose in found["poses"])
        (leg,) = found["legs"]
        assert (leg["from"], leg["to"]) == (1, 2)
        assert leg["free"] is free
        assert leg["direct"] == "touches"
        assert bool(leg["via_deg"]) is free
        assert set(leg["pair"]) & {"post", "bar -200", "bar 200"}
        text = CliRunner().invoke(main, ["check", "study.toml", "plan.csv"]).stdout
        assert ("free by" if free else "no free way found") in text


@pytest.mark.parametrize("study", [STUDY, arm()], ids=["geometry", "springs"])
def test_programs_drive_by_via_poses(study):
    """All legs of a program are free, from home and back, as the controller takes the poses."""
    study = study.replace(scene=SCENE)
    wrench = np.outer([1, 0, 1, 0], FORCE)
    plan = plan_of([[20, 0], [-20, 0], [30, 20], [-30, -20]], wrench=wrench)
    moves = edtk.program(study, plan, "csv").program.moves
    assert [moves[0].purpose, moves[-1].purpose] == ["home", "home"]
    assert any(move.purpose == "via" for move in moves)
    q = np.deg2rad([move.target for move in moves])
    assert prove_legs(study.cell, q[:-1], q[1:]).free.all()
    other = edtk.program(study, plan, "csv", home=[-80, 10]).program.moves
    assert other[0].target == (-80.0, 10.0)
    assert other[1].purpose == other[-2].purpose == "pose"  # no way there is known


def test_plans_tell_how_long_the_day_is():
    """In words and in JSON; a study that says nothing of time has no such key."""
    found = edtk.plan(arm(costs=TIMES), 3)
    assert "the day takes " in found.summary()
    assert "costs" not in found.summary()
    assert found.to_dict()["timetable"]["seconds"] == found.timetable.seconds
    assert "timetable" not in edtk.plan(arm(), 3).to_dict()


@pytest.mark.parametrize(
    ("costs", "message"),
    [
        ({"speed_deg_per_s": {"q9": 10}}, "no revolute joint 'q9'; this robot has q1, q2"),
        ({"speed_mm_per_s": {"q1": 10}}, "no prismatic joint 'q1'; this robot has none"),
        ({"speed_deg_per_s": 0}, "speed_deg_per_s"),
        ({"dwell_s": -1}, "dwell_s"),
    ],
)
def test_wrong_times_are_one_line(costs, message):
    """They name the key."""
    with pytest.raises(edtk.UserError, match=message) as caught:
        arm(costs=costs)
    assert "\n" not in str(caught.value)


def test_a_study_without_times_has_no_timetable(tmp_path, monkeypatch):
    """What is missing is said, before a sheet is written."""
    monkeypatch.chdir(tmp_path)
    plan = plan_of([[0, 0], [30, 0]])
    with pytest.raises(edtk.UserError, match=r"in the study, or times in \[costs\]"):
        edtk.timetable(arm(), plan)
    arm().to_toml("study.toml")
    plan.to_csv("plan.csv", arm().robot)
    words = ["template", "study.toml", "plan.csv", "--out", "sheet.csv", "--timetable", "t.csv"]
    assert CliRunner().invoke(main, words).exit_code == 2
    assert not Path("sheet.csv").exists()


@pytest.mark.parametrize("asked", [(), ("--program", "krl")], ids=["sheet", "program"])
def test_no_day_is_planned_for_files_that_cannot_be_written(asked, tmp_path, monkeypatch):
    """An output that is an input is refused before the long work."""
    monkeypatch.chdir(tmp_path)
    study = arm(scene=SCENE)
    study.to_toml("study.toml")
    plan_of([[30, 0], [-30, 0]]).to_csv("plan.src", study.robot)
    monkeypatch.setattr("edtk.verbs.template.timetable", None)
    words = ["template", "study.toml", "plan.src", "--out", "plan.src", *asked]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2
    assert "is read by this command" in result.stderr
