"""Several test poses, and paths: read, checked, and as good as one where they are one."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.measure.expected_error import compensation_accuracy
from edtk.study.evaluate import accuracy_of_tasks
from edtk.study.run_study import random_case
from edtk.study.study import Study, load_study
from edtk.system.errors import Note, UserError
from edtk.verbs.evaluate import evaluate

OTHER = TEST_POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [300, -200, 100]}}
ALONE = Study(**REQUIRED, test_pose=TEST_POSE)
BOTH = Study(**REQUIRED, test_pose=[TEST_POSE, OTHER | {"weight": 3}])
COV = 1e-16 * np.diag([1.0, 4.0, 2.0, 3.0, 1.0])
PATH = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Fx_N,Fy_N,Fz_N\n"


def path_study(folder: Path, rows: str, **keys: Any) -> Study:
    """The robot along a path of some rows."""
    (folder / "path.csv").write_text(PATH + rows, encoding="utf-8")
    task = {"file": "path.csv", "tool": TEST_POSE["tool"]} | keys
    return Study(**REQUIRED, task=task, folder=folder)


@pytest.mark.cell("`[task]`, a path from a file", "springs")
def test_a_list_of_one_is_that_one() -> None:
    """The target of a single pose in a list is its A0 to the last bit, and so is that of a path."""
    listed = Study(**REQUIRED, test_pose=[TEST_POSE])
    assert ALONE.target is not None
    np.testing.assert_array_equal(listed.target, ALONE.target)
    np.testing.assert_array_equal(ALONE.target, ALONE.tasks[0].regressor)
    assert ALONE.criterion("rho_max").cost(np.linalg.inv(COV)) == pytest.approx(
        float(ALONE.criterion("rho0").cost(np.linalg.inv(COV))), rel=1e-14
    )


@pytest.mark.cell("several `[[test_pose]]`, and `rho_max`", "springs")
def test_rho0_is_the_weighted_root_mean_square_and_rho_max_the_worst() -> None:
    """Both come from the errors in the poses, and the target has at most p rows."""
    M = np.linalg.inv(COV)
    errors = np.array([compensation_accuracy(task.regressor, COV) for task in BOTH.tasks])
    mean = np.sqrt((errors[0] ** 2 + 3 * errors[1] ** 2) / 4)
    assert BOTH.criterion("rho0").value(M) == pytest.approx(mean, rel=1e-12)
    assert BOTH.criterion("rho_max").value(M) == pytest.approx(errors.max(), rel=1e-12)
    assert len(BOTH.tasks.target) == 5


def test_a_pose_without_weight_is_only_reported() -> None:
    """It changes neither criterion, and has its line among the accuracies."""
    study = Study(**REQUIRED, test_pose=[TEST_POSE, OTHER | {"weight": 0}])
    M = np.linalg.inv(COV)
    for name in ("rho0", "rho_max"):
        found = study.criterion(name).value(M)
        assert found == pytest.approx(float(ALONE.criterion(name).value(M)), rel=1e-12)
    accuracy = accuracy_of_tasks(study, COV)
    assert accuracy is not None
    assert len(accuracy.error) == 2
    assert accuracy.worst == 0


def test_studies_survive_toml(tmp_path: Path) -> None:
    """Lists of poses and paths come back, with names of files for the new folder."""
    (tmp_path / "here").mkdir()
    path = path_study(tmp_path / "here", "0,-60,90,0,45,0,1,2,3\n0,-61,90,0,45,0,1,2,3\n")
    for study in (BOTH, path, ALONE):
        study.to_toml(tmp_path / "study.toml")
        again = load_study(tmp_path / "study.toml")
        np.testing.assert_array_equal(again.target, study.target)
        assert len(again.tasks) == len(study.tasks)
    assert path.folder / "path.csv" in path.reads
    assert "[test_pose]" in ALONE.to_toml()
    assert "[[test_pose]]" in BOTH.to_toml()


def test_a_path_has_loads_of_its_own(tmp_path: Path) -> None:
    """Columns of the file take the place of the table's load, component by component."""
    (tmp_path / "path.csv").write_text(
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Fz_N\n"
        + "0," * 6
        + "7\n"
        + "0,-60,90,0,45,0,8\n"
    )
    load = {"F_N": [1, 2, 3]}
    task = {"file": "path.csv", "tool": TEST_POSE["tool"], "load": load, "lever_mm": 100}
    study = Study(**REQUIRED, task=task, folder=tmp_path)
    assert [task.wrench[:3].tolist() for task in study.tasks] == [[1, 2, 7], [1, 2, 8]]
    assert study.tasks.targets.shape == (2, 6, 5)
    assert study.main_criterion == "rho0"


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "negative weight": (
        {"test_pose": [TEST_POSE, OTHER | {"weight": -1}]},
        r"test_pose.1.weight: expected at least 0 \(got -1",
    ),
    "no weight at all": (
        {"test_pose": [TEST_POSE | {"weight": 0}, OTHER | {"weight": 0}]},
        "test_pose.0.weight: the weights of all test poses are 0",
    ),
    "a single one without weight": (
        {"test_pose": TEST_POSE | {"weight": 0}},
        "test_pose.weight: the weights",
    ),
    "out of reach": (
        {"test_pose": [TEST_POSE, OTHER | {"q_deg": [0, 30, 89, 45, 126, 57]}]},
        "test_pose.1.q_deg: the robot cannot take this pose: joint q2 is at 30, beyond its limits "
        "-146 .. 0, and 1 more",
    ),
    "a pose of another robot": (
        {"test_pose": [TEST_POSE, OTHER | {"q_deg": [0, 30]}]},
        "test_pose.1.q_deg: has 2 entries, expected 6",
    ),
    "a key that is not there": (
        {"test_pose": [TEST_POSE, OTHER | {"wieght": 1}]},
        "test_pose.1.wieght: unknown key",
    ),
    "no pose": ({"test_pose": []}, "test_pose: "),
    "both": (
        {"test_pose": TEST_POSE, "task": {"file": "a.csv", "tool": TEST_POSE["tool"]}},
        "task: expected one of .test_pose. and .task., the study has both",
    ),
    "no file": ({"task": {"file": "none.csv", "tool": TEST_POSE["tool"]}}, "none.csv"),
}


