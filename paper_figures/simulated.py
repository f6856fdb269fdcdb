"""Fig. 7's numbers: what noise in the measurements does to the compensation."""

from dataclasses import dataclass

import numpy as np

from edtk import Plan, Study
from edtk.fit.least_squares import covariance, estimate
from edtk.fit.measurements import simulate
from edtk.measure.expected_error import compensation_accuracy
from edtk.system.typing import Array
from paper_figures import printed_values
from paper_figures.example import plans_of_table_4, target_of
from paper_figures.mean_distance import mean_distance
from paper_figures.targets import both

EXPERIMENTS = 12
RUNS = 20_000
MICROMETRE = 1e-6  # unit of the printed expectations [m]


@dataclass(frozen=True, eq=False)
class Errors:
    """Compensation errors of one plan under one A0, in metres.

    Attributes:
        plan: Number of the plan in Fig. 7, "1" or "2a" to "2e".
        line: Number of its mean line, "3" or "4a" to "4e".
        target: "clipped" or "true".
        distances: Simulated ``|A0 (k_hat - k0)|`` (runs,).
        exact_mean: Their exact expectation.
        rho0: Their exact root mean square, Eq. (20).
        printed: The expectation that the caption prints.
    """

    plan: str
    line: str
    target: str
    distances: Array
    exact_mean: float
    rho0: float
    printed: float

    @property
    def mean(self) -> float:
        """Monte-Carlo mean [m]."""
        return float(self.distances.mean())

    @property
    def mean_error(self) -> float:
        """Standard error of `mean` [m]."""
        return float(self.distances.std(ddof=1) / np.sqrt(len(self.distances)))

    @property
    def rms(self) -> float:
        """Monte-Carlo root mean square [m]."""
        return float(np.sqrt((self.distances**2).mean()))

    @property
    def rms_error(self) -> float:
        """Standard error of `rms`: ``std(d^2) / (2 rms sqrt(runs))`` [m]."""
        spread = (self.distances**2).std(ddof=1)
        return float(spread / (2 * self.rms * np.sqrt(len(self.distances))))


def parameter_errors(study: Study, plan: Plan, rng: np.random.Generator, runs: int) -> Array:
    """``k_hat - k0`` (runs, p) [rad/(N m)] of simulated calibrations: Eq. (10), then Eq. (9)."""
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    measured = simulate(A, study.compliances, study.sigma, rng, runs)
    fit = estimate(A, measured, study.sigma, study.model.parameters)
    return fit.k - study.compliances


def simulate_errors(study: Study, random_plan: Plan, runs: int = RUNS) -> tuple[Errors, ...]:
    """Errors of Fig. 7's six plans, each under both A0 with the same noise.

    Args:
        study: The example; its seed decides the noise.
        random_plan: Plan (1), of twelve poses.
        runs: Simulated calibrations per plan.

    Returns:
        One element a plan and A0, plans in the order of the figure.
    """
    published = plans_of_table_4(study)
    found = []
    for index, line in enumerate(printed_values.figure_7()):
        # A stream a plan: its noise does not depend on which other plans are shown.
        rng = np.random.default_rng([study.specification.seed, index])
        k = line.configurations
        plan = random_plan if k is None else published[k].repeated(EXPERIMENTS // k)
        dk = parameter_errors(study, plan, rng, runs)
        cov = covariance(study.space.information(plan), study.model.parameters)
        for name, A0 in both(target_of(study)).items():
            found.append(
                Errors(
                    plan=line.plan,
                    line=line.line,
                    target=name,
                    distances=np.linalg.norm(dk @ A0.T, axis=1),
                    exact_mean=float(mean_distance(A0 @ cov @ A0.T)),
                    rho0=float(compensation_accuracy(A0, cov)),
                    printed=line.expectation * MICROMETRE,
                )
            )
    return tuple(found)
