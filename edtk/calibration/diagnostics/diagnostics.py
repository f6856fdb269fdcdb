"""Everything that looks wrong in measurements."""

from edtk.calibration.diagnostics.budget_diagnostics import budget_diagnostics
from edtk.calibration.diagnostics.cause_diagnostics import cause_diagnostics
from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.diagnostics.input_diagnostics import input_diagnostics
from edtk.calibration.diagnostics.noise_diagnostics import noise_diagnostics
from edtk.calibration.diagnostics.outlier_diagnostics import outlier_diagnostics
from edtk.calibration.diagnostics.pose_diagnostics import pose_diagnostics
from edtk.calibration.diagnostics.prior_diagnostics import prior_diagnostics
from edtk.calibration.diagnostics.sign_diagnostics import sign_diagnostics
from edtk.calibration.diagnostics.structure_diagnostics import structure_diagnostics
from edtk.calibration.diagnostics.unit_diagnostics import unit_diagnostics
from edtk.calibration.finding import Kind
from edtk.calibration.fitted_data import FittedData
from edtk.model.error_budget import ErrorBudget

EXPLAIN = (Kind.CAUSE, Kind.NO_CAUSE, Kind.OUTLIERS)


def diagnostics(
    fitted: FittedData, rho0_bias: float | None = None, budget: ErrorBudget | None = None
) -> tuple[Diagnostic, ...]:
    """List everything that looks wrong in measurements, the worst first.

    What explains residuals stands before the line that says how large they are.

    Args:
        fitted: The measurements and their fit. The study's load and its assumed true compliances,
            if it has any, say how large things are.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
        budget: Errors to expect in the test pose; None without one.
    """
    found = list(unit_diagnostics(fitted))
    misread = fitted.explanation is not None and fitted.explanation.refits
    # A wrong unit or a misread column spoils the fit: its other faults are consequences, and would
    # only distract.
    if not misread and all(diagnostic.severity < Severity.ALARM for diagnostic in found):
        found += sign_diagnostics(fitted)
        found += noise_diagnostics(fitted)
        found += cause_diagnostics(fitted)
        found += outlier_diagnostics(fitted)
        if fitted.prior is not None and not fitted.untold:
            found += prior_diagnostics(fitted.fit, fitted.prior)
        found += structure_diagnostics(fitted, rho0_bias)
        found += budget_diagnostics(budget)
    found += pose_diagnostics(fitted)
    found = [*input_diagnostics(fitted), *found]
    return tuple(sorted(found, key=lambda diagnostic: _order(diagnostic, found)))


def _order(diagnostic: Diagnostic, found: list[Diagnostic]) -> tuple[float, bool]:
    """The place of a finding: by its severity; what explains residuals stands before their size."""
    severity = diagnostic.severity
    if diagnostic.kind in EXPLAIN:
        sizes = [one.severity for one in found if one.kind is Kind.NOISE_ABOVE_SIGMA]
        severity = max([severity, *sizes])
    return -severity, diagnostic.kind not in EXPLAIN
