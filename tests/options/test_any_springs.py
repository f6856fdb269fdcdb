"""Springs across joints, their matrices and their laws, from the study to commands and back."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from arm import ROBOT
from numpy.typing import NDArray

import edtk
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.fit.geometry_posterior import many_seen
from edtk.measure.equilibrium import loading_in, no_rest, resting_load
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, planned_noise
from edtk.system.errors import UserError

Array = NDArray[np.float64]
LATERAL = ["joints", "q1.rx", "q2.rz"]
KINDS: dict[str, list[str]] = {
    "lateral": LATERAL,
    "couplings": ["q1", "q2.rx", "q2.x", "q2.rx.z", "q2.x.ry"],
    "laws": ["joints", "q1.square", "q2.cubic", "q1.rx", "q1.rx.sign"],
}
READ: dict[str, dict[str, Any]] = {
    "positions": {},
    "changes": {"measurement": {"sigma_mm": 0.01, "reference": "unloaded"}},
    # On a link and along a wire, with joints that do not come back: errors move with the pose.
    "links": {
        "noise": {"repeatability_deg": [0.01, 0.02]},
        "marker": [
            {"name": "A", "position_mm": [0, 30, 10], "rows": "pose"},
            {"name": "link", "joint": "q1", "position_mm": [300, 60, 40]},
        ],
        "measurement": {"sigma_mm": 0.01, "sigma_deg": 0.01},
        "distance": [{"name": "wire", "joint": "q2", "anchor_mm": [1500, 900, 200]}],
    },
}
SIZES = {"": 4e-6, "square": 2e-9, "cubic": 3e-11, "sign": 1e-6, "gap": 1e-4}


def study_of(springs: list[str] | str = LATERAL, **keys: Any) -> Study:
    """A plane arm with a load beside its tool, whose links are heavy."""
    heavy = [{**one, "mass_kg": 7, "center_m": [0.2, 0.05, 0.1]} for one in ROBOT["joints"]]
    given: dict[str, Any] = {
        "robot": ROBOT | {"joints": heavy},
        "tool": {"position_mm": [500, 0, 0]},
        "load": {"list_F_N": [[0, 0, -100], [60, 80, -60]], "at_mm": [30, 200, 0]},
        "payload": {"mass_kg": 3, "center_mm": [20, 0, 40]},
        "marker": [
            {"name": "A", "position_mm": [0, 30, 10]},
            {"name": "B", "position_mm": [-60, 0, 150]},
            {"name": "C", "position_mm": [40, -150, 50]},
        ],
        "measurement": {"sigma_mm": 0.01},
        "parameters": {"geometry": [], "springs": springs, "base": False, "tool": False},
        "test_pose": {
            "q_deg": [10, -60],
            "tool": {"position_mm": [500, 100, 0]},
            "load": {"F_N": [0, 0, -80]},
        },
        "candidates": 100,
    }
    return Study(**(given | keys))


def truth_of(setting: StudyGeometry) -> Array:
    """Sizes of the springs, couplings small."""
    names = setting.model.parameters
    return np.array([SIZES[one.law] * (0.1 if len(one.ends) > 1 else 1.0) for one in names])


def measured(study: Study, visits: int = 20) -> pd.DataFrame:
    """A sheet of exact positions of the bent robot, under the study's loads in turn."""
    setting = StudyGeometry.of(study)
    rng = np.random.default_rng(3)
    q = rng.uniform(-1.5, 1.5, (visits, study.robot.n))
    wrench = GeometryQuestion.of(study).wrenches[np.arange(visits) % 3]
    theta = truth_of(setting)
    rest = loading_in(
        setting.model.bending(theta), q, wrench, setting.loads, np.zeros(visits, dtype=bool)
    )
    x = 1e3 * setting.model.see(theta, q, rest, derivatives=False).points
    table = pd.DataFrame(np.rad2deg(q), columns=["q1_deg", "q2_deg"])
    table[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]] = wrench
    for i, marker in enumerate("ABC"):
        table[[f"{marker}{axis}_mm" for axis in "xyz"]] = x[:, i]
    return table


