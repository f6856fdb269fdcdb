"""What cannot well be meant in a study, or in the promise of a plan."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from edtk.design.plan import Plan
from edtk.robots.robot_file import robot_to_dict
from edtk.study.plausibility import plan_plausibility
from edtk.study.run_study import random_case
from edtk.study.study import load_study
from edtk.study.study_run import Designs
from edtk.verbs.evaluate import evaluate

STUDIES = Path(__file__).parents[2] / "studies"
STUDY = load_study(STUDIES / "kr270_milling.toml")
KEYS = STUDY.to_dict()
POSE = KEYS["test_pose"]
UNKNOWN_SIZE = {"simulation": None}


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.toml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("changes", [{}, UNKNOWN_SIZE], ids=["sizes known", "sizes unknown"])
def test_nothing_is_said_of_sound_studies_and_plans(path, changes):
    """The studies of this repository, their published plans and a random one earn no warning."""
    study = load_study(path).replace(**changes)
    assert study.warnings == ()
    plans = [*load_study(path).published_plans().values(), random_case(study, 6, 0).plan]
    assert [plan_plausibility(study, plan) for plan in plans] == [()] * len(plans)


def in_radians():
    """The test pose in radians, to four digits."""
    return {"test_pose": POSE | {"q_deg": np.deg2rad(POSE["q_deg"]).round(4).tolist()}}


def joints_in_millimetres():
    """The robot with all lengths of its joints thousand times as large."""
    robot = robot_to_dict(STUDY.robot)
    for joint in robot["joints"]:
        joint["origin_m"] = [1e3 * x for x in joint["origin_m"]]
    return {"robot": robot}


NONSENSE = {
    "tool in metres": ({"tool": {"position_mm": [0.6115, 0, -0.46]}}, "tool.position_mm: .*metres"),
    "tool of the task": (
        {"test_pose": POSE | {"tool": {"position_mm": [0.986, 0, 0]}}},
        "test_pose.tool.position_mm: .* 0.986 mm .* metres",
    ),
    "tool too long": ({"tool": {"position_mm": [61150, 0, 0]}}, "tool.position_mm: .*together"),
    "marker counted from the flange": (
        {"marker": [{"name": "A", "position_mm": KEYS["tool"]["position_mm"]}]},
        "marker A: its position_mm is that of the tool, .* expected .0, 0, 0.",
    ),
    "robot in millimetres": (joints_in_millimetres(), "robot: .* 3505 m; .* millimetres"),
    "pose in radians": (in_radians(), "test_pose.q_deg: .* radians"),
    "noise": ({"measurement": {"sigma_mm": 50}}, "sigma_mm: 50 mm is more than the load bends"),
    "known sizes": (
        {"measurement": {"sigma_mm": 15}, "simulation": KEYS["simulation"]},
        "sigma_mm: 15 mm .* in .simulation.",
    ),
    "fine noise": ({"measurement": {"sigma_mm": 3e-5}}, "sigma_mm: 3e-05 mm is finer"),
    "load in kilonewtons": ({"load": {"F_N": [0, 0, -0.0025]}}, "more than the load bends"),
    "tool on an axis": ({"tool": {"position_mm": [611.5, 0, 0]}}, "by way of q6; the tool point"),
    "an axis that no load turns": (
        {"joints": {"unknown": ["q1", "q2", "q3"]}},
        "by way of q1; the tool point",
    ),
}


@pytest.mark.parametrize(("changes", "expected"), NONSENSE.values(), ids=NONSENSE)
def test_nonsense_earns_one_line(changes, expected):
    """Each mistake is named once, by its key, in a line that fits a terminal."""
    study = STUDY.replace(**(UNKNOWN_SIZE | changes))
    assert len(study.warnings) == 1
    assert re.search(expected, study.warnings[0].words)
    assert len(study.warnings[0].words) < 200


def test_a_parameter_that_is_hardly_excited_is_named_with_its_cure():
    """Its standard deviation is far above what as many experiments could give it."""
    joints = KEYS["joints"] | {"unknown": ["q2", "q3", "q4", "q5"]}
    study = STUDY.replace(joints=joints, **UNKNOWN_SIZE)
    poses = random_case(study, 2, 0).plan
    # Two poses that are nearly one leave a direction open, about which all parameters are in doubt.
    q = poses.q[[0, 0]] + np.array([[0.0], [1e-4]])
    plan = Plan(q, poses.wrench, np.array([1, 1]))
    line = plan_plausibility(study, plan)[-1].words
    assert line.startswith("hardly told by this plan: k")
    assert line.endswith("set robust_deg in [test_pose], or optimise another criterion such as D")
    robust = study.replace(test_pose=POSE | {"robust_deg": 30})
    assert "plan more experiments" in plan_plausibility(robust, plan)[-1].words
    known = STUDY.replace(joints=joints)
    assert "% of itself" in plan_plausibility(known, plan)[-1].words


def test_a_parameter_that_a_plan_leaves_open_is_named():
    """A criterion that does not ask for a spring may plan without it; the plan says so."""
    joints = KEYS["joints"] | {"unknown": ["q2", "q3", "q4", "q5"]}
    study = STUDY.replace(joints=joints, **UNKNOWN_SIZE)
    poses = random_case(study, 2, 0).plan
    plan = Plan(poses.q[:1], poses.wrench[:1], np.array([3]))
    (line,) = map(str, plan_plausibility(study, plan))
    assert line.startswith("not told by this plan: k")
    assert "[prior]" in line


def test_a_plan_that_is_poor_around_the_test_pose_says_so():
    """Where errors around it are three times as large as in it, both numbers are told."""
    plan = random_case(STUDY, 6, 0).plan
    expected = Designs(STUDY).expected(plan)
    assert plan_plausibility(STUDY, plan, expected) == ()
    poor = replace(expected, mean=4 * expected.test_pose)
    (line,) = map(str, plan_plausibility(STUDY, plan, poor))
    assert line.startswith("errors are 4 times as large around the test pose")


@pytest.mark.parametrize("force", [[0, 0, 2500], [500, 0, 2000]])
def test_a_load_that_pulls_upwards_is_named(force):
    """A weight pulls down: a force that points up has most likely the wrong sign."""
    (line,) = map(str, STUDY.replace(load={"F_N": force}).warnings)
    assert line.startswith(f"load.F_N: {force[2]} N along z pulls the tool upwards")
    assert STUDY.replace(load={"F_N": [0, 2500, 100]}).warnings == ()


def test_an_error_above_the_deflection_is_useless():
    """A plan that leaves more error than the load makes says so; evaluations carry the lines."""
    study = STUDY.replace(measurement={"sigma_mm": 5})
    plan = random_case(STUDY, 2, 0).plan
    found = evaluate(study, plan)
    assert any(
        "larger than what the load bends the robot there" in line.words for line in found.warnings
    )
    assert found.to_dict()["warnings"] == [one.words for one in found.warnings]
    assert found.warnings == study.warnings + plan_plausibility(study, plan)
