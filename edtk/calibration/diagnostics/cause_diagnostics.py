"""Faults that explain the residuals, and noise that repetitions share."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData


def cause_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name what explains the residuals; noise of another size has findings of its own."""
    for cause in fitted.structural_causes:
        finding = Finding(Kind.CAUSE, cause.rows, data={"cause": cause})
        yield Diagnostic(Severity.WARNING, finding)
    test = fitted.lack_of_fit
    if test is not None and test.seen:
        common = test.common * float(fitted.data.sigma[:, :3].mean())
        data = {"F": test.F, "p": test.p, "common": common, "used": fitted.common_noise}
        yield Diagnostic(Severity.WARNING, Finding(Kind.LACK_OF_FIT, data=data))
