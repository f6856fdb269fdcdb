"""A study about some of the compliances: its table, its criteria, its plans and its messages."""

import json
from pathlib import Path

import numpy as np
import pytest
from kr270 import REQUIRED

from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.exact.exact_plan import require_enough, smallest_size
from edtk.design.plan import Plan
from edtk.report.views.evaluation import evaluation_text
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.study.evaluate import OpenInterestError
from edtk.study.plan_study import plan_study, relax_study
from edtk.study.study import Study, load_study
from edtk.study.study_run import Designs
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate
from edtk.verbs.verify import verify

ALL = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
KEYS = REQUIRED | {"candidates": 200}
ABOUT = {"joints": ["q2"], "combinations": [{"q3": 1, "q4": -2}]}
STUDY = Study(**KEYS, interest=ABOUT)
PLAN = ALL.published_plans()["table_4_12"]


def test_combinations_are_columns_by_name():
    """Single joints first, then combinations, in the order of the unknown joints."""
    expected = [[1, 0], [0, 1], [0, -2], [0, 0], [0, 0]]
    np.testing.assert_array_equal(STUDY.interest, expected)
    assert STUDY.interest_names == ("k2", "k3 - 2 k4")
    assert STUDY.criterion("A").label == "A of k2, k3 - 2 k4"
    assert ALL.interest is None
    assert ALL.interest_names == ()


def test_criteria_are_those_of_the_covariance_of_what_is_of_interest():
    """A, D and G of K' cov K; rho0 stays what its test pose says."""
    study = ALL.replace(interest=ABOUT, optimise=["rho0", "D"], criteria=["rho0", "D", "A", "G"])
    all_of_it = evaluate(ALL, PLAN)
    found = evaluate(study, PLAN)
    cov = study.interest.T @ all_of_it.covariance @ study.interest
    assert found.criteria["A"] == pytest.approx(np.trace(cov))
    assert found.criteria["D"] == pytest.approx(np.linalg.det(cov) ** -0.5)
    assert found.criteria["G"] == pytest.approx(cov.diagonal().max())
    assert found.criteria["rho0"] == all_of_it.criteria["rho0"]
    assert found.interest == pytest.approx({"k2": cov[0, 0] ** 0.5, "k3 - 2 k4": cov[1, 1] ** 0.5})
    np.testing.assert_array_equal(found.covariance, all_of_it.covariance)
    assert set(found.skipped) == {"O2", "O4"}
    shown = evaluation_text(found)
    assert "D of k2, k3 - 2 k4 " in shown
    assert "rho0  " in shown


def test_a_study_survives_its_text():
    """Text and back give the same study; without the table nothing of it is written."""
    assert Study(**STUDY.to_dict()).to_dict() == STUDY.to_dict()
    assert "interest" not in ALL.to_dict()


def test_the_default_criterion_is_about_what_is_of_interest():
    """With a test pose rho0 is the default, but not where compliances are named."""
    pose = ALL.to_dict()["test_pose"]
    assert Study(**KEYS, test_pose=pose).main_criterion == "rho0"
    assert Study(**KEYS, test_pose=pose, interest=ABOUT).main_criterion == "D"


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"interest": {}}, "interest: expected joints or combinations"),
        ({"interest": {"joints": ["q1"]}}, "interest.joints: 'q1' is no unknown joint; expected"),
        (
            {"interest": {"combinations": [{"q2": 1}, {"q9": 1}]}},
            r"interest.combinations\[2\]: 'q9' is no unknown joint",
        ),
        ({"interest": {"joints": ["q2", "q2"]}}, "interest: a combination follows from the others"),
        ({"interest": {"combinations": [{"q2": 0}]}}, "interest: a combination is zero"),
        ({"interest": ABOUT, "optimise": ["O2"]}, "optimise: criterion 'O2' is not monotone"),
        ({"interest": ABOUT, "criteria": ["D", "O4"]}, "criteria: criterion 'O4' is not monotone"),
        (
            {"interest": ABOUT, "optimise": ["rho0"], "test_pose": ALL.to_dict()["test_pose"]},
            "interest: no criterion of the study depends on it",
        ),
    ],
)
def test_what_makes_no_sense_is_one_line(keys, expected):
    """Names, dependence, criteria: one line with the key."""
    with pytest.raises(UserError, match=expected) as caught:
        Study(**KEYS | keys)
    assert "\n" not in str(caught.value)


