"""The Bayesian check of a plan: does the sampled posterior have the covariance that Eq. (13) promises?"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from edtk.design import Plan
from edtk.inference import estimate, sample_posterior, simulate
from edtk.study.study import Study


def bayes_check(
    study: Study, plan: Plan, rng: np.random.Generator, progress: Callable[[int], object] = lambda steps: None
) -> pd.DataFrame:
    """Simulate one calibration, sample its posterior, and compare standard deviations.

    Args:
        study: Model, noise and assumed true compliances.
        plan: The plan that is carried out.
        rng: Source of randomness.
        progress: Called with the number of steps of the chain so far.

    Returns:
        One row per parameter, SI units: `parameter`, `true`, `mean`, `std_posterior`, `std_eq13`, `ratio`,
        `ratio_error` (Monte-Carlo standard error of the ratio), `tau_steps`, `effective_samples`.

    Raises:
        SingularPlanError: The plan cannot identify all parameters.
        UserError: The study assumes no true compliances.
        UnconvergedError: The chain does not converge.
    """
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    measured = simulate(A, study.compliances, study.sigma, rng)[0]
    fit = estimate(A, measured, study.sigma, study.model.parameters)
    posterior = sample_posterior(A, measured, study.sigma, fit, rng, progress=progress)
    std = np.sqrt(np.diag(fit.covariance))
    return pd.DataFrame(
        {
            "parameter": study.model.parameters,
            "true": study.compliances,
            "mean": posterior.samples.mean(axis=(0, 1)),
            "std_posterior": posterior.std,
            "std_eq13": std,
            "ratio": posterior.std / std,
            "ratio_error": posterior.std_error / std,
            "tau_steps": posterior.tau,
            "effective_samples": posterior.effective,
        }
    )
