"""Identified compliances, with everything that a person wants to know about them."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.calibration.posterior_check import check_posterior
from edtk.calibration.propagation import (
    FittedSprings,
    Propagation,
    calibration_budget,
    propagation_of,
)
from edtk.calibration.result_file import MeasuredPoses, springs_to_dict
from edtk.calibration.told_part import ToldPart, interest_estimates
from edtk.design.plan import Plan
from edtk.findings.causes.family import Cause
from edtk.findings.causes.faults import cause_of
from edtk.findings.finding import worst_first
from edtk.findings.fitted_data import FittedData
from edtk.findings.prior import posterior_findings
from edtk.findings.springs import spring_findings
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.identify import Identification
from edtk.fit.least_squares import Estimate
from edtk.fit.measurements import Measurements
from edtk.fit.noise import Noise
from edtk.fit.outliers import LackOfFit
from edtk.fit.posterior import SamplingOptions
from edtk.measure.expected_error import ErrorBudget, TaskAccuracy
from edtk.measure.pose_table import TURN_COLUMN, coordinate_columns
from edtk.measure.task import Tasks
from edtk.study.evaluate import accuracy_of_tasks
from edtk.study.study import Study
from edtk.study.study_parts import study_prior
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class SpringCalibration(Calibration):
    """Identified compliances, and whether to trust them.

    Attributes:
        fitted: The study, its measurements, and the fit.
        bias: By how far the linear model makes the compliances (p,) too large, to the first order
            [rad/(N m)]; zero where the loaded equilibrium was fitted, None if it is unknown.
        budget: The error to expect in the task, in parts; None without a test pose.
        part: What the measurements tell, where they leave compliances open that are not of
            interest; None where they tell all.
    """

    fitted: FittedData
    bias: Array | None = None
    budget: ErrorBudget | None = None
    part: ToldPart | None = None

    def headline(self) -> str:
        """Number of measurements, the accuracy to expect, and the verdict."""
        rows = f"{len(self.data)} measurements of {self.data.pose.max() + 1} poses"
        accuracy = ""
        if self.study.target is not None:
            accuracy = (
                f", rho0 = {1e3 * self.fitted.noise_fit.accuracy(self.study.target)[0]:.4g} mm"
            )
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
        misread = (cause_of(one) for one in self.findings)
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
    def covariance(self) -> Array:
        """Covariance (p, p) of the compliances by the noise."""
        return self.fitted.noise_covariance

    @property
    def in_tasks(self) -> Tasks:
        """The study's test poses."""
        return self.study.tasks

    @cached_property
    def tasks(self) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None for one or none.

        Where there is a budget, they have the total of all its parts, too.
        """
        fit = self.fit
        found = accuracy_of_tasks(self.study, self.covariance, fit.k, fit.covariance_dof)
        if found is None or self.budget is None:
            return found
        bias = np.zeros(len(fit.k)) if self.bias is None else self.bias
        left = np.array([float(np.linalg.norm(task.target @ bias)) for task in self.in_tasks])
        return replace(found, total=self.propagation.totals(self.in_tasks, left))

    @cached_property
    def propagation(self) -> Propagation:
        """How all that is uncertain moves the compliances that commands rest on."""
        return propagation_of(self.fitted)

    @property
    def measured_poses(self) -> MeasuredPoses:
        """The poses of the sheet, with the distances of their readings from the fit."""
        data = self.data
        first = np.unique(data.pose, return_index=True)[1]
        plan = Plan(data.q[first], data.wrench[first], np.bincount(data.pose))
        square = np.where(data.lengths, np.square(self.fit.residual), 0.0).sum(axis=1)
        return MeasuredPoses.of(
            plan, data.pose, np.where(data.lengths.any(axis=1), square, np.nan)[:, None]
        )

    @property
    def springs(self) -> FittedSprings:
        """What predictions need."""
        rigid = () if self.part is None else self.part.rigid
        return FittedSprings.of(self.fitted, self.propagation, rigid)

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
        fit = self.fit
        joints = self.study.specification.joints
        return {
            "k": _known(self.k),
            "std": _known(self.std),
            "correlation": fit.correlation.tolist(),
            "covariance_dof": fit.covariance_dof if np.isfinite(fit.covariance_dof) else None,
            "sigma_hat": self.sigma_hat if np.isfinite(fit.scale) else None,
            "chi2": fit.chi2,
            "dof": fit.dof,
            "p_value": fit.p_value,
            "outliers": (fit.outliers + 1).tolist(),
            **self._left_out(),
            "rho0": self._rho0(),
            "rho0_bias": self.rho0_bias,
            "model": "nonlinear" if self.fitted.nonlinear else "linear",
            "budget_mm": None if self.budget is None else self.budget.to_dict(),
            "model_error_mm": None if self.budget is None else 1e3 * self.budget.model,
            **self._all_uncertain(),
            "lack_of_fit": None if self.lack_of_fit is None else self.lack_of_fit.to_dict(),
            "noise": None if self.noise is None else self.noise.to_dict(),
            "causes": [cause.to_dict() for cause in self.causes],
            "expected_error": None if self.expected is None else self.expected.to_dict(),
            **({} if self.tasks is None else {"tasks": self.tasks.to_dict()}),
            **self.judgement(),
            "negative": [joints.unknown[i] for i in np.flatnonzero(fit.negative)],
            "k_unbounded": _known(self.by_joint(fit.unbounded)),
            "k_bias": None if self.bias is None else _known(self.by_joint(self.bias)),
            **self._of_interest(),
            "prediction": springs_to_dict(self.springs, self.study.robot),
            **self._model_error(),
            "poses": self.measured_poses.to_list(),
        }

    def _model_error(self) -> dict[str, Any]:
        """What the model leaves out, and the springs that are possible with it."""
        left, error = self.propagation.model, self.fitted.model_error
        if left is None or error is None:
            return {}
        return {"model_error": error.to_dict(), "possible_springs": left.to_dict()}

    def _left_out(self) -> dict[str, float | None]:
        """How well each pose is predicted without it; null where nothing tells."""
        out = self.fitted.left_out
        sizes = {
            "loo_rms_mm": np.nan if out is None else 1e3 * out.rms,
            "share_inside_left_out": np.nan if out is None else out.share_with_model,
        }
        if not self.data.lengths.all():
            sizes["turn_loo_rms_deg"] = np.nan if out is None else float(np.rad2deg(out.turn_rms))
        return _known(sizes)

    def _all_uncertain(self) -> dict[str, Any]:
        """All that commands may be off by; null without a task."""
        if self.budget is None:
            return {"covariance_measured": None, "assumed_joints": None, "covariance_all": None}
        unknown = self.study.specification.joints.unknown
        parts = {one.joint.name: one.to_dict() for one in self.budget.joints}
        errors = self.propagation.errors
        return {
            "covariance_measured": self.propagation.measured.tolist(),
            "assumed_joints": [
                parts[one.joint.name]
                | {"shifts_rad_per_Nm": dict(zip(unknown, one.shifts.tolist(), strict=True))}
                for one in errors
            ],
            "covariance_all": self.propagation.covariance.tolist(),
        }

    def _rho0(self) -> dict[str, Any] | None:
        """The accuracy in the task with its interval; None without a task."""
        if self.study.target is None:
            return None
        value, interval = self.fitted.noise_fit.accuracy(self.study.target)
        return {"value": value, "interval95": list(interval)}

    def _of_interest(self) -> dict[str, Any]:
        """What the measurements tell, and what is of interest where the study says so."""
        part = self.part
        told = {
            "rank": len(self.fit.k),
            "open": [] if part is None else list(part.words),
            "not_told": [] if part is None else list(part.open),
        }
        if self.asked.interest is None:
            return told
        values = {name: {"value": k, "std": std} for name, (k, std) in self.interest.items()}
        return {"interest": values, **told}

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

        `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name, and of
        `left_out`, the error of a fit without the pose.
        """
        import pandas as pd

        fit = self.fit
        m, rows = fit.residual.shape
        units = np.where(self.data.lengths, 1e3, 180 / np.pi)
        out = self.fitted.left_out
        left_out = np.full((m, rows), np.nan) if out is None else out.errors
        columns = np.tile(coordinate_columns(rows), (m, 1)).astype(object)
        if self.data.turn is not None:
            columns[self.data.turn] = TURN_COLUMN
        return pd.DataFrame(
            {
                "row": np.repeat(np.arange(1, m + 1), rows),
                "pose": np.repeat(self.data.pose + 1, rows),
                "coordinate": columns.ravel(),
                "residual": (fit.residual * units).ravel(),
                "leverage": fit.leverage.ravel(),
                "standardised": fit.standardised.ravel(),
                "left_out": (left_out * units).ravel(),
            }
        )

    def sampled(
        self,
        rng: np.random.Generator,
        options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
    ) -> "SpringCalibration":
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
        fitted = self.fitted
        fit = self.fit
        noise = self._noise()
        check = check_posterior(
            self.study,
            fitted.A,
            fitted.measured,
            fitted.noise,
            Estimate(fit.k, fit.covariance),
            rng,
            noise=noise,
            options=options,
        )
        prior = study_prior(self.study)
        estimated = prior.is_flat and noise.normal and not fit.known and not fit.robust
        budget = self.budget
        named = self.findings
        if fitted.untold:
            names = self.study.model.parameters
            posterior = Estimate(check.posterior.mean, check.posterior.covariance, names)
            fitted = fitted.described_by(posterior)
            budget = calibration_budget(fitted, None)
            named = spring_findings(fitted, None, budget)
        added = posterior_findings(fitted, prior, check.posterior)
        rest = (one for one in named if one.kind != "prior_contradicted")
        return replace(
            self,
            fitted=fitted,
            budget=budget,
            findings=worst_first([*added, *rest]),
            check=replace(check, sigma_estimated=estimated),
        )

    def _noise(self) -> Noise:
        """The noise that a posterior assumes beside a fit."""
        noise = self.study.specification.prior.noise()
        if not self.fit.known:
            noise = replace(noise, sigma_factor=np.inf)
        if self.fit.robust and noise.normal:
            noise = replace(noise, nu=None)
        return noise

    def by_joint(self, values: np.ndarray) -> dict[str, float]:
        """Values (p,) by the names of the unknown joints; NaN for one that is not told."""
        of = dict(zip(self.study.specification.joints.unknown, values.tolist(), strict=True))
        return of if self.part is None else of | dict.fromkeys(self.part.stands_for, np.nan)


def _known(values: dict[str, float]) -> dict[str, float | None]:
    """The same, with None for no number, as JSON has it."""
    return {name: None if np.isnan(value) else value for name, value in values.items()}
