"""Identified compliances, with everything that a person wants to know about them."""

import hashlib
from abc import abstractmethod
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.extension import Extension
from edtk.calibration.posterior_check import PosteriorCheck, check_posterior
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
from edtk.findings.finding import Finding, verdict, worst_first
from edtk.findings.fitted_data import FittedData, residual_table
from edtk.findings.prior import posterior_findings
from edtk.findings.springs import spring_findings
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.identify import Identification
from edtk.fit.least_squares import Estimate
from edtk.fit.measurements import Measurements
from edtk.fit.noise import Noise
from edtk.fit.outliers import LackOfFit
from edtk.fit.posterior import Posterior, SamplingOptions
from edtk.measure.expected_error import ErrorBudget, ExpectedError, TaskAccuracy, expected_error
from edtk.measure.pose_table import Table
from edtk.measure.task import Tasks
from edtk.study.evaluate import accuracy_of_tasks
from edtk.study.study import Study
from edtk.study.study_parts import study_prior
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Origin:
    """The file of the measurements as it was read.

    Attributes:
        sha256: Of the file, in hex digits; empty for a pipe, which cannot be read twice, and for a
            data frame.
        changed: When the file was changed last, "2026-11-22 09:16:27 UTC"; empty likewise. A
            report has this instead of its own date, so that the same run writes the same bytes.
    """

    sha256: str = ""
    changed: str = ""

    @classmethod
    def of(cls, path: Table) -> "Origin":
        """Look at a file that has just been read.

        Args:
            path: The file, or a pipe; or a data frame, which has no file.
        """
        if not isinstance(path, str | Path) or not Path(path).is_file():
            return cls()
        with Path(path).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        seconds = int(Path(path).stat().st_mtime)
        changed = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC"
        return cls(digest, changed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged(Presented):
    """What a calibration found, whatever its parameters are, and whether to trust it.

    Attributes:
        findings: Everything that looks wrong, the worst first.
        path: Where the measurements are.
        origin: The file as it was read.
        check: The posterior; None where it was not sampled.
        extension: The models of which this is the likeliest; None where nobody asked for them.
    """

    findings: tuple[Finding, ...]
    path: Path
    origin: Origin = Origin()
    check: PosteriorCheck | None = None
    extension: Extension | None = None

    @property
    @abstractmethod
    def study(self) -> Study:
        """The question."""

    @property
    def asked(self) -> Study:
        """The question as it was given."""
        return self.study

    @property
    @abstractmethod
    def k(self) -> dict[str, float]:
        """Compliances by joint [rad/(N m), or m/N of a prismatic joint]."""

    @property
    @abstractmethod
    def covariance(self) -> Array:
        """Covariance of the parameters by the noise, in the order of `in_tasks`."""

    @property
    @abstractmethod
    def in_tasks(self) -> Tasks:
        """The study's tasks, in which errors of the identified parameters do harm."""

    @property
    @abstractmethod
    def tasks(self) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None for one or none."""

    @property
    @abstractmethod
    def measured_poses(self) -> MeasuredPoses:
        """The poses of the sheet, with the distances of their readings from the fit."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; a number that is not known is null."""

    @abstractmethod
    def residuals(self) -> "pd.DataFrame":
        """The residuals, a row for each reading, or for each of its coordinates."""

    @cached_property
    def expected(self) -> ExpectedError | None:
        """Errors to expect in the tasks and around them; None without tasks."""
        return expected_error(self.in_tasks, self.covariance) if self.in_tasks else None

    @property
    def verdict(self) -> str:
        """Whether to use the result: "good", "usable" or "bad".

        It is never better than the worst finding, and not good where the study says what is hard
        to believe.
        """
        return verdict([*self.study.warnings, *self.findings])

    @property
    def posterior(self) -> Posterior | None:
        """The sampled posterior of the parameters; None where it was not sampled."""
        return None if self.check is None else self.check.posterior

    def judgement(self) -> dict[str, Any]:
        """Verdict, findings, posterior and what was known before, for JSON."""
        known = self.study.specification.joints.known
        return {
            "verdict": self.verdict,
            "doubts": [one.words for one in self.findings],
            "study_warnings": [one.words for one in self.study.warnings],
            "diagnostics": [one.to_dict() for one in self.findings],
            "known": {name: one.value for name, one in known.items()},
            "posterior": None if self.check is None else self.check.to_dict(),
            **({} if self.extension is None else {"extension": self.extension.to_dict()}),
        }


def calibration_to_dict(found: "Calibration") -> dict[str, Any]:
    """Plain numbers, SI, for JSON; a number that is not known is null."""
    fit = found.fit
    joints = found.study.specification.joints
    return {
        "k": _known(found.k),
        "std": _known(found.std),
        "correlation": fit.correlation.tolist(),
        "covariance_dof": fit.covariance_dof if np.isfinite(fit.covariance_dof) else None,
        "sigma_hat": found.sigma_hat if np.isfinite(fit.scale) else None,
        "chi2": fit.chi2,
        "dof": fit.dof,
        "p_value": fit.p_value,
        "outliers": (fit.outliers + 1).tolist(),
        **_left_out(found),
        "rho0": _rho0(found),
        "rho0_bias": found.rho0_bias,
        "model": "nonlinear" if found.fitted.nonlinear else "linear",
        "budget_mm": None if found.budget is None else found.budget.to_dict(),
        "model_error_mm": None if found.budget is None else 1e3 * found.budget.model,
        **_all_uncertain(found),
        "lack_of_fit": None if found.lack_of_fit is None else found.lack_of_fit.to_dict(),
        "noise": None if found.noise is None else found.noise.to_dict(),
        "causes": [cause.to_dict() for cause in found.causes],
        "expected_error": None if found.expected is None else found.expected.to_dict(),
        **({} if found.tasks is None else {"tasks": found.tasks.to_dict()}),
        **found.judgement(),
        "negative": [joints.unknown[i] for i in np.flatnonzero(fit.negative)],
        "k_unbounded": _known(found.by_joint(fit.unbounded)),
        "k_bias": None if found.bias is None else _known(found.by_joint(found.bias)),
        **_of_interest(found),
        "prediction": springs_to_dict(found.springs, found.study.robot),
        **_model_error(found),
        "poses": found.measured_poses.to_list(),
    }


def _model_error(found: "Calibration") -> dict[str, Any]:
    """What the model leaves out, and the springs that are possible with it."""
    left, error = found.propagation.model, found.fitted.model_error
    if left is None or error is None:
        return {}
    return {"model_error": error.to_dict(), "possible_springs": left.to_dict()}


def _left_out(found: "Calibration") -> dict[str, float | None]:
    """How well each pose is predicted without it; null where nothing tells."""
    out = found.fitted.left_out
    sizes = {
        "loo_rms_mm": np.nan if out is None else 1e3 * out.rms,
        "share_inside_left_out": np.nan if out is None else out.share_with_model,
    }
    if not found.data.lengths.all():
        sizes["turn_loo_rms_deg"] = np.nan if out is None else float(np.rad2deg(out.turn_rms))
    return _known(sizes)


def _all_uncertain(found: "Calibration") -> dict[str, Any]:
    """All that commands may be off by; null without a task."""
    if found.budget is None:
        return {"covariance_measured": None, "assumed_joints": None, "covariance_all": None}
    unknown = found.study.specification.joints.unknown
    parts = {one.joint.name: one.to_dict() for one in found.budget.joints}
    errors = found.propagation.errors
    return {
        "covariance_measured": found.propagation.measured.tolist(),
        "assumed_joints": [
            parts[one.joint.name]
            | {"shifts_rad_per_Nm": dict(zip(unknown, one.shifts.tolist(), strict=True))}
            for one in errors
        ],
        "covariance_all": found.propagation.covariance.tolist(),
    }


def _rho0(found: "Calibration") -> dict[str, Any] | None:
    """The accuracy in the task with its interval; None without a task."""
    if found.study.target is None:
        return None
    value, interval = found.fitted.noise_fit.accuracy(found.study.target)
    return {"value": value, "interval95": list(interval)}


def _of_interest(found: "Calibration") -> dict[str, Any]:
    """What the measurements tell, and what is of interest where the study says so."""
    part = found.part
    told = {
        "rank": len(found.fit.k),
        "open": [] if part is None else list(part.words),
        "not_told": [] if part is None else list(part.open),
    }
    if found.asked.interest is None:
        return told
    values = {name: {"value": k, "std": std} for name, (k, std) in found.interest.items()}
    return {"interest": values, **told}


def _known(values: dict[str, float]) -> dict[str, float | None]:
    """The same, with None for no number, as JSON has it."""
    return {name: None if np.isnan(value) else value for name, value in values.items()}


def _noise(found: "Calibration") -> Noise:
    """The noise that a posterior assumes beside a fit."""
    noise = found.study.specification.prior.noise()
    if not found.fit.known:
        noise = replace(noise, sigma_factor=np.inf)
    if found.fit.robust and noise.normal:
        noise = replace(noise, nu=None)
    return noise


@dataclass(frozen=True, eq=False)
class Calibration(Judged):
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

        `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name, and of
        `left_out`, the error of a fit without the pose.
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
        fitted = self.fitted
        fit = self.fit
        noise = _noise(self)
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

    def by_joint(self, values: np.ndarray) -> dict[str, float]:
        """Values (p,) by the names of the unknown joints; NaN for one that is not told."""
        of = dict(zip(self.study.specification.joints.unknown, values.tolist(), strict=True))
        return of if self.part is None else of | dict.fromkeys(self.part.stands_for, np.nan)
