"""What a robot is for a calibration: reach, mass, and which loads turn which joint."""

import json

import numpy as np
import pytest
from arm import ROBOT
from chains import tied_chain
from urdf_text import written

import edtk
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import robot_from_dict
from edtk.robots.robot_overview import RobotOverview
from edtk.robots.rotations import transform

TIED = tied_chain()
ARM = robot_from_dict(ROBOT).with_tool(transform([0.5, 0, 0]))


def test_reach_and_levers_of_a_plane_arm():
    """Two links of 0.7 m and 0.5 m, 1 m above the base: levers are the links and their sum."""
    found = RobotOverview(ARM)
    assert found.reach == pytest.approx(2.2, abs=0.02)
    np.testing.assert_allclose(found.lever, [1.2, 0.5], rtol=1e-3)
    np.testing.assert_allclose(found.vertical_lever, [1.2, 0.5], rtol=1e-2)
    assert found.mass is None
    assert found.own_weight is None


def test_joints_that_a_vertical_load_never_turns():
    """A vertical axis is turned by no vertical load, an axis through the tool point by none."""
    found = RobotOverview(load_robot("kuka_kr270"))
    assert found.not_by_gravity.tolist() == [True, False, False, False, False, False]
    assert found.unloaded.tolist() == [False, False, False, True, True, True]
    aside = RobotOverview(load_robot("kuka_kr270").with_tool(transform([0.6, 0, -0.4])))
    assert not aside.unloaded.any()
    assert "No vertical load turns q1: its compliance needs a load of another" in aside.summary()


def test_own_weight_is_what_the_links_weigh_at_their_levers(tmp_path):
    """The slide of the arm lifts its body: 4 kg when it points down."""
    found = RobotOverview(load_robot(written(tmp_path), tip="flange"))
    assert found.mass == 24
    assert found.own_weight[0] == pytest.approx(0, abs=1e-9)
    assert found.own_weight[2] <= 4 * 9.80665
    assert found.own_weight[2] == pytest.approx(4 * 9.80665, rel=0.1)
    assert "follows" not in found.summary()


def test_ties_are_told_and_counted():
    """Joints that follow are no rows, but lines of their own, and levers take them in."""
    found = RobotOverview(TIED)
    J = np.linalg.norm(TIED.jacobian(found._poses)[:, :3], axis=1).max(axis=0)
    np.testing.assert_allclose(found.lever, J)
    assert "q2 follows q5: " in found.summary()
    assert list(found.to_dict()["lever"]) == ["q1", "q3", "q5", "q6"]


def test_open_limits_are_told_and_not_invented(tmp_path):
    """The table says that they are open; JSON lists them."""
    path = written(tmp_path, ('<limit lower="-1" upper="2" effort="1" velocity="1"/>', ""))
    found = edtk.robot(path, tip="flange")
    assert found.open == ("bend",)
    rows = found.summary().splitlines()
    assert "open" in next(row for row in rows if row.startswith("bend"))
    assert "none" in next(row for row in rows if row.startswith("turn"))
    assert "The file has no limits for bend; a study gives them in" in found.summary()
    assert json.loads(json.dumps(found.to_dict()))["open_limits"] == ["bend"]


@pytest.mark.slow
def test_the_picture_is_written(tmp_path):
    """The file is what its name says, and the same in a second run."""
    path = written(tmp_path)
    pictures = [tmp_path / "a.png", tmp_path / "b.png"]
    for picture in pictures:
        edtk.robot(path, tip="flange", plot=picture)
    contents = [picture.read_bytes() for picture in pictures]
    assert contents[0] == contents[1]
    assert contents[0].startswith(b"\x89PNG")


@pytest.mark.parametrize("plot", ["arm.jpg", "arm", "-"])
def test_a_picture_has_an_ending_that_is_known(plot):
    """Other names are one line, before the robot is read."""
    with pytest.raises(edtk.UserError, match=r"plot .*: expected a file whose name ends in \.png"):
        edtk.robot("kuka_kr270", plot=plot)


def test_a_picture_does_not_replace_the_robot(tmp_path):
    """The file that is read is none to write."""
    path = tmp_path / "arm.svg"
    with pytest.raises(edtk.UserError, match="is read by this command"):
        edtk.robot(path, plot=path)


def test_the_chain_ends_before_a_gripper_as_in_a_new_study(tmp_path):
    """The only leaf is a finger: its joint is none of the arm's, here as in `edtk.new`."""
    links = "".join(f'<link name="{name}"/>' for name in ("base", "arm", "hand", "finger"))
    joint = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'
    limit = '<axis xyz="0 1 0"/><limit lower="-1" upper="1"/><origin xyz="0.3 0 0.2"/>'
    joints = [("q1", "base", "arm"), ("q2", "arm", "hand"), ("grip", "hand", "finger")]
    turning = [joint.format(name, "revolute", *ends, limit) for name, *ends in joints]
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="a">{links}{"".join(turning)}</robot>')
    found = edtk.robot(path)
    new = edtk.new(path, tmp_path / "study.toml")
    assert found.robot.joint_names == new.robot.joint_names == ("q1", "q2")
    assert found.left_out == ("grip",)
    assert "The chain ends before grip: joints of the end effector." in found.summary()
    assert edtk.robot(path, tip="finger").robot.joint_names == ("q1", "q2", "grip")
