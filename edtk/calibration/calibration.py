"""Identified compliances, with everything that a person wants to know about them."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.calibration_budget import propagation_of
from edtk.calibration.calibration_to_dict import calibration_to_dict
from edtk.calibration.cause_of import cause_of
from edtk.calibration.causes.cause import Cause
from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.interest_estimates import interest_estimates
from edtk.calibration.origin import Origin
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.calibration.propagation import Propagation
from edtk.calibration.residual_table import residual_table
from edtk.calibration.told_part import ToldPart
from edtk.calibration.with_posterior import with_posterior
from edtk.inference.estimate_noise import NoiseEstimate
from edtk.inference.identification import Identification
from edtk.inference.lack_of_fit import LackOfFit
from edtk.inference.measurements import Measurements
from edtk.inference.sample_posterior import SamplingOptions
from edtk.model.error_budget import ErrorBudget
from edtk.model.expected_error import ExpectedError, expected_error
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.accuracy_of_tasks import accuracy_of_tasks
from edtk.study.study import Study
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

VERDICTS = {Severity.NOTE: "good", Severity.WARNING: "usable", Severity.ALARM: "bad"}


@dataclass(frozen=True, eq=False)
class Calibration(Presented):
    """Identified compliances, and whether to trust them.

    Attributes:
        fitted: The study, its measurements, and the fit.
        diagnostics: Everything that looks wrong, the worst first.
        path: Where the measurements are.
        bias: By how far the linear model makes the compliances (p,) too large, to the first order
            [rad/(N m)]; zero where the loaded equilibrium was fitted, None if it is unknown.
        budget: The error to expect in the task, in parts; None without a test pose.
        check: The posterior; None where it was not sampled.
        origin: The file as it was read, and what was asked for.
        part: What the measurements tell, where they leave compliances open that are not of
            interest; None where they tell all.
    """

    fitted: FittedData
    diagnostics: tuple[Diagnostic, ...]
    path: Path
    bias: Array | None = None
    budget: ErrorBudget | None = None
    check: PosteriorCheck | None = None
    origin: Origin = Origin()  # noqa: RUF009  (frozen)
    part: ToldPart | None = None

    def headline(self) -> str:
        """Number of measurements, the accuracy to expect, and the verdict."""
        rows = f"{len(self.data)} measurements of {self.data.pose.max() + 1} poses"
        accuracy = ""
        if self.study.target is not None:
            accuracy = f", rho0 = {1e3 * self.fit.accuracy(self.study.target)[0]:.4g} mm"
        return f"{len(self.fit.k)} compliances from {rows}{accuracy}; verdict: {self.verdict}"

    @property
    def study(self) -> Study:
        """The question."""
        return self.fitted.study

    @property
    def asked(self) -> Study:
        """The question as it was given, of which the measurements may leave a part open."""
        return self.study if self.part is None else self.part.asked

    @property
    def interest(self) -> dict[str, tuple[float, float]]:
        """Estimate and standard deviation of each combination of interest; empty without any."""
        combined = self.part is not None and bool(self.part.stands_for)
        return interest_estimates(self.asked, self.study, self.fit, combined)

    @property
    def data(self) -> Measurements:
        """The measurements."""
        return self.fitted.data

    @property
    def fit(self) -> Identification:
        """Estimates and statistics, as arrays in the order of the study's unknown joints."""
        return self.fitted.fit

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Faults that explain the measurements, the likeliest first; empty where noise does.

        Units and columns come first: with wrong ones, no refit of other faults means anything.
        """
        misread = (cause_of(diagnostic.finding) for diagnostic in self.diagnostics)
        return tuple(filter(None, misread))[:1] or self.fitted.causes

    @property
    def lack_of_fit(self) -> LackOfFit | None:
        """Whether repetitions agree better than the model; None without repetitions."""
        return self.fitted.lack_of_fit

    @property
    def noise(self) -> NoiseEstimate | None:
        """Errors of tracker, joints and model by what visits share; None where nothing tells.

        Where no pose is visited twice, a fault that is named may have made what markers share.
        """
        found = self.fitted.noise_estimate
        if found is None or found.revisited or not self.fitted.structural_causes:
            return found
        return None

    @property
    def k(self) -> dict[str, float]:
        """Compliances by joint [rad/(N m), or m/N of a prismatic joint], not negative.

        NaN where the measurements do not tell one by itself.
        """
        return self.by_joint(self.fit.k)

    @property
    def std(self) -> dict[str, float]:
        """Standard deviations of the compliances by joint, in their units."""
        return self.by_joint(self.fit.std)

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the estimates (p,) are of: a parameter each; or a combination, if some are open."""
        words = {} if self.part is None else self.part.stands_for
        joints = self.study.specification.joints.unknown
        names = zip(joints, self.study.model.parameters, strict=True)
        return tuple(words.get(joint, name) for joint, name in names)

    @property
    def verdict(self) -> str:
        """Whether to use the result: "good", "usable" or "bad".

        It is never better than the worst diagnostic, and not good where the study says what is hard
        to believe.
        """
        least = Severity.WARNING if self.study.warnings else Severity.NOTE
        worst = (diagnostic.severity for diagnostic in self.diagnostics)
        return VERDICTS[max([least, *worst])]

    @property
    def expected(self) -> ExpectedError | None:
        """Errors to expect in the test pose and around it; None without a test pose."""
        tasks = self.study.tasks
        return expected_error(tasks, self.fit.covariance) if tasks else None

    @cached_property
    def tasks(self) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None for one or none.

        Where there is a budget, they have the total of all its parts, too.
        """
        fit = self.fit
        tasks = self.study.tasks
        found = accuracy_of_tasks(self.study, fit.covariance, fit.k, fit.covariance_dof)
        if found is None or self.budget is None:
            return found
        bias = np.zeros(len(fit.k)) if self.bias is None else self.bias
        left = np.array([float(np.linalg.norm(task.target @ bias)) for task in tasks])
        return replace(found, total=self.propagation.totals(tasks, left))

    @cached_property
    def propagation(self) -> Propagation:
        """How all that is uncertain moves the compliances that commands rest on."""
        return propagation_of(self.fitted)

    @property
    def rho0_bias(self) -> float | None:
        """Length of the mean error in the test pose that the linear model leaves [m].

        None without a test pose, or if the bias is unknown.
        """
        if self.bias is None or self.study.target is None:
            return None
        return float(np.linalg.norm(self.study.target @ self.bias))

    @property
    def assumed(self) -> str:
        """What no reading tells and is taken as stated, with its cost; empty where readings do.

        A load of another size makes all displacements larger alike, as softer joints do. A spring
        that is known, a prior on the others, or weights besides the load tell these apart.
        """
        known = bool(self.study.known) or self.fitted.told_before is not None
        if known or self.study.model.weights is not None:
            return ""
        return (
            "the size of the load is assumed, as no reading tells it without a known spring: 1 % "
            "of the load is 1 % of every displacement, and of every compliance"
        )

    @property
    def sigma_hat(self) -> float:
        """Estimated noise of a position coordinate [m].

        It is the scale of the residuals times the root mean square of the given sigma.
        """
        return float(self.fit.scale * np.sqrt(np.mean(self.data.sigma[self.data.lengths] ** 2)))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, SI, for JSON; a number that is not known is null."""
        return calibration_to_dict(self)

    def to_frame(self) -> "pd.DataFrame":
        """A row for each compliance, SI units.

        Columns: `joint`, `parameter`, `unit`, `k`, `std`, and `low_95` and `high_95`, the ends of
        the 95 % interval about the estimate without the bound k >= 0.
        """
        import pandas as pd

        fit = self.fit
        return pd.DataFrame(
            {
                "joint": self.study.specification.joints.unknown,
                "parameter": self.parameters,
                "unit": self.study.model.units,
                "k": fit.k,
                "std": fit.std,
                "low_95": fit.unbounded - fit.half_interval,
                "high_95": fit.unbounded + fit.half_interval,
            }
        )

    def residuals(self) -> "pd.DataFrame":
        """A row for each measured coordinate.

        `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name.
        """
        return residual_table(self.fitted)

    def sampled(
        self,
        rng: np.random.Generator,
        options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
    ) -> "Calibration":
        """The same calibration with the posterior, under the study's [prior].

        Where measurements alone do not tell every compliance, mean and covariance of the posterior
        take the place of the estimate.

        The noise is that of the [prior], unless the fit was asked for another: sigma is unknown
        (Jeffreys' prior) where it was estimated, and Student-t errors with unknown nu take the
        place of normal ones where the fit is robust.

        Args:
            rng: Source of randomness.
            options: How accurately, and where the chain is kept.

        Raises:
            UserError: The study's prior is not one.
            UnconvergedError: The chain does not converge.
            ImproperPosteriorError: Too few measurements for the unknowns.
            ChainFileError: The file is no chain, or of another problem.
        """
        return with_posterior(self, rng, options)

    def by_joint(self, values: np.ndarray) -> dict[str, float]:
        """Values (p,) by the names of the unknown joints; NaN for one that is not told."""
        of = dict(zip(self.study.specification.joints.unknown, values.tolist(), strict=True))
        return of if self.part is None else of | dict.fromkeys(self.part.stands_for, np.nan)
