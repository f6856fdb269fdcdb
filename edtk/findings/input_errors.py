"""The first thing that is certainly wrong in measurements."""

from edtk.findings.finding import Data, Finding, Severity, Wording
from edtk.findings.fitted_data import FittedData
from edtk.findings.match_plan import other_pose

CHANCE = 1e-3  # probability of equal rows up to which they are copies


def copied_rows(fitted: FittedData) -> Finding | None:
    """Find rows that are the same, if they are more than coarse readings explain."""
    found = fitted.equal_rows
    if found is None or found.chance > CHANCE:
        return None
    return Finding.of(
        Severity.ALARM,
        WORDING,
        "copied_rows",
        rows=(found.later, found.earlier),
        others=found.others,
    )


def _other_pose(fitted: FittedData) -> Finding | None:
    """The first measured pose that is not planned."""
    if fitted.plan is None or fitted.match is None:
        return None
    rows = [(row,) for row in range(len(fitted.data))]
    return other_pose(fitted.study, fitted.data, fitted.plan, fitted.match, rows)


def misread_columns(fitted: FittedData) -> Finding | None:
    """Find columns that fit if they are read otherwise, and do not as they are headed."""
    found = fitted.explanation
    return found.finding if found is not None and found.certain else None


def find_input_error(fitted: FittedData) -> Finding | None:
    """Find the first input error in measurements that can be read and fitted.

    Args:
        fitted: The measurements, their fit, and the plan that was to be carried out.

    Returns:
        The error, with its rows and columns; None if the measurements have none.
    """
    return _other_pose(fitted) or copied_rows(fitted) or misread_columns(fitted)


def twins(data: Data) -> str:
    """Rows that are the same."""
    later, earlier = data["rows"]
    others = data["others"]
    more = f", and {others} more rows have such a twin" if others else ""
    return f"row {later + 1} is row {earlier + 1} to the last digit, in all columns{more}"


def _copied_rows(data: Data) -> str:
    """Rows that were copied."""
    return f"{twins(data)}; expected measurements anew"


WORDING: Wording = {"copied_rows": _copied_rows}
