"""A compensation that would do harm."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.model.error_budget import ErrorBudget


def budget_diagnostics(budget: ErrorBudget | None) -> Iterator[Diagnostic]:
    """Warn of a compensation after which the error is expected to be larger than without any."""
    if budget is not None and budget.total >= budget.uncompensated:
        data = {"total": budget.total, "uncompensated": budget.uncompensated}
        yield Diagnostic(Severity.ALARM, Finding(Kind.DO_NOT_COMPENSATE, data=data))
