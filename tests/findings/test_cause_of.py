"""Findings about units and columns are causes too."""

import pytest

from edtk.findings.causes.faults import cause_of
from edtk.findings.finding import Data, Finding, Severity


def alarm(kind: str, data: Data | None = None) -> Finding:
    """A finding of a kind, whose words do not matter."""
    return Finding(Severity.ALARM, kind, kind, data or {})


INCHES = alarm("length_unit", {"unit": "inches"})
SWAPPED = alarm("swapped_columns", {"columns": ("dx_mm", "dy_mm")})


@pytest.mark.parametrize(
    ("finding", "cause", "size", "unit"),
    [
        (INCHES, "unit", 25.4, "mm/inch"),
        (alarm("force_unit", {"unit": "kilograms"}), "unit", 9.81, "N/kg"),
        (alarm("force_unit", {"unit": "pounds"}), "unit", 4.448, "N/lbf"),
        (alarm("angle_unit"), "unit", pytest.approx(57.2958), "deg/rad"),
        (alarm("marker_unit"), "unit", 1000, "mm/m"),
        (alarm("wrong_sign"), "frame_axes", 3, "axes"),
        (SWAPPED, "columns", 2, "columns"),
        (alarm("several_readings", {"readings": (SWAPPED,)}), "columns", 2, "columns"),
    ],
)
def test_cause(finding, cause, size, unit):
    """A unit has the factor to what the sheet is to have, columns their number."""
    found = cause_of(finding)
    assert (found.cause, found.size, found.unit) == (cause, size, unit)


def test_other_findings_are_no_causes():
    """Neither a load of an unknown unit nor residuals are causes of this kind."""
    assert cause_of(alarm("force_unit", {"unit": ""})) is None
    assert cause_of(alarm("noise_above_sigma")) is None
