"""The Bayesian check: does the sampled posterior have the covariance that the fit states?"""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.first_estimate import first_estimate
from edtk.calibration.pose_error import pose_error
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.least_squares import Estimate
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.sample_posterior import SamplingOptions, sample_posterior
from edtk.inference.whiten import RowNoise
from edtk.study.study import Study
from edtk.study.study_prior import study_prior
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


def check_posterior(
    study: Study,
    A: Array,
    measured: Array,
    sigma: RowNoise,
    identified: Estimate,
    rng: np.random.Generator,
    *,
    noise: Noise | None = None,
    options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
) -> PosteriorCheck:
    """Sample the posterior of measurements, and compare standard deviations.

    Args:
        study: Priors, names and test pose.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        identified: The estimate from these measurements. Its covariance is Eq. (13), corrected
            where sigma was estimated, or where the loss was not least squares; that of
            `first_estimate` where there are none.
        rng: Source of randomness.
        noise: Assumptions about the noise; default to those of the study.
        options: How accurately, and where the chain is kept.

    Raises:
        UserError: The study's prior is not one.
        SingularPlanError: Neither measurements nor prior tell a parameter.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for the unknowns.
        ChainFileError: The file is no chain, or of another problem.
    """
    assumed = study.specification.prior.noise() if noise is None else noise
    fit, untold = first_estimate(study, A, measured, sigma)
    prior = study_prior(study)
    posterior = sample_posterior(
        A, measured, sigma, fit, rng, prior=prior, noise=assumed, options=options
    )
    table = _table(study, identified, posterior)
    # Without a least-squares fit the posterior's mean is what commands are compensated with.
    used = Estimate(posterior.mean, posterior.covariance) if untold else identified
    pose = pose_error(study.tasks, used, posterior) if study.tasks else None
    return PosteriorCheck(
        table, "identified", posterior, A, measured, sigma, assumed, pose, untold=untold
    )


def _table(study: Study, identified: Estimate, posterior: Posterior) -> "pd.DataFrame":
    """The rows of `PosteriorCheck.table`."""
    import pandas as pd

    std = np.sqrt(np.diag(identified.covariance))
    low, high = posterior.interval()
    return pd.DataFrame(
        {
            "parameter": study.model.parameters,
            "unit": study.model.units,
            "reference": identified.k,
            "mean": posterior.mean,
            "low_95": low,
            "high_95": high,
            "std_posterior": posterior.std,
            "std_fit": std,
            "ratio": posterior.std / std,
            "ratio_error": posterior.std_error / std,
            "tau_steps": posterior.tau,
            "r_hat": posterior.r_hat,
            "effective_samples": posterior.effective,
        }
    )
