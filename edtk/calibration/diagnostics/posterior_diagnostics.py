"""A prior that measurements contradict, and a posterior that is far from least squares."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.diagnostics.prior_diagnostics import prior_diagnostics
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.inference.posterior import Posterior
from edtk.inference.prior import Prior

FAR = 2.0  # posterior standard deviations between mean and least squares that are worth a line
WIDER = 2.0  # standard deviation of the fit over the posterior's, where the prior says more


def posterior_diagnostics(
    fitted: FittedData, prior: Prior, posterior: Posterior
) -> Iterator[Diagnostic]:
    """Compare prior, least squares and posterior.

    Args:
        fitted: The measurements and their fit.
        prior: Knowledge before the measurements.
        posterior: Knowledge after them.
    """
    if fitted.untold:
        # The estimate is the posterior's: no least-squares fit is there to be compared with it.
        finding = Finding(Kind.RESTS_ON_PRIOR, parameters=fitted.untold)
        yield Diagnostic(Severity.WARNING, finding)
        return
    contradicted = list(prior_diagnostics(fitted.fit, prior))
    yield from contradicted
    fit = fitted.fit
    distance = np.abs(posterior.mean - fit.k) / posterior.std
    i = int(distance.argmax())
    if distance[i] <= FAR:
        return
    reason = "model"
    if contradicted:
        reason = "contradiction"
    elif fit.std[i] > WIDER * posterior.std[i]:
        reason = "prior"
    elif posterior.noise_names:
        reason = "noise"
    data = {
        "distance": float(distance[i]),
        "mean": float(posterior.mean[i]),
        "k": float(fit.k[i]),
        "reason": reason,
    }
    finding = Finding(Kind.POSTERIOR_DIFFERS, parameters=(fit.parameters[i],), data=data)
    # Where the prior simply says more than few measurements, nothing is wrong.
    severity = Severity.NOTE if reason == "prior" else Severity.WARNING
    yield Diagnostic(severity, finding)
