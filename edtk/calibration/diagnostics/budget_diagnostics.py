"""A compensation that would do harm, or gain little."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.model.error_budget import ErrorBudget

LITTLE = 0.5  # error with compensation over that without, from which a person is told


def budget_diagnostics(budget: ErrorBudget | None) -> Iterator[Diagnostic]:
    """Warn of a compensation after which the error is expected to be larger than without any.

    One that leaves more than half of the error is worth a note, as the budget says what to improve.
    """
    if budget is None or budget.total <= LITTLE * budget.uncompensated:
        return
    data = {
        "total": budget.total,
        "uncompensated": budget.uncompensated,
        "largest": budget.largest,
    }
    if budget.total >= budget.uncompensated:
        yield Diagnostic(Severity.ALARM, Finding(Kind.DO_NOT_COMPENSATE, data=data))
    else:
        yield Diagnostic(Severity.NOTE, Finding(Kind.GAINS_LITTLE, data=data))
