"""A study with a controller's table: people read its angles, the model computes with its own."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm import KEYS, ROBOT
from click.testing import CliRunner

from edtk.cli import main
from edtk.design.plan import Plan
from edtk.robots.robot_file import robot_from_dict, robot_to_dict
from edtk.study.study import Study, load_study
from edtk.system.errors import UserError
from edtk.verbs.identify import compensate, identify
from edtk.verbs.plan import plan
from edtk.verbs.template import template
from edtk.verbs.verify import verify

COUPLED: dict[str, Any] = {
    "sign": {"q1": -1},
    "zero_deg": {"q1": 12.345, "q2": -90},
    "follows": {"q2": "q1"},
}
TASK: dict[str, Any] = {
    "tool": {"position_mm": [400, 0, 0]},
    "load": {"F_N": [0, 0, -50]},
}
TRUE = np.array([3e-6, 5e-6])


def shown_deg(q_deg: list[float]) -> list[float]:
    """What the controller of COUPLED shows for joint angles of the model [deg]."""
    first = 12.345 - q_deg[0]
    return [first, -90 + q_deg[1] - (first - 12.345)]


def study(folder: Path | None = None, **keys: Any) -> Study:
    """The arm with a task, and perhaps a controller."""
    given = KEYS | {"test_pose": TASK | {"q_deg": [9, 40]}} | keys
    return Study(**given, folder=folder)


def coupled(folder: Path | None = None, **keys: Any) -> Study:
    """The same arm, whose controller counts otherwise."""
    task = {"test_pose": TASK | {"q_deg": shown_deg([9, 40])}}
    return study(folder, **({"controller": COUPLED} | task | keys))


def filled(question: Study, measured: Plan, path: Path) -> Path:
    """The sheet of a plan with what the linear model would measure."""
    table = template(question, measured)
    poses = Plan.from_frame(table.iloc[:, :8], question.robot)
    moved = question.model.regressor(poses.q, poses.wrench) @ TRUE
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved
    table.to_csv(path, index=False)
    return path


def test_the_table_is_that_of_the_robots_file_or_of_the_study() -> None:
    """A study's table takes the place of the robot's, and survives TOML."""
    in_file = coupled(robot=ROBOT | {"controller": COUPLED}, controller=None)
    question = coupled(robot=ROBOT | {"controller": {"sign": {"q2": -1}}})
    for one in (in_file, question, Study(**KEYS, controller=COUPLED)):
        assert one.robot.controller is not None
        assert one.robot.controller.zero.tolist() == [12.345, -90]
    none = study(robot=ROBOT | {"controller": COUPLED}, controller={})
    assert none.robot.controller is None


def test_the_task_is_the_same(tmp_path: Path) -> None:
    """Test poses and fixed joints are the controller's; inside they are the model's."""
    question = coupled()
    assert np.rad2deg(question.task.q) == pytest.approx([9, 40])  # type: ignore[union-attr]
    assert question.target == pytest.approx(study().target, rel=1e-12)
    keys = {"joints": {"unknown": ["q2"], "fixed_deg": {"q1": 2.345}}}
    assert coupled(**keys).fixed == pytest.approx({0: np.deg2rad(10)})
    question.to_toml(tmp_path / "study.toml")
    assert load_study(tmp_path / "study.toml").task.q == pytest.approx(  # type: ignore[union-attr]
        question.task.q,
        abs=0,  # type: ignore[union-attr]
    )


def test_a_follower_is_fixed_with_its_leader_only() -> None:
    """A fixed number of the controller keeps no joint whose leader moves."""
    keys = {"unknown": ["q2"], "fixed_deg": {"q2": -50}}
    with pytest.raises(UserError, match=r"^Study: joints.fixed_deg.q2: the joint follows q1, whic"):
        coupled(joints=keys)
    both = coupled(joints={"unknown": ["q2"], "fixed_deg": {"q1": 2.345, "q2": -50}})
    assert both.fixed == pytest.approx({0: np.deg2rad(10), 1: np.deg2rad(40 - 10)})


@pytest.mark.slow
def test_a_plan_is_rounded_at_the_controller_and_read_back(tmp_path: Path) -> None:
    """Printed poses have three decimals of the controller, and are those that were computed."""
    question = coupled()
    found = plan(question, size=3, criterion="D", seed=1, workers=1)
    found.plan.to_csv(tmp_path / "plan.csv", question.robot)
    again = question.load_plan(tmp_path / "plan.csv")
    assert (again.q == found.plan.q).all()
    shown = found.to_frame()[["q1_deg", "q2_deg"]].to_numpy()
    assert (shown == shown.round(3)).all()
    rows = found.to_dict()["plan"]
    assert [row["q_deg"] for row in rows] == shown.tolist()
    assert found.to_dict()["exact"]["plan"]["q"] == found.plan.q.tolist()  # the model's, in SI
    assert (np.diff(np.rad2deg(question.robot.limits), axis=0) > 0).all()
    assert question.space.at(np.hstack([found.plan.q])).feasible.all()


def test_the_same_compliances_with_and_without(tmp_path: Path) -> None:
    """Plan, sheet, measurements and fit give the compliances of the model's own angles."""
    q = np.deg2rad([[10.0, 40], [-60, 30], [80, -70], [20, 90]])
    poses = Plan(q, np.tile([0, 0, -100.0, 0, 0, 0], (4, 1)), np.ones(4, dtype=int))
    found = {}
    for name, question in (("own", study()), ("coupled", coupled())):
        sheet = filled(question, poses, tmp_path / f"{name}.csv")
        found[name] = identify(question, sheet, linear=True)
    assert found["coupled"].k == pytest.approx(found["own"].k, rel=1e-9)
    assert list(found["coupled"].k.values()) == pytest.approx(TRUE, rel=1e-9)


