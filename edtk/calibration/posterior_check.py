"""The Bayesian check: does the sampled posterior have the covariance that Eq. (13) promises?"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.calibration.pose_error import PoseError, pose_error
from edtk.calibration.study_prior import study_prior
from edtk.design.plan import Plan
from edtk.inference.least_squares import Estimate, estimate
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.run_chain import Demand
from edtk.inference.sample_posterior import SamplingOptions, sample_posterior
from edtk.inference.simulate import simulate
from edtk.study.study import Study
from edtk.system.presented import Presented

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PosteriorCheck(Presented):
    """One calibration, simulated or real, and its posterior.

    Attributes:
        table: One row per parameter, SI units: `parameter`, `unit`, `reference`, `mean`, `low_95`, `high_95`,
            `std_posterior`, `std_fit` (of a simulated calibration `std_eq13`), `ratio`, `ratio_error` (Monte-Carlo
            standard error of the ratio), `tau_steps`, `r_hat`, `effective_samples`.
        reference: What the column `reference` holds: the assumed truth, or what was identified.
        posterior: The samples.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad].
        noise: What is assumed of the noise.
        pose: Errors in the test pose; None without one.
        sigma_estimated: Whether posterior and fit both estimated the size of normal noise, and all priors are flat.
    """

    table: pd.DataFrame
    reference: str
    posterior: Posterior
    A: Array
    measured: Array
    sigma: Array
    noise: Noise
    pose: PoseError | None
    sigma_estimated: bool = False

    def headline(self) -> str:
        """The largest difference between posterior and fit, and the length of the chain."""
        ratio = self.table["ratio"] / self.ratio_to_expect
        worst = float(ratio.iloc[(ratio - 1).abs().argmax()])
        return (
            f"posterior of {len(self.table)} compliances from {len(self.A)} measurements, standard "
            f"deviations up to {worst:.3f} times {self.compared[1]}"
        )

    @property
    def noise_intervals(self) -> dict[str, tuple[float, float, float]]:
        """Median and ends of the 95 % interval of what is unknown of the noise."""
        named = enumerate(self.posterior.noise_names)
        ends = {
            name: np.quantile(self.posterior.noise[..., i], [0.5, 0.025, 0.975]).tolist()
            for i, name in named
        }
        return {name: (row[0], row[1], row[2]) for name, row in ends.items()}

    @property
    def compared(self) -> tuple[str, str]:
        """The column that posterior standard deviations stand beside, and what a person calls it."""
        return (
            ("std_eq13", "std by Eq. (13)")
            if "std_eq13" in self.table
            else ("std_fit", "std of the fit")
        )

    @property
    def ratio_to_expect(self) -> float:
        """Posterior deviation over that of the fit: sqrt(dof/(dof - 2)) where both estimate sigma, else one."""
        dof = self.measured.size - len(self.table)
        return float(np.sqrt(dof / (dof - 2))) if self.sigma_estimated and dof > 2 else 1.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data, SI units."""
        return {
            "parameters": self.table.to_dict(orient="records"),
            "noise": {
                name: dict(zip(("median", "low_95", "high_95"), row, strict=True))
                for name, row in self.noise_intervals.items()
            },
            "test_pose": None if self.pose is None else self.pose.to_dict(),
            "steps": self.posterior.steps,
            "walkers": self.posterior.samples.shape[1],
        }


def check_plan_posterior(
    study: Study,
    plan: Plan,
    rng: np.random.Generator,
    progress: Callable[[int], object] = lambda steps: None,
    *,
    noise: Noise | None = None,
    demand: Demand | None = None,
    chain: Path | None = None,
) -> PosteriorCheck:
    """Simulate one calibration with normal errors, sample its posterior, and compare standard deviations.

    Args:
        study: Model, noise, priors and assumed true compliances.
        plan: The plan that is carried out.
        rng: Source of randomness.
        progress: Called with the number of steps of the chain so far.
        noise: What is assumed of the noise; None for what the study says.
        demand: When the chain is long enough.
        chain: File in which the chain is kept, and from which it goes on.

    Raises:
        SingularPlanError: The plan cannot identify all parameters.
        UserError: The study assumes no true compliances, or its prior is not one.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for what is unknown.
        ChainFileError: The file is no chain, or of another problem.
    """
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    measured = simulate(A, study.compliances, study.sigma, rng)[0]
    fit = estimate(A, measured, study.sigma, study.model.parameters)
    sigma = np.broadcast_to(study.sigma, measured.shape)
    found = check_posterior(
        study, A, measured, sigma, fit, rng, progress, noise=noise, demand=demand, chain=chain
    )
    table = found.table.assign(reference=study.compliances).rename(columns={"std_fit": "std_eq13"})
    return replace(found, table=table, reference="assumed truth")


def check_posterior(
    study: Study,
    A: Array,
    measured: Array,
    sigma: Array,
    identified: Estimate,
    rng: np.random.Generator,
    progress: Callable[[int], object] = lambda steps: None,
    *,
    noise: Noise | None = None,
    demand: Demand | None = None,
    chain: Path | None = None,
) -> PosteriorCheck:
    """Sample the posterior of measurements, and compare standard deviations.

    Args:
        study: Priors, names and test pose.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad].
        identified: What was identified from them, with its covariance: Eq. (13), as it was corrected where sigma was
            estimated, or where the loss was not least squares.
        rng: Source of randomness.
        progress: Called with the number of steps of the chain so far.
        noise: What is assumed of the noise; None for what the study says.
        demand: When the chain is long enough.
        chain: File in which the chain is kept, and from which it goes on.

    Raises:
        UserError: The study's prior is not one.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for what is unknown.
        ChainFileError: The file is no chain, or of another problem.
    """
    prior, noise = study_prior(study), study.specification.prior.noise() if noise is None else noise
    fit = estimate(A, measured, sigma, study.model.parameters)
    posterior = sample_posterior(
        A,
        measured,
        sigma,
        fit,
        rng,
        prior=prior,
        noise=noise,
        options=SamplingOptions(demand or Demand(), chain, progress),
    )
    std = np.sqrt(np.diag(identified.covariance))
    low, high = posterior.interval()
    table = pd.DataFrame(
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
    pose = None if study.target is None else pose_error(study.target, identified, posterior)
    return PosteriorCheck(table, "identified", posterior, A, measured, sigma, noise, pose)