@cache
def found_lateral() -> Any:
    """The calibration of the arm with springs across its joints, in whose task nothing is open."""
    exact = {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0}
    study = study_of(uncertainty=exact)
    return edtk.identify(study, measured(study))


@pytest.mark.cell("springs across joints and along them", "parameters")
@pytest.mark.cell("the 6 x 6 matrix of a joint", "parameters")
@pytest.mark.cell("springs that are not linear", "parameters")
@pytest.mark.parametrize("springs", [LATERAL, ["q1", "q2.all"], KINDS["laws"]])
def test_sheet_of_the_bent_robot_gives_its_springs(springs: list[str]) -> None:
    """Exact readings at the loaded equilibrium give back all springs."""
    study = study_of(springs)
    setting = StudyGeometry.of(study)
    found = edtk.identify(study, measured(study, 40))
    told = dict(zip(found.parameters, found.fit.fitted.theta, strict=True))
    every = {
        one.name: size
        for one, size in zip(setting.model.parameters, truth_of(setting), strict=True)
    }
    assert found.fit.rms < 1e-9
    assert set(told) == set(every)
    for name, size in told.items():
        assert size == pytest.approx(every[name], rel=1e-4)


@pytest.mark.parametrize("read", READ)
@pytest.mark.parametrize("kind", KINDS)
def test_slopes_of_rows_are_those_of_differences(kind: str, read: str) -> None:
    """Rows of visits, read as they are or as changes, move with the joints as their slopes say."""
    rng = np.random.default_rng(1)
    setting = StudyGeometry.of(study_of(KINDS[kind], **READ[read]))
    rows = PositionRows(setting.model, setting.loads, planned_noise(setting))
    q = rng.uniform(-1, 1, (3, 2))
    wrench = rng.normal(0, 50, (3, 6)) * [[1], [0], [1]]
    G = rng.normal(size=(2, setting.model.p, setting.model.p)).sum(axis=0)
    B = rows(q, wrench) @ (G + G.T)
    change = rng.normal(0, 50, (3, 6, 1)) * [[[1]], [[0]], [[1]]]
    slope = rows.slopes(q, wrench, B, change)
    h = 1e-5

    def along(dq: Array, dw: float) -> Array:
        up = rows(q + dq, wrench + dw * change[..., 0])
        down = rows(q - dq, wrench - dw * change[..., 0])
        return (B * (up - down)).sum(axis=(1, 2)) / (2 * h)

    by_joints = [along(h * one, 0.0) for one in np.eye(2)]
    expected = np.stack([*by_joints, along(np.zeros(2), h)], axis=1)
    size = np.abs(expected).max()
    np.testing.assert_allclose(slope / size, expected / size, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("kind", "read"), [("lateral", "links"), ("couplings", "positions"), ("laws", "changes")]
)
def test_certificate_is_verified_another_way(kind: str, read: str, tmp_path: Path) -> None:
    """The second implementation finds the rows of all springs, and finds out other ones."""
    study = study_of(KINDS[kind], **READ[read])
    path = tmp_path / "c.json"
    edtk.relax(study, "D", certificate=path, continuous=False)
    assert edtk.verify(path, study).valid
    content = json.loads(path.read_text())
    springs = content["setting"]["geometry"]["parameters"]
    changed = next(one for one in springs if one["place"] == "spring")
    changed["ends"] = [4 if changed["ends"] == [1] else 1]
    assert not edtk.verify(content).valid


def test_commands_and_predictions_are_of_the_whole_model(tmp_path: Path) -> None:
    """Read back from its file, a result predicts what it was fitted to, and says what remains.

    Joints cannot turn the tool sideways: what a command leaves is what the model says of it.
    """
    calibration = found_lateral()
    study = calibration.study
    sheet = measured(study)
    path = tmp_path / "result.json"
    path.write_text(json.dumps(calibration.to_dict()))
    again = edtk.predict(study, path, sheet)
    assert np.nanmax(np.abs(again.apart)) < 1e-8
    found = edtk.compensate(study, path)
    assert found.left is not None
    setting = StudyGeometry.of(study)
    fitted = calibration.fit.fitted
    task = setting.study.tasks[0]
    robot = fitted.at_tool(task.tool)
    loads = setting.loads_of(task)
    command = found.command
    torque = robot.torque(command, task.wrench[None], loads)
    there = robot.model.see(robot.theta, command, torque, derivatives=False).points[0, 0]
    goal = task.placed.forward(task.q)[:3, 3]
    assert np.linalg.norm(there - goal) == pytest.approx(found.left[0], rel=1e-6)
    # Along the plane of the arm nothing remains, across it all.
    assert abs((there - goal)[0]) < 1e-8
    assert abs((there - goal)[1]) > 0.9 * found.left[0] > 1e-5


