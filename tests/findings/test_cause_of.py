"""Findings about units and columns are causes too."""

import pytest

from edtk.findings.cause_wording import cause_of
from edtk.findings.finding import Finding, Kind

INCHES = Finding(Kind.LENGTH_UNIT, data={"unit": "inches"})
SWAPPED = Finding(Kind.SWAPPED_COLUMNS, columns=("dx_mm", "dy_mm"))


@pytest.mark.parametrize(
    ("finding", "cause", "size", "unit"),
    [
        (INCHES, "unit", 25.4, "mm/inch"),
        (Finding(Kind.FORCE_UNIT, data={"unit": "kilograms"}), "unit", 9.81, "N/kg"),
        (Finding(Kind.FORCE_UNIT, data={"unit": "pounds"}), "unit", 4.448, "N/lbf"),
        (Finding(Kind.ANGLE_UNIT), "unit", pytest.approx(57.2958), "deg/rad"),
        (Finding(Kind.MARKER_UNIT), "unit", 1000, "mm/m"),
        (Finding(Kind.WRONG_SIGN), "frame_axes", 3, "axes"),
        (SWAPPED, "columns", 2, "columns"),
        (Finding(Kind.SEVERAL_READINGS, data={"readings": (SWAPPED,)}), "columns", 2, "columns"),
    ],
)
def test_cause(finding, cause, size, unit):
    """A unit has the factor to what the sheet is to have, columns their number."""
    found = cause_of(finding)
    assert (found.cause, found.size, found.unit) == (cause, size, unit)


def test_other_findings_are_no_causes():
    """Neither a load of an unknown unit nor residuals are causes of this kind."""
    assert cause_of(Finding(Kind.FORCE_UNIT, data={"unit": ""})) is None
    assert cause_of(Finding(Kind.NOISE_ABOVE_SIGMA)) is None
