"""Residuals that the stated noise makes improbable."""

from collections.abc import Iterator

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.inference.distributions import chi_square_tail

UNLIKELY = 0.01  # p-value of the residuals that is worth a warning
IMPOSSIBLE = 0.001  # and an alarm
TINY = 0.2  # estimated noise over the stated one that looks like another unit


def noise_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Compare the residuals with the stated noise.

    The sum of squares has the chi-square distribution with dof degrees of freedom; with Huber's
    loss the scale, from a median absolute deviation, has about 0.37 dof. Where repetitions share a
    part of the noise, or markers of a visit do, which is estimated, the stated noise is that of
    their scatter.
    """
    fit = fitted.fit
    if not fit.dof:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NO_RESIDUALS))
        return
    n = fit.scale_dof
    scale = fit.scale
    repeated = fitted.lack_of_fit
    visits = fitted.noise_estimate
    if fitted.common_noise and visits is not None:
        n = visits.relative_dof(0)
        scale = visits.tracker
    elif fitted.common_noise and repeated is not None:
        n = repeated.dof[1]
        scale = repeated.pure_error
    p = float(chi_square_tail(scale**2 * n, n))
    explanation = fitted.explanation
    unexplained = explanation is not None and not explanation.refits
    found = fitted.found_causes
    caused = bool(fitted.structural_causes or found.outliers or found.unexplained)
    data = {"scale": scale, "p": p, "unexplained": unexplained, "caused": caused}
    large = p < UNLIKELY if fit.known else p < IMPOSSIBLE
    small = p > 1 - IMPOSSIBLE
    if large and fit.known:
        severity = Severity.ALARM if p < IMPOSSIBLE else Severity.WARNING
        yield Diagnostic(severity, Finding(Kind.NOISE_ABOVE_SIGMA, data=data))
    elif large:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NOISE_ESTIMATED_LARGE, data=data))
    elif small and fit.known:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NOISE_BELOW_SIGMA, data=data))
    elif small and scale < TINY:
        # Where sigma is estimated everything scales with the unit of the displacements: only the
        # size of the noise can tell that it is another one.
        yield Diagnostic(Severity.ALARM, Finding(Kind.NOISE_ESTIMATED_SMALL, data=data))
