"""The chance that a plan tells two faults apart, before anything is measured."""

import numpy as np
import pytest
from readings import PLAN, STUDY
from scipy.stats import norm

from edtk.calibration.detect import Promised, SizedFamily, detect, right_share, sized_faults
from edtk.design.detection import ENOUGH, Detection
from edtk.findings.causes.family import Family


def fault(only_positive=False):
    """A fault of the usual size of one."""
    family = Family("any", "", 1.0, 1, 1.0, lambda c: None, only_positive=only_positive)
    return SizedFamily(Detection("any", 1.0, "", 1.0, None, 1.0), family, 1.0)


@pytest.mark.cell("`plan --detect`, and faults told apart", "springs")
@pytest.mark.parametrize("length", [1.0, 3.0])
@pytest.mark.parametrize("degrees", [20.0, 60.0, 90.0])
def test_two_lines_are_told_as_their_angle_has_it(length, degrees):
    """Of two equally likely directions, residuals of unit noise are nearer to the right one.

    The nearer of two lines through zero: ``P = F(a) F(b) + F(-a) F(-b)`` with
    ``a = |D c| sin(angle/2)`` and ``b = |D c| cos(angle/2)``.
    """
    angle = np.deg2rad(degrees)
    gram = length**2 * np.array([[1, np.cos(angle)], [np.cos(angle), 1]])
    a, b = norm.cdf(length * np.array([np.sin(angle / 2), np.cos(angle / 2)]))
    expected = a * b + (1 - a) * (1 - b)
    # Binomial: four standard errors of 2000 draws are 4.5 %.
    assert right_share(gram, (fault(), fault())) == pytest.approx(expected, abs=0.045)


def test_what_cannot_be_told_is_chance():
    """Faults that make the same are told by a coin; a sign tells more than that."""
    same = 100.0 * np.ones((2, 2))
    assert right_share(same, (fault(), fault())) == pytest.approx(0.5, abs=0.05)
    # The positive one has twice the density where it is, and none where it is not.
    assert right_share(same, (fault(only_positive=True), fault())) == pytest.approx(0.75, abs=0.05)


@pytest.fixture(scope="module")
def pairs():
    """Two small faults, and one that is never seen, for the published plan of twelve."""
    asked = {"tool_z": "10mm", "load": "10%", "drift": "0.05mm"}
    return detect(Promised.displacements(STUDY, PLAN), sized_faults(STUDY, asked))


def test_an_experiment_more_tells_more(pairs):
    """A pair of those that are seen; the named experiment is within the joint limits."""
    _, (pair,) = pairs
    assert [one.fault for one in pair.faults] == ["tool_z", "drift"]
    assert 0.5 <= pair.right < ENOUGH
    assert pair.right_with > pair.right
    lower, upper = STUDY.robot.limits
    assert ((lower <= pair.better) & (pair.better <= upper)).all()
    assert pair.to_dict() == {
        "faults": ["tool_z", "drift"],
        "right": pair.right,
        "better_q": pair.better.tolist(),
        "right_with": pair.right_with,
        "times": pair.times,
    }


def test_one_fault_makes_no_pair():
    """Nothing is told apart where one fault is asked for, or seen."""
    asked = {"tool_z": "10mm", "load": "10%"}
    assert detect(Promised.displacements(STUDY, PLAN), sized_faults(STUDY, asked))[1] == ()
