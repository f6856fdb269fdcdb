"""A compensation that leaves much of the error, or adds to it, is said to."""

import numpy as np
import pytest
from arm import arm

from edtk.findings.finding import Severity
from edtk.findings.prior import unstated_findings
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


@pytest.mark.parametrize(
    ("known", "left", "noise", "said"),
    [
        (3e-6, 0.9e-6, 0.1e-3, True),
        (3e-6, 0.3e-6, 0.1e-3, False),  # the measurements tell it
        (3e-6, 0.9e-6, 2e-3, False),  # it makes little of the error
        ({"value": 3e-6, "std": 0.9e-6}, 0.9e-6, 0.1e-3, False),  # it is stated
    ],
)
def test_a_promise_that_rests_on_a_value_without_a_std_is_not_good(known, left, noise, said):
    """A joint that is twice as soft would break it, and how large the error were then is said."""
    asked = arm(joints={"unknown": ["q2"], "known_rad_per_Nm": {"q1": known}})
    error = 0.3e-3 * left / 0.9e-6  # of 30 % of the value, as far as it is not told
    budget = ErrorBudget(noise, 0, 0, 0, 0, error, 0, 0, uncompensated=1e-2)
    errors = {"q1": (left, error)}
    found = list(unstated_findings(asked, errors, budget.total))
    assert [one.severity for one in found] == [Severity.WARNING] * said
    for one in found:
        assert one.data["parameters"] == ("q1",)
        assert one.data["softer"] == pytest.approx(np.hypot(budget.total, 1e-3))
