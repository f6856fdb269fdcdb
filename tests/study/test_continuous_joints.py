"""Joints that turn without end: one turn is drawn, and nothing stops a pose or a descent."""

import json

import numpy as np
import pytest
from arm import KEYS, ROBOT, arm

import edtk
from edtk.robots.robot_file import robot_from_dict
from edtk.robots.workspace import neighbourhood

FIRST, SECOND = ROBOT["joints"]
ENDLESS = {key: value for key, value in FIRST.items() if key != "limits_deg"} | {"continuous": True}
# The whole arm is turned over: its best poses lie where one turn ends.
TURNED = ROBOT | {
    "joints": [ENDLESS, SECOND],
    "base": {"position_m": [0, 0, 0], "rpy_deg": [0, 180, 0]},
}
POSE = {"q_deg": [170, 50], "tool": KEYS["tool"], "load": {"F_N": [50, 0, -80]}}


def endless(**keys):
    return arm(**({"robot": TURNED, "test_pose": POSE} | keys))


def test_limits_are_one_turn_and_no_inequality():
    """Drawn poses fill one turn; a pose beyond it is allowed, and the same pose."""
    study = endless()
    np.testing.assert_array_equal(study.robot.limits[:, 0], [-np.pi, np.pi])
    assert study.space.workspace.labels == ("joint limit q2 > -120 deg", "joint limit q2 < 120 deg")
    q = np.array([4.0, 0.3])
    assert study.space.workspace.contains(q)
    assert study.space.workspace.gradient(q).shape == (2, 2)
    drawn = study.space.draw(np.random.default_rng(0).random((100, 2)))
    assert np.abs(drawn[:, 0]).max() <= np.pi


def test_plans_are_written_within_one_turn():
    """A descent may go on beyond one turn; the plan says the angle between -180 and 180."""
    study = endless()
    x = np.array([[3.5, 0.2], [-0.5, 0.4]])
    assert study.space.at(x).feasible.all()
    plan = study.space.plan(x, np.array([1, 1]))
    np.testing.assert_allclose(plan.q, [[3.5 - 2 * np.pi, 0.2], [-0.5, 0.4]])


def test_the_neighbourhood_of_a_pose_goes_on_behind_one_turn():
    """It is not cut where the angle is written anew."""
    robot = robot_from_dict(TURNED)
    q = np.array([np.deg2rad(179), 0.3])
    around = neighbourhood(robot, q, np.deg2rad(10))
    assert around[:, 0].max() > np.deg2rad(185)
    np.testing.assert_allclose(around.mean(axis=0), q)


def test_fixed_and_test_poses_may_lie_beyond_one_turn():
    """An angle of 190 deg is one that such a joint can take."""
    study = endless(joints={"unknown": ["q2"], "fixed_deg": {"q1": 190}})
    assert study.fixed == {0: np.deg2rad(190)}
    assert endless(test_pose=POSE | {"q_deg": [-350, 50]}).task is not None


def test_certificates_know_joints_without_end(tmp_path):
    """The second implementation takes poses beyond one turn, for such joints only."""
    path = tmp_path / "certificate.json"
    edtk.relax(endless(test_pose=POSE | {"robust_deg": 15}), certificate=path)
    content = json.loads(path.read_text())
    assert edtk.verify(content).valid
    for experiment in content["experiments"]:
        experiment["q"][0] += 2 * np.pi
    assert edtk.verify(content).valid
    del content["setting"]["robot"]["joints"][0]["continuous"]
    assert not edtk.verify(content).valid


@pytest.mark.slow
def test_a_turn_of_the_base_about_a_joint_without_end_changes_no_plan():
    """Wherever the angle is written anew, the best plan has the same value, and its poses turn."""
    vertical = ENDLESS | {"axis": [0, 0, 1]}
    third = SECOND | {"name": "q3"}
    found = []
    for yaw in (0, 137):
        base = {"position_m": [0, 0, 0], "rpy_deg": [0, 0, yaw]}
        robot = ROBOT | {"joints": [vertical, SECOND, third], "base": base}
        names = ["q1", "q2", "q3"]
        study = arm(robot=robot, joints={"unknown": names}, load={"F_N": [80, 0, -100]})
        found.append(edtk.plan(study, size=2, seed=0, workers=1).value)
    assert found[1] == pytest.approx(found[0], rel=1e-3)
