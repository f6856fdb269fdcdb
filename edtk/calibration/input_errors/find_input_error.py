"""The first thing that is certainly wrong in measurements."""

from edtk.calibration.finding import Finding
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.input_errors.copied_rows import copied_rows
from edtk.calibration.input_errors.misread_columns import misread_columns
from edtk.calibration.input_errors.other_pose import other_pose


def find_input_error(fitted: FittedData) -> Finding | None:
    """Find the first input error in measurements that can be read and fitted.

    Args:
        fitted: The measurements, their fit, and the plan that was to be carried out.

    Returns:
        The error, with its rows and columns; None if the measurements have none.
    """
    return other_pose(fitted) or copied_rows(fitted) or misread_columns(fitted)