def test_arm_that_would_snap_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads that take more stiffness than a spring has leave no rest: each row says so."""
    # Four steps are the rule: a command that is not at rest in six is not in thirty.
    monkeypatch.setattr("edtk.calibration.calibrated_geometry.STEPS", 6)
    study, content = found_lateral().study, found_lateral().to_dict()
    geometry = content["geometry"]
    geometry["values"][geometry["names"].index("k_q2")] = 3e4
    path = tmp_path / "soft.json"
    path.write_text(json.dumps(content))
    upright = pd.DataFrame({"q1_deg": [0.0], "q2_deg": [-90.0]})
    upright[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]] = [[0, 0, -300, 0, 0, 0]]
    with pytest.raises(UserError, match=r"row 1.*the load buckles the arm"):
        edtk.compensate(study, path, upright)
    with pytest.raises(UserError, match=r"row 1.*the load buckles the arm"):
        edtk.predict(study, path, upright)


def test_spring_that_no_load_turns_says_what_would_tell_it() -> None:
    """A load in the plane of the arm turns nothing across it."""
    study = study_of(
        springs=["joints", "q2.rx"],
        load={"list_F_N": [[0, 0, -100], [50, 0, 0]]},
        marker=[{"name": "A", "position_mm": [0, 0, 0]}],
        payload=None,
        robot=ROBOT,
    )
    question = GeometryQuestion.of(study)
    assert [one.name for one in question.model.parameters] == ["k_q1", "k_q2"]
    (words,) = question.untold
    assert words.startswith("the spring of joint q2 about x moves no marker")
    assert "it needs a torque about x before joint q2 that no load there makes" in words


def test_joint_within_its_dead_zone_is_no_arm_that_snaps() -> None:
    """Where the load changes its sign within the dead zone, the joint rests anywhere in it."""
    setting = StudyGeometry.of(study_of(["q1", "q2", "q2.gap"]))
    theta = np.array([4e-6, 4e-6, 5e-3])
    bending = setting.model.bending(theta)
    q = np.stack([np.zeros(2001), np.linspace(1.0, 2.0, 2001)], axis=1)
    wrench = np.tile([0.0, 0, -100, 0, 0, 0], (len(q), 1))
    torque = resting_load(bending, q, wrench, setting.loads).torque[:, 1]
    assert (np.sign(torque[1:]) != np.sign(torque[:-1])).any()
    assert not no_rest(bending, q, wrench, setting.loads).any()


def test_laws_of_springs_are_told_by_loads_of_two_sizes() -> None:
    """A load along a direction has half of its size in plans too, where a spring is not linear."""
    up_to = {"F_max_N": 100, "direction": [0, 0, -1]}
    plain, cubic = (
        GeometryQuestion.of(study_of(springs=springs, load=up_to, payload=None)).wrenches[:, 2]
        for springs in (["joints"], ["joints", "q2.cubic"])
    )
    assert sorted(plain) == [-100, 0]
    assert sorted(cubic) == [-100, -50, 0]


def test_chains_see_what_the_model_sees() -> None:
    """Many sets of springs at once, as posteriors need them, bend the arm as each alone does."""
    model = StudyGeometry.of(study_of(KINDS["laws"])).model
    rng = np.random.default_rng(0)
    theta = model.scales * rng.normal(0, 1, (3, model.p))
    q = rng.uniform(-1, 1, (4, 2))
    torque = rng.normal(0, 100, (4, model.springs.width))
    many = many_seen(model, theta, q, torque)
    each = [model.see(one, q, torque, derivatives=False).points for one in theta]
    np.testing.assert_allclose(many.points, each, rtol=0, atol=1e-13)


def test_prior_of_a_spring_counts() -> None:
    """What is known of a spring across a joint is under its own name, in fits and in designs."""
    known = {"kind": "normal", "mean_rad_per_Nm": 4e-6, "std_rad_per_Nm": 1e-9}
    table = {"joints": {"q1.rx": known}}
    study = study_of(prior=table)
    found = edtk.identify(study, measured(study))
    assert found.parameters["k_q1.rx"]["std"] <= 1e-3
    question = GeometryQuestion.of(study_of(prior=table | {"in_design": True}))
    names = [one.name for one in question.model.parameters]
    np.testing.assert_allclose(question.known, 1e3 * (np.array(names) == "k_q1.rx")[None])
    with pytest.raises(UserError, match=r"prior\.joints.*'q1\.ry' is no unknown joint"):
        edtk.identify(study_of(prior={"joints": {"q1.ry": known}}), measured(study))


def test_band_of_commands_is_that_of_errors_as_the_fit_has_them() -> None:
    """What a command leaves by the model, and errors of springs beside it: quantiles of draws."""
    study, fitted = found_lateral().study, found_lateral().fit.fitted
    found = edtk.compensate(study, found_lateral())
    setting = StudyGeometry.of(study)
    task = setting.study.tasks[0]
    robot = fitted.at_tool(task.tool)
    loads = setting.loads_of(task)
    wrench = task.wrench[None]
    torque = robot.torque(found.command, wrench, loads)
    there = robot.model.see(robot.theta, found.command, torque, derivatives=False).points[0, 0]
    off = there - task.placed.forward(task.q)[:3, 3]
    # A tool has rows of its orientation, too.
    rows = 1e-3 * robot.columns(found.command, wrench, loads)[0][:3]
    drawn = np.random.default_rng(0).multivariate_normal(np.zeros(len(off)), np.eye(3), 100_000)
    spread = np.linalg.cholesky(rows @ robot.covariance @ rows.T + 1e-24 * np.eye(3))
    lengths = np.linalg.norm(off + drawn @ spread.T, axis=1)
    assert found.band is not None
    np.testing.assert_allclose(found.band[0], np.quantile(lengths, [0.025, 0.975]), rtol=0.02)


def test_words_of_the_study_name_all_springs() -> None:
    """Joints that are known stay known, and a study that is written and read again is the same."""
    study = study_of("lateral")
    names = [one.name for one in StudyGeometry.of(study).model.parameters]
    assert names == ["k_q1", "k_q2", "k_q1.rx", "k_q1.rz", "k_q2.rx", "k_q2.rz"]
    again = Study(**study.to_dict())
    assert [one.name for one in StudyGeometry.of(again).model.parameters] == names
    known = study_of("lateral", joints={"known_rad_per_Nm": {"q1": {"value": 3e-6, "std": 0}}})
    assert known.specification.joints.unknown == ("q2",)
    assert "4 other springs" in study.headline()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"springs": ["q2", "q2.ry"]}, r"parameters\.springs: 'q2\.ry' is listed twice"),
        ({"springs": ["q3.rx"]}, r"parameters\.springs: no spring 'q3\.rx'"),
        ({"springs": ["q1"], "compliance": ["q1"]}, r"'q1' is among parameters\.compliance too"),
    ],
)
def test_wrong_springs_are_one_line(parameters: dict[str, Any], message: str) -> None:
    """The key and what was expected."""
    with pytest.raises(UserError, match=message):
        study_of(parameters={"geometry": [], "base": False, "tool": False, **parameters})


@pytest.mark.cell("springs across joints and along them", "springs")
@pytest.mark.cell("the 6 x 6 matrix of a joint", "springs")
@pytest.mark.cell("springs that are not linear", "springs")
@pytest.mark.parametrize("name", ["q1.rx", "q1.all", "q2.cubic"])
def test_study_of_springs_says_where_others_are_asked_for(name: str) -> None:
    """A study by displacements has the joints' own springs alone."""
    with pytest.raises(UserError, match=r"no joint .*\[parameters\] springs"):
        study_of(parameters=None, joints={"unknown": ["q1", name]}, payload=None)
