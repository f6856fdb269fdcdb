"""A compensation that leaves much of the error, or adds to it, is said to."""

import pytest

from edtk.findings.finding import Severity
from edtk.findings.springs import budget_findings
from edtk.measure.expected_error import ErrorBudget


@pytest.mark.parametrize(
    ("noise", "kind", "severity"),
    [
        (1.1e-3, "do_not_compensate", Severity.ALARM),
        (0.9e-3, "gains_little", Severity.NOTE),
        (0.4e-3, None, None),
    ],
)
def test_a_compensation_is_compared_with_none(noise, kind, severity):
    """More than the whole error is an alarm, more than half of it a note that says how much."""
    found = list(budget_findings(ErrorBudget(noise, 0, 0, 0, 0, 0, 0, 0, uncompensated=1e-3)))
    assert [(one.kind, one.severity) for one in found] == ([(kind, severity)] if kind else [])
    assert all(f"{1e3 * noise:.2g} mm, and 1 mm without" in one.words for one in found)


def test_without_a_budget_nothing_is_said():
    """A study without a test pose has no error to compare."""
    assert list(budget_findings(None)) == []
