"""Findings as sentences."""

from dataclasses import replace

import pytest

from edtk.findings.causes.family import Cause
from edtk.findings.finding import Finding, Severity
from edtk.findings.geometric_fit import WORDING
from edtk.findings.noise import causes_words


@pytest.mark.parametrize(
    ("cause", "size", "unit", "words"),
    [
        ("load_size", 10.0, "%", "the load looks 10 +- 1 % larger than stated:"),
        ("load_size", -10.0, "%", "the load looks 10 +- 1 % smaller than stated:"),
        ("tool_z", 9.6, "mm", "the tool point looks 9.6 +- 1 mm further along the tool's z axis:"),
        ("tool_x", -9.6, "mm", "the tool point looks 9.6 +- 1 mm further against the tool's x"),
    ],
)
def test_the_sign_of_a_size_is_a_word(cause, size, unit, words):
    """A person reads how much, and which way; not that something is minus ten per cent larger."""
    found = Cause(cause, size, unit, 1.0, 1e-9)
    assert causes_words({"cause": found, "others": ()}).startswith(words)


def test_two_causes_are_one_or_the_other():
    """Explanations that are about as likely are no two faults, and a person is told so."""
    first = Cause("tool_z", 9.6, "mm", 0.8, 1e-9, explained=0.9)
    second = Cause("tool_x", -12.0, "mm", 2.0, 1e-8)
    text = causes_words({"cause": first, "others": (second,)})
    assert text == (
        "the tool point looks 9.6 +- 0.8 mm further along the tool's z axis, or the tool point "
        "looks 12 +- 2 mm further against the tool's x axis: these measurements cannot tell which; "
        "the first explains 90 % of the misfit (p = 1e-09)"
    )
    second = replace(second, times=3)
    text = causes_words({"cause": first, "others": (second,)})
    assert "cannot tell which, measuring each experiment 3 times could; the first" in text


@pytest.mark.parametrize(
    ("rows", "words"),
    [((10,), "row 11 is off by 0.5 mm: is"), ((6, 7), "rows 7, 8 are off together by 0.5 mm: is")],
)
def test_a_pose_of_one_row_is_off_by_itself(rows, words):
    """What was measured once is not off together with anything."""
    found = Cause("pose", 0.5, "mm", None, 1e-9, rows=rows)
    assert causes_words({"cause": found, "others": ()}).startswith(words)


@pytest.mark.parametrize(
    ("joints", "positions", "words"),
    [
        (0.714, 0.0, "as if joints erred by 0.71 mrad in each pose"),
        (0.0, 0.3, "as if positions erred by 0.3 mm in each pose"),
        (0.4, 0.02, "as if joints erred by 0.4 mrad and positions erred by 0.02 mm in each pose"),
    ],
)
def test_a_discrepancy_of_size_zero_is_not_said(joints, positions, words):
    """What the model leaves is said by the parts that it has, and none is "0 mm"."""
    data = {"rms": 1e-3, "alike": True, "as_drawn": None, "caused": True}
    data |= {"joints_mrad": joints, "positions_mm": positions}
    assert words in Finding.of(Severity.NOTE, WORDING, "discrepancy", **data).words
