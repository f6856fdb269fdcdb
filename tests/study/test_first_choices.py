"""What a new study begins with: it suits the robot, and the study runs."""

import tomllib
from typing import Any

import numpy as np
import pytest

from edtk.design.candidate_source import CandidateSource
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_from_dict, robot_to_dict
from edtk.study.new_study import first_choices, new_study_text
from edtk.study.study import Study
from edtk.system.errors import UserError

TURN = {"limits_deg": [-170, 170]}


def robot_of(*joints: tuple[list[float], list[float], dict[str, Any]], **keys: Any) -> Robot:
    """A robot of joints (origin, axis, further keys)."""
    listed = [
        {"name": f"q{i + 1}", "origin_m": origin, "axis": axis} | more
        for i, (origin, axis, more) in enumerate(joints)
    ]
    return robot_from_dict({"name": 'an "arm"', "source": "made up", "joints": listed} | keys)


def slide(low: float, high: float) -> dict[str, Any]:
    """Keys of a joint that slides."""
    return {"kind": "prismatic", "limits_m": [low, high]}


ROBOTS = {
    "kr270": load_robot("kuka_kr270"),
    "ur10": robot_of(
        ([0, 0, 0.1273], [0, 0, 1], {"limits_deg": [-360, 360]}),
        ([0, 0.22, 0], [0, 1, 0], {"limits_deg": [-360, 360]}),
        ([0, -0.17, 0.612], [0, 1, 0], {"limits_deg": [-160, 160]}),
        ([0, 0, 0.5723], [0, 1, 0], {"limits_deg": [-360, 360]}),
        ([0, 0.1149, 0], [0, 0, 1], {"limits_deg": [-360, 360]}),
        ([0, 0, 0.1157], [0, 1, 0], {"limits_deg": [-360, 360]}),
    ),
    "scara": robot_of(
        ([0, 0, 0.4], [0, 0, 1], TURN),
        ([0.4, 0, 0], [0, 0, 1], TURN),
        ([0.3, 0, 0], [0, 0, -1], slide(0, 0.2)),
        ([0, 0, 0], [0, 0, -1], TURN),
    ),
    "seven": robot_of(
        ([0, 0, 0.36], [0, 0, 1], TURN),
        ([0, 0, 0], [0, 1, 0], TURN),
        ([0, 0, 0.42], [0, 0, 1], TURN),
        ([0, 0, 0], [0, -1, 0], TURN),
        ([0, 0, 0.4], [0, 0, 1], TURN),
        ([0, 0, 0], [0, 1, 0], TURN),
        ([0, 0, 0.126], [0, 0, 1], TURN),
    ),
    "planar": robot_of(([0, 0, 1], [0, 1, 0], TURN), ([0.7, 0, 0], [0, 1, 0], TURN)),
    "track": robot_of(
        ([0, 0, 0.4], [0, 1, 0], slide(0, 4)),
        ([0, 0, 0.3], [0, 0, 1], TURN),
        ([0.15, 0, 0.3], [0, 1, 0], TURN),
        ([0, 0, 0.7], [0, 1, 0], TURN),
        ([0.3, 0, 0.1], [1, 0, 0], TURN),
        ([0.4, 0, 0], [0, 1, 0], TURN),
    ),
    "gantry": robot_of(
        ([0, 0, 2], [1, 0, 0], slide(0, 3)),
        ([0, 0, 0], [0, 1, 0], slide(0, 2)),
        ([0, 0, 0], [0, 0, 1], slide(-1, 0)),
    ),
}


def new_study(robot: Robot) -> Study:
    """The study of the text that is written for a robot."""
    text = new_study_text(robot, first_choices(robot), "arm.toml", "study.toml")
    return Study(**(tomllib.loads(text) | {"robot": robot_to_dict(robot)}))


@pytest.mark.parametrize("name", ROBOTS)
def test_the_study_runs(name: str) -> None:
    """There is room, every unknown joint is excited, and nothing is hard to believe."""
    study = new_study(ROBOTS[name])
    assert study.warnings == ()
    candidates = CandidateSource(study.space, (0, 0), "random").take(50)
    M = study.space.problem(candidates.x).information(np.full(len(candidates.x), 0.02))
    scale = np.sqrt(np.diag(M))
    assert np.linalg.matrix_rank(M / np.outer(scale, scale), tol=1e-6) == study.model.p
    assert study.compliances.min() > 0


@pytest.mark.parametrize("name", ["kr270", "ur10", "seven", "scara"])
def test_the_test_pose_is_regular_and_inside(name: str) -> None:
    """The arm is not singular in it, it is typed roundly, and the task loads every joint."""
    study = new_study(ROBOTS[name])
    assert study.task is not None
    assert study.specification.test_pose is not None
    lower, upper = study.robot.limits
    assert ((study.task.q > lower) & (study.task.q < upper)).all()
    assert all(value % 5 == 0 for value in study.specification.test_pose.q_deg)
    J = study.task.model.robot.jacobian(study.task.q) / ([[study.robot.reach]] * 3 + [[1.0]] * 3)
    free = [j for j in range(study.robot.n) if j not in study.fixed]
    assert np.linalg.svd(J[:, free], compute_uv=False)[-1] > 0.05
    assert (np.linalg.norm(study.task.regressor, axis=0) > 0).all()


