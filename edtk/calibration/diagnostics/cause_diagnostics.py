"""Faults that explain the residuals, and noise that repetitions and markers share."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData


def cause_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name what explains the residuals; noise of another size has findings of its own."""
    for cause in fitted.structural_causes:
        finding = Finding(Kind.CAUSE, cause.rows, data={"cause": cause})
        yield Diagnostic(Severity.WARNING, finding)
    yield from _moving_joints(fitted)
    test = fitted.lack_of_fit
    if fitted.noise_estimate is not None and not fitted.noise_estimate.revisited:
        return  # the test of moving joints is that of lack of fit, too
    if test is not None and test.seen:
        common = test.common * float(fitted.data.sigma[:, :3].mean())
        if fitted.noise_estimate is not None:
            common = fitted.noise_estimate.discrepancy
        data = {"F": test.F, "p": test.p, "common": common, "used": fitted.common_noise}
        yield Diagnostic(Severity.WARNING, Finding(Kind.LACK_OF_FIT, data=data))


def _moving_joints(fitted: FittedData) -> Iterator[Diagnostic]:
    """Markers of a visit that move together."""
    found = fitted.noise_estimate
    if found is None or not found.moves:
        return
    data = {
        "F": found.F,
        "p": found.p,
        "joints": found.joints,
        "moved": found.by_joints * float(fitted.data.own_sigma[:, :3].mean()),
        "used": fitted.common_noise,
        "revisited": found.revisited,
    }
    yield Diagnostic(Severity.WARNING, Finding(Kind.MOVING_JOINTS, data=data))
