"""Names of joints as long as ROS has them, in tables and pictures."""

import re

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from edtk.calibration.planned import plan_bias
from edtk.design.plan import Plan
from edtk.report.comparison_report import _heat_map
from edtk.report.comparison_sections import Efficiencies
from edtk.report.draw.bars import MOST_SIGNS, heat_map, short_names
from edtk.report.tables import name_width, number_columns
from edtk.verbs.evaluate import evaluate
from tests.support.arm import ROBOT, arm

NAMES = ("left_arm_shoulder_lift_joint", "left_arm_elbow_joint")


@pytest.fixture(scope="module")
def study():
    joints = [joint | {"name": name} for joint, name in zip(ROBOT["joints"], NAMES, strict=True)]
    assumed = {"compliance_rad_per_Nm": dict.fromkeys(NAMES, 1e-6)}
    return arm(robot=ROBOT | {"joints": joints}, joints={"unknown": NAMES}, simulation=assumed)


def test_two_spaces_between_columns(study):
    """A long name never runs into the number beside it."""
    q = np.array([[0.1, 0.7], [0.5, -0.9]])
    wrench = np.tile([0.0, 0, -100, 0, 0, 0], (2, 1))
    plan = Plan(q, wrench, np.ones(2, dtype=int))
    for found in (evaluate(study, plan), plan_bias(study, plan, "plan.csv")):
        for name in NAMES:
            assert re.search(rf"k_{name}  +[\d.]+e-\d\d", found.summary())


def test_widths():
    """Columns are as wide as ever, and wider only where a name or a number would fill them."""
    assert name_width(["k1", "k2"], 6) == 6
    assert name_width(["k1", "k_joint_a2"], 6) == 12
    assert number_columns(["a", "b_deg"], [["1", "2"]], 5) == ["    a  b_deg", "    1      2"]
    assert number_columns(["a"], [["123456"]], 5) == ["       a", "  123456"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["k1", "k2"], ["k1", "k2"]),
        ([f"k_{name}" for name in NAMES], ["…shoulder_lift…", "…elbow…"]),
        (["a" * 30], [f"{'a' * 9}…{'a' * 8}"]),
        (["x" * 20 + "1" + "x" * 20, "x" * 20 + "2" + "x" * 20], None),
        (["a_long_prefix_of_all", "a_long_prefix_of"], None),
        ([], []),
    ],
)
def test_short_names(names, expected):
    """What all names share is left out, then their middle; names that differ still do."""
    found = short_names(names)
    assert len(set(found)) == len(names)
    if expected is not None:
        assert found == expected
        assert all(len(name) <= MOST_SIGNS for name in found)


def test_a_small_heat_map_shows_its_title_and_label():
    """Nothing is cut off where few plans are held against few criteria."""
    figure = _heat_map(Efficiencies(4, ["rho0", "D"], ["random"], np.full((1, 2), 50.0), ""))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn = figure.get_tightbbox(canvas.get_renderer())
    assert (drawn.min >= 0).all()
    assert (drawn.max <= figure.get_size_inches()).all()


def test_names_of_a_heat_map():
    """Long names slope, so that they do not cover each other; short ones stay level."""
    for names, slope in ((["rho0", "A"], 0), (["my_criterion", "A"], 40)):
        ax = Figure().add_subplot()
        heat_map(np.full((1, 2), 50.0), ["plan"], names, ax)
        assert [label.get_text() for label in ax.get_xticklabels()] == names
        assert {label.get_rotation() for label in ax.get_xticklabels()} == {slope}
