"""Columns that another reading explains."""

from edtk.calibration.finding import Finding
from edtk.calibration.fitted_data import FittedData


def misread_columns(fitted: FittedData) -> Finding | None:
    """Find columns that fit if they are read otherwise, and do not as they are headed."""
    found = fitted.explanation
    return found.finding if found is not None and found.certain else None