def test_a_weight_does_not_turn_an_upright_joint() -> None:
    """The first joint is fixed; where hardly a joint feels a weight, the load pulls sideways."""
    found = first_choices(ROBOTS["kr270"])
    assert found.fixed == {"q1": 0.0}
    assert found.force[:2] == (0, 0)
    assert found.force[2] == pytest.approx(-9.81 * found.payload, rel=0.03)
    sideways = first_choices(ROBOTS["scara"])
    assert sideways.force[2] == 0
    assert sideways.fixed == {"q3": 100.0}  # the middle of its range, for zero is its end


def test_an_arm_on_a_track_keeps_no_distance_from_an_axis_far_away() -> None:
    """The track stands in its middle, two metres from the world's z-axis."""
    assert first_choices(ROBOTS["track"]).radius_mm is None
    assert first_choices(ROBOTS["kr270"]).radius_mm is not None


def test_the_load_is_one_that_any_arm_carries() -> None:
    """It grows with the cube of the reach, and is never beyond a mass that somebody gives."""
    kr270 = first_choices(ROBOTS["kr270"])
    assert kr270.reach == pytest.approx(2.7, abs=0.1)
    assert (kr270.payload, kr270.given) == (20, False)
    assert 1 <= first_choices(ROBOTS["ur10"]).payload <= 10
    for kilograms in (0.013, 2.77, 150.0, 270.0):
        found = first_choices(ROBOTS["kr270"], kilograms)
        assert found.given
        weight = 9.81 * kilograms
        assert 0.99 * weight < -found.force[2] <= weight


def test_a_track_changes_nothing_of_what_its_arm_carries() -> None:
    """However far it goes, tool and load are those of the arm; a wrist on slides is no arm."""
    content = robot_to_dict(ROBOTS["kr270"])
    track = {"name": "rail", "origin_m": [0, 0, 0], "axis": [0, 1, 0]} | slide(-5, 5)
    alone = first_choices(ROBOTS["kr270"])
    there = first_choices(robot_from_dict(content | {"joints": [track, *content["joints"]]}))
    assert (there.payload, there.tool_mm) == (alone.payload, alone.tool_mm)
    assert there.reach == pytest.approx(alone.reach, rel=0.01)
    assert first_choices(ROBOTS["gantry"]).reach > 1


def test_made_up_gears_are_those_of_a_usual_robot() -> None:
    """They do not follow the careful load, with which a heavy robot would be as soft as a cobot."""
    kr270 = first_choices(ROBOTS["kr270"])
    assert 1e-7 < kr270.compliance["q2"] < 1e-6
    assert 1e-6 < first_choices(ROBOTS["ur10"]).compliance["q2"] < 1e-4


def test_a_controllers_angles() -> None:
    """The test pose and the fixed joint are what the controller shows."""
    table = {"sign": {"q1": -1}, "zero_deg": {"q1": 30, "q2": -90}, "follows": {"q3": "q2"}}
    plain = new_study(ROBOTS["kr270"])
    study = new_study(robot_from_dict(robot_to_dict(ROBOTS["kr270"]) | {"controller": table}))
    assert study.specification.joints.fixed_deg == {"q1": 0.0}
    assert study.fixed == pytest.approx({0: np.deg2rad(30)})
    assert study.task is not None
    assert plain.task is not None
    assert np.abs(study.task.q - plain.task.q).max() < np.pi
    assert all(value % 5 == 0 for value in study.specification.test_pose.q_deg)  # type: ignore[union-attr]


def test_a_robot_without_reach_is_refused() -> None:
    """A single joint whose flange lies on its axis has no size to go by."""
    with pytest.raises(UserError, match="the flange does not move; expected a robot with links"):
        first_choices(robot_of(([0, 0, 1], [0, 0, 1], TURN)))


def test_an_axis_that_is_upright_but_for_its_digits() -> None:
    """A quarter turn of 1.5708 makes no joint that a weight turns."""
    content = robot_to_dict(ROBOTS["ur10"])
    content["joints"][0] |= {"rpy_deg": np.rad2deg([1.5708, 0, 0]).tolist(), "axis": [0, 1, 0]}
    content["joints"][1] |= {"rpy_deg": np.rad2deg([-1.5708, 0, 0]).tolist()}
    assert set(first_choices(robot_from_dict(content)).fixed) == {"q1"}


def test_plans_of_a_new_study_keep_a_margin() -> None:
    """Joints that move stay 2 deg or 5 mm away from their limits, where they have the room."""
    assert new_study(ROBOTS["kr270"]).specification.joints.margin_deg == 2
    joints = new_study(ROBOTS["gantry"]).specification.joints
    assert (joints.margin_deg, joints.margin_mm) == (0, 5)
    short = {"limits_deg": [-8, 8]}
    tiny = robot_of(([0, 0, 1], [0, 1, 0], TURN), ([0.7, 0, 0], [0, 1, 0], short))
    assert new_study(tiny).specification.joints.margin_deg == 0
