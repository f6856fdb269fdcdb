"""Findings as sentences."""

import pytest

from edtk.calibration.causes.cause import Cause
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.wording import wording


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
    assert wording(Finding(Kind.CAUSE, data={"cause": found})).startswith(words)
