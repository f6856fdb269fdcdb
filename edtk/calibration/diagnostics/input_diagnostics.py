"""Input errors of a sheet that is taken as it is, and what may be one."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.input_errors.find_input_error import find_input_error


def input_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name an input error, or a reading of the columns that explains most of a misfit, not all."""
    finding = find_input_error(fitted)
    if finding is None and fitted.explanation is not None:
        finding = fitted.explanation.finding
    if finding is not None:
        yield Diagnostic(Severity.ALARM, finding)