@pytest.mark.parametrize(("keys", "expected"), WRONG.values(), ids=WRONG)
def test_wrong_tasks_earn_one_line(keys: dict[str, Any], expected: str) -> None:
    """Each names the key, the pose from 0, and what was expected."""
    with pytest.raises(UserError, match=expected) as caught:
        Study(**REQUIRED, **keys)
    assert "\n" not in str(caught.value)


def test_a_path_that_the_robot_cannot_follow_names_the_row(tmp_path: Path) -> None:
    """So do paths without a load."""
    with pytest.raises(UserError, match=r"path.csv: row 2: .* joint q2 is at 30, beyond"):
        path_study(tmp_path, "0,-60,90,0,45,0,1,2,3\n0,30,90,0,45,0,1,2,3\n")
    with pytest.raises(UserError, match="the load turns no joint"):
        path_study(tmp_path, "0,-60,90,0,45,0,0,0,0\n")


@pytest.mark.slow
def test_a_long_path_is_thinned(tmp_path: Path) -> None:
    """Of very many poses 1000 count, evenly spread, and a note says so; all must be possible."""
    angles = np.linspace(0.0, 90.0, 4001)
    text = "".join(f"{angle:.4f},-60,90,0,45,0,1,2,3\n" for angle in angles)
    with pytest.warns(Note, match=r"path.csv: 1000 of 4001 poses count, evenly spread"):
        study = path_study(tmp_path, text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Note)
        q1 = np.array([task.q[0] for task in study.tasks])
    assert len(q1) == 1000
    assert q1[[0, -1]] == pytest.approx([0.0, np.pi / 2])
    rows = q1 / (np.pi / 2) * 4000
    assert set(np.diff(rows).round().tolist()) == {4, 5}
    beyond = text.replace("\n0.0225,-60", "\n0.0225,30")
    with pytest.raises(UserError, match=r"path.csv: row 2: .* joint q2 is at 30, beyond"):
        path_study(tmp_path, beyond)


def test_an_evaluation_tells_each_pose() -> None:
    """JSON has the weighted mean, the worst, and the error of each pose with its band."""
    plan = random_case(ALONE, 6, 0).plan
    assert plan is not None
    found = json.loads(json.dumps(evaluate(BOTH, plan).to_dict()))
    expected = found["expected_error"]
    errors = [one["error"] for one in found["tasks"]]
    assert expected["test_pose"] == pytest.approx(found["criteria"]["rho0"], rel=1e-12)
    assert expected["worst"] == pytest.approx(found["criteria"]["rho_max"], rel=1e-12)
    assert errors[expected["worst_pose"] - 1] == pytest.approx(max(errors), rel=1e-12)
    for one in found["tasks"]:
        low, high = one["error_band95"]
        assert low < one["error"] < high
    alone = json.loads(json.dumps(evaluate(ALONE, plan).to_dict()))
    assert "tasks" not in alone
    assert "poses" not in alone["expected_error"]


def test_a_tool_that_many_poses_share_is_doubted_once() -> None:
    """So are angles that look like radians: one line is enough to look at all of them."""
    tool = {"position_mm": [0.986, 0, 0]}
    study = Study(**REQUIRED, test_pose=[TEST_POSE | {"tool": tool}, OTHER | {"tool": tool}])
    assert sum("test_pose.0.tool" in line.words for line in study.warnings) == 1
    assert not any("test_pose.1" in line.words for line in study.warnings)
