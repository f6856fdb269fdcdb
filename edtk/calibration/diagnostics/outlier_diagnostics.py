"""Rows that do not belong to the others."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.inference.identification import Identification
from edtk.inference.identify import INTERPOLATED

TOO_MANY = 3  # of so many rows one outlier is the most for a result that can be used


def outlier_diagnostics(fit: Identification) -> Iterator[Diagnostic]:
    """Name the outliers, and say whether they are too many, or count as much as other rows."""
    if fit.too_few_for_robust:
        numbers = {
            "coordinates": fit.residual.size,
            "parameters": len(fit.k),
            "needed": INTERPOLATED * len(fit.k),
        }
        yield Diagnostic(Severity.WARNING, Finding(Kind.TOO_FEW_FOR_ROBUST, data=numbers))
    if not len(fit.outliers):
        return
    too_many = TOO_MANY * len(fit.outliers) > len(fit.residual)
    severity = Severity.ALARM if too_many else Severity.WARNING
    rows = tuple(fit.outliers.tolist())
    yield Diagnostic(severity, Finding(Kind.OUTLIERS, rows, data={"robust": fit.robust}))
