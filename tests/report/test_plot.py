"""Every result can be drawn and shown in a notebook."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from arm import ROBOT, arm
from matplotlib import pyplot
from matplotlib.cbook import is_math_text
from matplotlib.text import Text

import criteria
import edtk
from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import compensate
from edtk.calibration.planned import check_plan_posterior, plan_bias
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.findings.fitted_data import FittedData
from edtk.fit.measurements import Measurements, simulate
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.measure.compliances import Compliances
from edtk.report.draw.bars import correlation, heat_map
from edtk.report.draw.plans import joint_variables
from edtk.robots.robot_overview import RobotOverview
from edtk.study.plan_study import relax_study
from edtk.study.study import load_study
from edtk.system.errors import ArgumentError
from edtk.verbs.evaluate import evaluate

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_3"].repeated(2)
NAMES = (
    "plan",
    "evaluation",
    "plan_bias",
    "calibration",
    "posterior_check",
    "compensation",
    "relaxation",
    "relaxed_plan",
    "robot",
    "robot_overview",
)


def _calibration():
    """A calibration from simulated measurements of the plan."""
    q = np.repeat(PLAN.q, PLAN.repeats, axis=0)
    wrench = np.repeat(PLAN.wrench, PLAN.repeats, axis=0)
    A = STUDY.model.regressor(q, wrench)
    moved = simulate(A, STUDY.compliances, STUDY.sigma, np.random.default_rng(0))[0]
    sigma = np.tile(STUDY.sigma, (len(q), 1))
    data = Measurements(q, wrench, moved, sigma, np.zeros((len(q), 3)))
    return SpringCalibration(FittedData.of(STUDY, data), findings=(), path=Path("day <1>.csv"))


def _compensation():
    """A compensation of two task poses."""
    joints = STUDY.specification.joints.unknown
    covariance = np.linalg.inv(STUDY.space.information(PLAN))
    known = Compliances(joints, STUDY.compliances, STUDY.compliances, covariance)
    q = STUDY.task.q + np.deg2rad([[0], [2]])
    task = Plan(q, np.tile(STUDY.task.wrench, (2, 1)), np.ones(2, dtype=int))
    return compensate(CalibratedSprings(STUDY, known), task, "task")


@pytest.fixture(scope="module")
def results():
    """One result of each kind, by the name of its files."""
    blocks = np.random.default_rng(0).normal(size=(20, 3, 4))
    options = SamplingOptions(Demand(0.2))
    return {
        "plan": PLAN,
        "evaluation": evaluate(STUDY, PLAN),
        "plan_bias": plan_bias(STUDY, PLAN, "plan.csv"),
        "calibration": _calibration(),
        "posterior_check": check_plan_posterior(
            STUDY, PLAN, np.random.default_rng(0), options=options
        ),
        "compensation": _compensation(),
        "relaxation": relax(Problem(blocks), criteria.create("D")),
        "relaxed_plan": relax_study(STUDY, "A", candidates=200),
        "robot": STUDY.robot,
        "robot_overview": RobotOverview(STUDY.robot),
    }


@pytest.fixture(autouse=True)
def no_figures():
    """Figures are closed after each test."""
    yield
    pyplot.close("all")


def labels(axes):
    """Labels of all axes."""
    return [getattr(ax, f"get_{axis}label")() for ax in np.ravel(axes) for axis in "xy"]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_axes_have_labels_with_units(results, name):
    """Every picture names its quantities, and those that have a unit with it."""
    text = "\n".join(labels(results[name].plot()))
    expected = {
        "plan": r"joint variable \[rad or m\]",
        "evaluation": r"standard deviation \[rad/\(N m\)\]",
        "plan_bias": r"bias \[standard deviations\]",
        "calibration": r"deviation from the estimate \[%\][\s\S]*residual \[mm\]",
        "posterior_check": r"k2\n\[\$10\^\{-9\}\$ rad/\(N m\)\]",
        "compensation": r"error of the tool point \[mm\]",
        "relaxation": r"weight \[share of the experiments\]",
        "relaxed_plan": r"weight \[share of the experiments\]",
        "robot": r"x \[m\]",
        "robot_overview": r"z \[m\]",
    }
    assert re.search(expected[name], text)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name != "posterior_check"])
def test_axes_may_be_given(results, name):
    """A picture is drawn into given axes; one of several panels divides their place."""
    projection = {"projection": "3d"} if name == "robot" else {}
    _, axes = pyplot.subplots(1, 2, subplot_kw=projection)
    drawn = np.ravel(results[name].plot(axes[1]))
    place = axes[1].get_position()
    inside = [place.x0 - 1e-9 <= ax.get_position().x0 <= place.x1 for ax in drawn]
    assert all(inside)
    assert not axes[0].has_data()
    assert pyplot.get_fignums() == [1]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_a_small_table(results, name):
    """The table has the headline and nothing from outside; every result fits on a screen."""
    text = results[name]._repr_html_()
    headline = results[name].headline()
    assert headline.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;") in text
    assert text.count("<table") >= 1
    assert not re.search(r"(src|href)=|<script|http", text)
    assert len(repr(results[name])) <= 100
    assert results[name].summary().strip()


@pytest.mark.slow
def test_a_plan_in_degrees(results):
    """With its robot a plan is drawn in degrees, the joints by their names."""
    ax = results["plan"].plot(robot=STUDY.robot)
    assert ax.get_ylabel() == "joint angle [deg]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(
        STUDY.robot.joint_names
    )


def test_a_robot_in_a_pose(results):
    """The tool point is drawn where forward kinematics puts it."""
    q = PLAN.q[0]
    ax = results["robot"].plot(q=q)
    expected = STUDY.robot.forward(q)[:3, 3]
    (marker,) = [line for line in ax.get_lines() if line.get_marker() == "o"]
    np.testing.assert_allclose(np.ravel(marker.get_data_3d()), expected, atol=1e-12)


@pytest.mark.slow
def test_no_name_is_taken_for_a_formula():
    """Dollars, carets and backslashes in names of joints and robots are drawn as they are."""
    odd = r"$\frac{^_x$"
    names = {name: f"{odd}{name}" for name in ("q1", "q2")}
    joints = [joint | {"name": names[joint["name"]]} for joint in ROBOT["joints"]]
    study = arm(
        title=odd,
        robot=ROBOT | {"name": odd, "joints": joints},
        joints={"unknown": list(names.values())},
    )
    q = np.array([[0.1, 0.5], [0.9, -0.6]])
    wrench = np.tile([0, 0, -100.0, 0, 0, 0], (2, 1))
    plan = Plan(q, wrench, np.array([1, 2]))
    figure, axes = pyplot.subplots(5, 1)
    evaluate(study, plan).plot(ax=axes[0])
    joint_variables(plan, study.robot, axes[1])
    correlation(np.eye(2), study.model.parameters, axes[2])
    heat_map(np.eye(2), [odd, odd], [odd, "A"], axes[3])
    axes[4].remove()
    three = study.robot.plot()
    for drawn in (figure, three.figure):
        texts = [text.get_text() for text in drawn.findobj(Text)]
        assert any("frac" in text for text in texts)
        assert not any(is_math_text(text) for text in texts if "frac" in text)
    three.figure.draw_without_rendering()
    pyplot.close("all")


def candidates():
    """A parabola over a data frame of 41 rows."""
    pytest.importorskip("formulaic")
    frame = pd.DataFrame({"dose": np.linspace(0, 10, 41), "batch": ["a"] * 41})
    return edtk.Problem.from_frame(frame, "1 + dose + I(dose**2)")


@pytest.mark.parametrize("name", ["D", "E", "O2", "O4"])
def test_equivalence_theorem(name):
    """The largest sensitivity is one, and the candidates that carry weight have it."""
    design = edtk.relax(candidates(), name)
    ax = design.plot()
    curve = ax.get_lines()[0]
    assert ax.get_xlabel() == "dose"
    assert "sensitivity / largest" in ax.get_ylabel()
    np.testing.assert_allclose(curve.get_xdata(), np.linspace(0, 10, 41))
    heights = curve.get_ydata()
    assert heights.max() == pytest.approx(1.0)
    heavy = design.weights > 1e-3
    np.testing.assert_allclose(heights[heavy], 1.0, atol=1e-4)
    stems = ax.get_lines()[-1]
    np.testing.assert_array_equal(stems.get_ydata(), design.weights[design.support])


def test_equivalence_theorem_over_any_numbers():
    """Candidates are drawn over their numbers, or over what is given; a million stay a picture."""
    blocks = np.random.default_rng(0).normal(size=(20_000, 1, 2))
    design = edtk.relax(edtk.Problem(blocks), "D")
    ax = design.plot()
    assert ax.get_xlabel() == "candidate"
    assert len(ax.get_lines()[0].get_xdata()) == 5000
    assert ax.get_lines()[0].get_ydata().max() == pytest.approx(1.0)
    ax = design.plot(x=blocks[:, 0, 0])
    assert ax.get_lines()[0].get_xdata()[0] == blocks[:, 0, 0].min()


@pytest.mark.parametrize(
    ("x", "expected"),
    [("batch", "a column of numbers of the frame: dose"), ([1.0], "a number for each of 41")],
)
def test_places_that_candidates_do_not_have(x, expected):
    """One line says what was expected."""
    design = edtk.relax(candidates(), "D")
    with pytest.raises(ArgumentError, match=expected):
        design.plot(x=x)
    plain = edtk.relax(edtk.Problem(np.eye(2)[:, None]), "D")
    with pytest.raises(ArgumentError, match="do not come from a data frame"):
        plain.plot(x="dose")


@pytest.mark.slow
def test_a_study_is_drawn_in_its_test_poses() -> None:
    """The arm stands in the first test pose, others are lines, and an arrow is the load."""
    ax = STUDY.plot()
    assert ax.get_title() == "KUKA KR 270 in its test pose; the arrow is the load there, 332.9 N"
    tool = STUDY.task.model.robot.forward(STUDY.task.q)[:3, 3]
    front = max(ax.lines, key=lambda line: line.get_zorder())  # the link does not hide it
    np.testing.assert_allclose(np.ravel(front.get_data_3d()), tool, atol=1e-12)
    lines = [np.array(line.get_data_3d()).T for line in ax.lines]
    assert any(np.allclose(line[0], tool, atol=1e-9) for line in lines)
    pose = STUDY.to_dict()["test_pose"]
    other = pose | {"q_deg": [0, -60, 90, 10, 45, 30]}
    both = STUDY.replace(test_pose=[pose, other], published=None)
    second = both.tasks[1].model.robot.forward(both.tasks[1].q)[:3, 3]
    ax = both.plot()
    assert "2 of them" in ax.get_title()
    assert any(np.allclose(np.array(line.get_data_3d())[:, -1], second) for line in ax.lines)
    pyplot.close("all")
