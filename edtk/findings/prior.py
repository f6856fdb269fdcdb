"""A prior that measurements contradict, and a posterior far from least squares."""

from collections.abc import Iterator

import numpy as np

from edtk.findings.diagnostic import Diagnostic, Severity
from edtk.findings.finding import Finding, Kind
from edtk.findings.fitted_data import FittedData
from edtk.fit.distributions import chi_square_tail, fisher_tail, normal_quantile, student_below
from edtk.fit.identify import Identification
from edtk.fit.posterior import Posterior
from edtk.fit.prior import Flat, Prior

CONTRADICTION = 1e-3  # probability of so large a distance between prior and estimate
QUANTILES = 2001  # of a prior, over which the distribution of an estimate is averaged
FAR = 2.0  # posterior standard deviations between mean and least squares that are worth a line
WIDER = 2.0  # standard deviation of the fit over the posterior's, where the prior says more


def prior_diagnostics(fit: Identification, prior: Prior) -> Iterator[Diagnostic]:
    """Priors under which the least-squares estimate is improbable.

    The estimate is normal about the compliances, with the covariance of the fit, and these are
    distributed as the prior says: the distance to an earlier calibration is Mahalanobis's, under
    the sum of both covariances. One of p marginals counts if its probability is below a p-th.
    """
    p = len(fit.k)
    if prior.earlier is not None:
        probability = _far_from_earlier(fit, prior)
        if probability < CONTRADICTION:
            data = {"p": probability, "earlier": True}
            finding = Finding(Kind.PRIOR_CONTRADICTED, parameters=fit.parameters, data=data)
            yield Diagnostic(Severity.WARNING, finding)
    middle = (np.arange(QUANTILES) + 0.5) / QUANTILES
    z = normal_quantile(middle)
    named = []
    least = 1.0
    for name, marginal, k, std in zip(
        fit.parameters, prior.marginals, fit.unbounded, fit.std, strict=True
    ):
        if isinstance(marginal, Flat):
            continue
        below = float(np.mean(student_below((k - marginal.of_normal(z)) / std, fit.covariance_dof)))
        probability = 2 * min(below, 1 - below)
        if probability < CONTRADICTION / p:
            named.append(name)
            least = min(least, probability)
    if named:
        data = {"p": least, "earlier": False}
        finding = Finding(Kind.PRIOR_CONTRADICTED, parameters=tuple(named), data=data)
        yield Diagnostic(Severity.WARNING, finding)


def _far_from_earlier(fit: Identification, prior: Prior) -> float:
    """Probability of an estimate that is as far from the earlier calibration's."""
    assert prior.earlier is not None
    off = fit.unbounded - prior.earlier.mean
    covariance = fit.covariance + prior.earlier.covariance
    scale = np.sqrt(np.diag(covariance))
    square = (off / scale) @ np.linalg.solve(covariance / np.outer(scale, scale), off / scale)
    p = len(off)
    if np.isinf(fit.covariance_dof):
        return float(chi_square_tail(square, p))
    return float(fisher_tail(square / p, p, fit.covariance_dof))


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
