"""Compliances that come out negative, or hardly different from zero."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData

FAR_BELOW_ZERO = -3.0  # standard deviations that noise does not explain
WEAK = 0.5  # standard deviation over the compliance above which it might as well be zero


def sign_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name compliances that come out negative by far, then those that cannot be told from zero."""
    fit = fitted.fit
    if fit.negative.all():
        yield Diagnostic(Severity.ALARM, Finding(Kind.ALL_NEGATIVE))
        return
    estimates = list(
        zip(fitted.study.model.parameters, fit.unbounded.tolist(), fit.std.tolist(), strict=True)
    )
    for name, k, std in estimates:
        if k < min(FAR_BELOW_ZERO * std, 0):
            yield Diagnostic(Severity.ALARM, _of(Kind.FAR_BELOW_ZERO, name, k, std))
    for name, k, std in estimates:
        if FAR_BELOW_ZERO * std <= k < std / WEAK:
            yield Diagnostic(Severity.WARNING, _of(Kind.NEAR_ZERO, name, k, std))


def _of(kind: Kind, name: str, k: float, std: float) -> Finding:
    """A finding about one parameter."""
    return Finding(kind, parameters=(name,), data={"k": k, "std": std})