def test_commands_are_the_controllers(tmp_path: Path) -> None:
    """A task in the controller's angles is compensated in them; JSON has both."""
    (tmp_path / "k.json").write_text(json.dumps({"k": {"q1": 3e-6, "q2": 5e-6}}))
    commands = {}
    for name, question, q in (
        ("own", study(), [9, 40]),
        ("coupled", coupled(), shown_deg([9, 40])),
    ):
        (tmp_path / "task.csv").write_text(f"q1_deg,q2_deg\n{q[0]},{q[1]}\n")
        commands[name] = compensate(question, tmp_path / "k.json", tmp_path / "task.csv")
    shown = commands["coupled"].to_frame()[["q1_deg", "q2_deg"]].to_numpy()[0]
    own = commands["own"].to_frame()[["q1_deg", "q2_deg"]].to_numpy()[0]
    assert shown == pytest.approx(shown_deg(own.tolist()))
    answer = commands["coupled"].to_dict()[0]
    assert answer["q_deg"] == pytest.approx(shown)
    assert answer["q"] == pytest.approx(np.deg2rad(own))
    assert f"{shown[0]:.5f}" in commands["coupled"].summary()


def test_limits_in_messages_are_the_controllers(tmp_path: Path) -> None:
    """A pose beyond a limit is named by the number that the operator reads."""
    question = coupled()
    (tmp_path / "task.csv").write_text("q1_deg,q2_deg\n170,-90\n")
    (tmp_path / "k.json").write_text(json.dumps({"k": {"q1": 3e-6, "q2": 5e-6}}))
    with pytest.raises(UserError, match=r"desired value 170 is outside .* limits -137\.655"):
        compensate(question, tmp_path / "k.json", tmp_path / "task.csv")
    (tmp_path / "task.csv").write_text("q1_deg,q2_deg\n100,-80\n")
    near = TASK | {"q_deg": shown_deg([9, 10])}
    narrow = question.replace(robot=shorter(), test_pose=near)
    with pytest.raises(UserError, match=r"value 20 of q2 \+ q1 is outside .* -197.655 .. -57.655"):
        compensate(narrow, tmp_path / "k.json", tmp_path / "task.csv")


def shorter() -> dict[str, Any]:
    """The arm with a narrow elbow."""
    content = robot_to_dict(robot_from_dict(ROBOT))
    content["joints"][1]["limits_deg"] = [-120, 20]
    return content


def test_the_table_of_a_wrong_joint_is_refused_by_the_command(tmp_path: Path) -> None:
    """One line on standard error, and exit code 2."""
    path = tmp_path / "study.toml"
    study().to_toml(path)
    path.write_text(path.read_text() + "\n[controller]\nsign = { q7 = -1 }\n")
    result = CliRunner().invoke(main, ["plan", str(path), "--size", "2"])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "controller.sign: no joint 'q7'; this robot has q1, q2" in result.stderr


def test_the_study_says_how_the_controller_counts() -> None:
    """A line of the summary; without a table there is none."""
    text = coupled().summary()
    assert "counts q1 the other way round; shows q1 = 12.345 deg, q2 = -90 deg at the" in text
    assert "q2 follows q1" in text
    assert "controller" not in study().summary()


@pytest.mark.slow
def test_a_certificate_of_a_study_with_a_controller_holds(tmp_path: Path) -> None:
    """It speaks of the model's joints, and every claim is recomputed from them."""
    path = tmp_path / "proof.json"
    plan(coupled(), size=3, criterion="D", seed=1, workers=1, certificate=path)
    assert verify(path).valid


def test_a_path_is_in_the_controllers_angles(tmp_path: Path) -> None:
    """Poses of a task's file are read as those of a plan."""
    header = "q1_deg,q2_deg,Fx_N,Fy_N,Fz_N\n"
    for name, poses in (
        ("own", [[9.0, 40.0], [20.0, 60.0]]),
        ("coupled", [shown_deg([9, 40]), shown_deg([20, 60])]),
    ):
        rows = "".join(f"{first},{second},0,0,-50\n" for first, second in poses)
        (tmp_path / f"{name}.csv").write_text(header + rows)
    task = {"tool": {"position_mm": [400, 0, 0]}}
    own = Study(**KEYS, folder=tmp_path, task=task | {"file": "own.csv"})
    keys = KEYS | {"controller": COUPLED, "task": task | {"file": "coupled.csv"}}
    assert Study(**keys, folder=tmp_path).target == pytest.approx(own.target, rel=1e-12)