def test_compliances_of_different_units_are_not_added():
    """A joint that slides has its compliance in another unit."""
    turns = Joint("q1", np.eye(4), np.array([0.0, 1, 0]), (-1.0, 1.0))
    slides = Joint("q2", np.eye(4), np.array([1.0, 0, 0]), (0.0, 1.0), "prismatic")
    robot = Robot("odd", (turns, slides))
    keys = KEYS | {"robot": robot, "joints": {"unknown": ["q1", "q2"]}}
    with pytest.raises(UserError, match="a revolute and of a prismatic joint"):
        Study(**keys, interest={"combinations": [{"q1": 1, "q2": 1}]})
    assert Study(**keys, interest={"combinations": [{"q1": 1, "q2": 0}]}).interest_names == ("k1",)


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O1", "O3", "O5"])
def test_relaxations_are_certified_and_verified(name):
    """Value and bound of each criterion agree with those of the second implementation."""
    found = relax_study(STUDY, name)
    assert found.gap < 1e-6
    content = json.loads(json.dumps(certificate(STUDY, found)))
    checked = verify_certificate(content)
    assert checked.valid, checked.failed
    assert checked.label == f"{name} of k2, k3 - 2 k4"
    assert verify(content, STUDY).valid


@pytest.mark.slow
def test_another_interest_is_not_verified():
    """A certificate about all compliances is none about some, and the study knows its own."""
    content = json.loads(json.dumps(certificate(STUDY, relax_study(STUDY, "A"))))
    assert verify(content, STUDY).valid
    assert verify(content, Study(**KEYS)).failed == ("study",)
    other = json.loads(json.dumps(content))
    other["setting"]["interest"][2][1] = -1.0
    assert "value" in verify_certificate(other).failed
    del other["setting"]["interest"]
    assert "value" in verify_certificate(other).failed
    for wrong in ([[1.0, 1.0]] * 5, [[0.0]] * 5, [[1.0]] * 4, "k2"):
        other["setting"]["interest"] = wrong
        with pytest.raises(ValueError, match=r"setting\.interest"):
            verify_certificate(other)
    content["criterion"] = "O2"
    assert not verify_certificate(content).valid


# The vertical load turns q1 in no pose, so that k1 is open in every plan.
OPEN = Study(**KEYS | {"joints": {"unknown": ["q1", "q2", "q3"]}}, interest={"joints": "q2"})


@pytest.mark.slow
def test_a_compliance_that_no_pose_tells_may_be_nuisance():
    """Every M is singular: the bound, the plan and its evaluation are finite all the same."""
    found = relax_study(OPEN, "A", continuous=True)
    assert abs(found.best_bound.gap) < 1e-5
    content = json.loads(json.dumps(certificate(OPEN, found)))
    assert verify_certificate(content).valid
    plan = plan_study(OPEN, 2, "A", budget=0.01)
    assert plan.efficiency > 0.5
    value = evaluate(OPEN, plan.plan)
    assert value.criteria["A"] == pytest.approx(plan.value)
    assert value.std[0] == np.inf
    assert np.isnan(value.covariance[0, 1])
    # The same as without the joint, but for the poses that the fixed joint would exclude.
    without = OPEN.replace(joints={"unknown": ["q2", "q3"]})
    assert evaluate(without, plan.plan).criteria["A"] == pytest.approx(value.criteria["A"])


def test_what_no_pose_tells_cannot_be_of_interest():
    """The message is about the table, and names what is open."""
    study = OPEN.replace(interest={"combinations": [{"q1": 1, "q3": -1}]})
    with pytest.raises(UserError, match=r"interest: .*tells k1 - k3 \(open: k1\)"):
        relax_study(study)
    plan = Plan(PLAN.q[:2], PLAN.wrench[:2], PLAN.repeats[:2])
    with pytest.raises(OpenInterestError, match=r"k1 - k3 \(open: k1\), which is of interest"):
        Designs(study).evaluate(plan)


def test_fewer_experiments_are_enough_for_less():
    """One pose tells three rows: enough for two parameters, of which one is of interest or both."""
    space = OPEN.space
    criterion = OPEN.criterion("A")
    assert smallest_size(space, criterion) == 1
    require_enough(space, 1, 1, criterion)
    with pytest.raises(UserError, match="cannot identify what A of k2, k3 - 2 k4 needs"):
        plan_study(STUDY.replace(candidates=50), 1, "A", budget=0.01)
