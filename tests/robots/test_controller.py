"""The map between the controller's joint values and those of the model."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from arm import ROBOT

from edtk.robots.constraints.joint_limits import JointLimits
from edtk.robots.controller import Controller, Follows
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot, shown_limits
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict

KR270 = load_robot("kuka_kr270")
TABLE: dict[str, Any] = {
    "sign": {"q1": -1, "q3": -1},
    "zero_deg": {"q2": -90, "q3": 12.3457},
    "follows": {"q3": "q2", "q5": {"joint": "q4", "factor": -0.25}},
}


def kr270(**table: Any) -> Robot:
    """The KUKA with a controller's table."""
    return robot_from_dict(robot_to_dict(KR270) | {"controller": table})


def test_back_and_forth() -> None:
    """Values of the controller come back from the model's, chains of followers included."""
    follows = (Follows(2, 1, 1.0), Follows(3, 2, -0.5), Follows(1, 5, 2.0))
    units = np.full(6, np.pi / 180)
    rng = np.random.default_rng(0)
    sign = np.array([1.0, -1, -1, 1, -1, 1])
    controller = Controller(sign, rng.uniform(-180, 180, 6), units, follows)
    shown = rng.uniform(-3, 3, (50, 6))
    assert controller.shown_of(controller.model_of(shown)) == pytest.approx(shown, abs=1e-14)
    change = controller.model_of(shown[1:]) - controller.model_of(shown[:-1])
    assert controller.shown_change(change) == pytest.approx(np.diff(shown, axis=0), abs=1e-14)
    assert controller.leaders(3) == (2, 1, 5)


def test_formula() -> None:
    """Sign, zero and coupling are those of the formula, in degrees."""
    robot = kr270(**TABLE)
    shown = np.array([10.0, -70, 42.3457, 20, 30, 40])
    q = np.rad2deg(robot.of_shown(np.deg2rad(shown)))
    assert q == pytest.approx([-10, 20, -(30 + 20), 20, 30 - 0.25 * 20, 40], abs=1e-12)


def test_jogging_the_leader_leaves_the_follower_parallel() -> None:
    """With axes along one another a joint that follows with factor -1 keeps its direction."""
    robot = kr270(follows={"q3": {"joint": "q2", "factor": -1}})
    shown = np.deg2rad([[0.0, -90, 40, 0, 0, 0], [0, -30, 40, 0, 0, 0]])
    turned = robot.forward(robot.of_shown(shown))[:, :3, :3]
    assert turned[0] == pytest.approx(turned[1], abs=1e-15)


def test_written_and_read_again() -> None:
    """A robot's controller survives its file to the last bit; that of the model is left out."""
    robot = kr270(**TABLE)
    again = robot_from_dict(robot_to_dict(robot))
    assert robot.controller is not None
    assert again.controller is not None
    assert (again.controller.sign == robot.controller.sign).all()
    assert (again.controller.zero == robot.controller.zero).all()
    assert again.controller.follows == robot.controller.follows
    assert kr270(sign={"q1": 1}, zero_deg={"q2": 0}).controller is None
    assert "controller" not in robot_to_dict(KR270)


def test_limits_are_the_models() -> None:
    """Printed limits are the controller's values: turned, moved, and of a sum for a follower."""
    robot = kr270(**TABLE)
    ranges = [
        (shown.label, *np.rad2deg(shown.range(joint.limits)).round(4))
        for shown, joint in zip(shown_limits(robot), robot.joints, strict=True)
    ]
    assert ranges[:3] == [
        ("q1", -185.0, 185.0),
        ("q2", -236.0, -90.0),
        ("q3 + q2", -232.6543, 41.3457),
    ]
    assert ranges[4] == ("q5 - 0.25 q4", -125.0, 125.0)


def test_labels_of_limits_tell_the_truth() -> None:
    """The slack of a limit is what its label says about the controller's values."""
    robot = kr270(**TABLE)
    rng = np.random.default_rng(1)
    shown = rng.uniform(-100, 100, 6)
    frames = robot.frames(robot.of_shown(np.deg2rad(shown)))
    constraint = JointLimits(robot.limits)
    values = dict(zip(robot.joint_names, shown, strict=True))
    for inequality, slack in zip(
        constraint.inequalities(robot), np.rad2deg(constraint.slack(frames)), strict=True
    ):
        pattern = r"joint limit (.*) ([<>]) (\S+) deg"
        found = re.fullmatch(pattern, inequality.label)
        assert found is not None
        text, side, bound = found.groups()
        value = eval(re.sub(r"(\d) q", r"\1 * q", text), dict(values))
        above = value - float(bound) if side == ">" else float(bound) - value
        assert above == pytest.approx(slack, abs=1e-3)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"sign": {"q9": 1}}, "controller.sign: no joint 'q9'; this robot has q1, q2"),
        ({"sign": {"q1": 2}}, "controller.sign.q1: "),
        ({"zero_mm": {"q1": 2}}, "controller.zero_mm.q1: the joint is not prismatic; expected"),
        ({"follows": {"q1": "q3"}}, "controller.follows.q1: no joint 'q3'; this robot has"),
        ({"follows": {"q1": "q1"}}, "controller.follows.q1: the joint follows itself"),
        ({"follows": {"q1": {"joint": "q2", "factor": 0}}}, "controller.follows.q1: the factor is"),
        ({"follows": {"q1": "q2", "q2": "q1"}}, "controller.follows: joints follow each other in"),
        ({"zero": {}}, "controller.zero: unknown key"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(table: dict[str, Any], message: str) -> None:
    """A joint that does not exist, another unit, a circle: the key, and what was expected."""
    with pytest.raises(RobotFileError) as caught:
        robot_from_dict(ROBOT | {"controller": table}, where="robot arm")
    assert str(caught.value).startswith(f"robot arm: {message}")


def test_a_slide_and_a_turn_do_not_follow_each_other() -> None:
    """A factor in degrees per millimetre is not what anybody means."""
    slide = Joint("x", np.eye(4), np.array([1.0, 0, 0]), (0.0, 1.0), "prismatic")
    robot = replace(robot_from_dict(ROBOT), joints=(slide, *robot_from_dict(ROBOT).joints))
    content = robot_to_dict(robot)
    with pytest.raises(RobotFileError, match="x is prismatic; expected a joint of the same kind"):
        robot_from_dict(content | {"controller": {"follows": {"q1": "x"}}})
    shown = robot_from_dict(content | {"controller": {"zero_mm": {"x": 250}}})
    assert shown.shown(np.zeros(3)) == pytest.approx([0.25, 0, 0])
