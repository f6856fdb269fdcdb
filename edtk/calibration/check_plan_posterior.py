"""The Bayesian check of a plan that is yet to be carried out."""

from dataclasses import replace

import numpy as np

from edtk.calibration.check_posterior import check_posterior
from edtk.calibration.first_estimate import first_estimate
from edtk.calibration.measured_names import measured_names
from edtk.calibration.plan_noise import visits_noise
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.design.plan import Plan
from edtk.inference.noise import Noise
from edtk.inference.sample_posterior import SamplingOptions
from edtk.inference.simulate import simulate
from edtk.study.study import Study


def check_plan_posterior(
    study: Study,
    plan: Plan,
    rng: np.random.Generator,
    *,
    noise: Noise | None = None,
    options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
) -> PosteriorCheck:
    """Simulate one calibration with normal errors, sample its posterior, and compare it.

    Args:
        study: Model, noise, priors and assumed true compliances.
        plan: The plan that is carried out.
        rng: Source of randomness, of the errors and of the sampler.
        noise: Assumptions about the noise; default to those of the study.
        options: How accurately, and where the chain is kept.

    Returns:
        Posterior standard deviations beside those of Eq. (13), and the samples; the reference is
        the assumed truth.

    Raises:
        SingularPlanError: The plan cannot identify all parameters, and the prior does not tell
            the others.
        UserError: The study assumes no true compliances, or its prior is not one.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for the unknowns.
        ChainFileError: The file is no chain, or of another problem.
    """
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    sigma = visits_noise(study, plan)
    measured = simulate(A, study.compliances, sigma, rng)[0]
    fit, untold = first_estimate(study, A, measured, sigma)
    found = check_posterior(study, A, measured, sigma, fit, rng, noise=noise, options=options)
    table = found.table.assign(reference=study.compliances)
    if not untold:  # else Eq. (13) has no inverse
        table = table.rename(columns={"std_fit": "std_eq13"})
    names = measured_names(study.model)
    return replace(found, table=table, reference="assumed truth", coordinates=names)
