"""A calibration with the posterior of its compliances."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.calibration_budget import calibration_budget
from edtk.calibration.check_posterior import check_posterior
from edtk.calibration.diagnostics.diagnostics import diagnostics
from edtk.calibration.diagnostics.posterior_diagnostics import posterior_diagnostics
from edtk.calibration.finding import Kind
from edtk.inference.least_squares import Estimate
from edtk.inference.noise import Noise
from edtk.inference.sample_posterior import SamplingOptions
from edtk.study.study_prior import study_prior

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration


def with_posterior(
    found: "Calibration", rng: np.random.Generator, options: SamplingOptions
) -> "Calibration":
    """Sample the posterior of a calibration, see `Calibration.sampled`.

    Args:
        found: The calibration without it.
        rng: Source of randomness.
        options: How accurately, and where the chain is kept.
    """
    fitted = found.fitted
    fit = found.fit
    noise = _noise(found)
    check = check_posterior(
        found.study,
        fitted.A,
        fitted.measured,
        fitted.noise,
        Estimate(fit.k, fit.covariance),
        rng,
        noise=noise,
        options=options,
    )
    prior = study_prior(found.study)
    estimated = prior.is_flat and noise.normal and not fit.known and not fit.robust
    budget = found.budget
    named = found.diagnostics
    if fitted.untold:
        names = found.study.model.parameters
        posterior = Estimate(check.posterior.mean, check.posterior.covariance, names)
        fitted = fitted.described_by(posterior)
        budget = calibration_budget(fitted, None)
        named = diagnostics(fitted, None, budget)
    added = posterior_diagnostics(fitted, prior, check.posterior)
    rest = (one for one in named if one.kind is not Kind.PRIOR_CONTRADICTED)
    return replace(
        found,
        fitted=fitted,
        budget=budget,
        diagnostics=tuple(sorted([*added, *rest], key=lambda one: -one.severity)),
        check=replace(check, sigma_estimated=estimated),
    )


def _noise(found: "Calibration") -> Noise:
    """The noise that a posterior assumes beside a fit."""
    noise = found.study.specification.prior.noise()
    if not found.fit.known:
        noise = replace(noise, sigma_factor=np.inf)
    if found.fit.robust and noise.normal:
        noise = replace(noise, nu=None)
    return noise
