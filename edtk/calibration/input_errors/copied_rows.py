"""Rows that were copied instead of measured."""

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData

CHANCE = 1e-3  # probability of equal rows up to which they are copies


def copied_rows(fitted: FittedData) -> Finding | None:
    """Find rows that are the same, if they are more than coarse readings explain."""
    found = fitted.equal_rows
    if found is None or found.chance > CHANCE:
        return None
    return Finding(Kind.COPIED_ROWS, (found.later, found.earlier), data={"others": found.others})
