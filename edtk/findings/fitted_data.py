"""Measurements with everything that is computed from them once: regressors, fit and plan match."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from edtk.design.plan import Plan
from edtk.findings.causes.family import NOISE, Cause
from edtk.findings.causes.find_causes import FoundCauses, look_for_causes, most_outliers
from edtk.findings.match_plan import EqualRows, PlanMatch, equal_rows, match_plan
from edtk.findings.moving_joints import (
    joint_unit,
    own_of_visits,
    repetitions_agree,
    with_common_noise,
)
from edtk.findings.nonlinear_part import bends_much, known_part
from edtk.findings.readings import Explanation, explanation
from edtk.fit.correlated_noise import CorrelatedNoise, RowNoise
from edtk.fit.equilibrium import LinearisedData, NoFitError, fit_equilibrium, linearise
from edtk.fit.estimate_noise import NoiseEstimate, estimate_noise, visit_residuals
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import Estimate
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import LackOfFit
from edtk.fit.prior import Prior, PriorRows, fit_with_prior
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.pose_table import TURN_COLUMN, coordinate_columns
from edtk.measure.task import all_compliances
from edtk.study.study import Study
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class FittedData:
    """Measurements of a study, their fit, and the plan that they were to carry out.

    Attributes:
        study: The question.
        data: The measurements.
        A: Their regressors (m, rows, p): of the linear model, Eq. (4), or of the loaded equilibrium
            about the estimate.
        measured: Deflections (m, rows) of which A is the model; those of the sheet, or for the
            equilibrium less what is not linear about the estimate [m, rad].
        fit: Estimates and statistics.
        nonlinear: Whether the loaded equilibrium was fitted.
        common_noise: Whether noise that repetitions of a pose share was estimated and taken into
            account. A and measured are then of rows whose errors are independent.
        plan: The plan that was to be carried out; None if it is not known.
        untold: Names of the parameters that the measurements alone do not tell: the estimate rests
            on the prior, too.
        estimated: The noise that was estimated where joints move all markers of a visit; None
            where that of the measurements was believed.
    """

    study: Study
    data: Measurements
    A: Array
    measured: Array
    fit: Identification
    nonlinear: bool = False
    common_noise: bool = False
    plan: Plan | None = None
    untold: tuple[str, ...] = ()
    estimated: CorrelatedNoise | None = None

    @classmethod
    def of(
        cls,
        study: Study,
        data: Measurements,
        plan: Plan | None = None,
        robust: bool = False,
        known: bool = True,
        linear: bool = False,
    ) -> "FittedData":
        """Fit a study's compliances to measurements.

        The linear model is the first order of the loaded equilibrium. Where fitting the equilibrium
        instead moves an estimate by more than a tenth of its standard deviation, it is fitted.

        Args:
            study: The question.
            data: The measurements.
            plan: The plan that was to be carried out.
            robust: Huber's loss instead of squares.
            known: Whether the given sigma is believed, or estimated from the residuals.
            linear: Whether the linear model is fitted in any case.

        Raises:
            SingularPlanError: The measurements do not identify all parameters.
            NothingLeftError: No residuals remain to estimate sigma from.
            SigmaTooSmallError: Robust, and no residual is as small as sigma says.
        """
        A = data.regressor(study.model)
        names = study.model.parameters
        unexplained = data.deflection - known_part(study, data)
        fit = identify(A, unexplained, data.noise, names, robust, known)
        found = cls(study, data, A, unexplained, fit, plan=plan)
        if not linear and bends_much(study, data, A, fit):
            found = found._of_equilibrium()
        return with_common_noise(found)

    @classmethod
    def with_prior(
        cls,
        study: Study,
        data: Measurements,
        prior: Prior,
        untold: tuple[str, ...],
        plan: Plan | None = None,
        robust: bool = False,
        known: bool = True,
        linear: bool = False,
    ) -> "FittedData":
        """Describe measurements that leave compliances open, with a prior that tells them.

        Args:
            study: The question.
            data: The measurements.
            prior: Knowledge of the compliances before them.
            untold: Names of the parameters that the measurements alone do not tell.
            plan: The plan that was to be carried out.
            robust: Whether errors are to have heavy tails in a posterior.
            known: Whether the given sigma is believed.
            linear: Whether the linear model is fitted; otherwise that of the loaded equilibrium
                about the estimate of the linear one.

        Raises:
            SingularPlanError: Prior and measurements together say nothing of a parameter.
        """
        names = study.model.parameters
        A = data.regressor(study.model)
        measured = data.deflection - known_part(study, data)
        found = fit_with_prior(A, measured, data.noise, names, prior)
        bends = False
        if not linear:
            k = all_compliances(study.model, np.maximum(found.k, 0.0), study.known)
            try:
                seen = LinearisedData.of(data, linearise(study.model, data, k))
                found = fit_with_prior(seen.A, seen.measured, data.noise, names, prior)
                A = seen.A
                measured = seen.measured
                bends = True
            except NoEquilibriumError:
                pass  # Such compliances are wrong in any case, which the residuals tell.
        fit = Identification.of_estimate(found, A, measured, data.noise, known, robust)
        return cls(study, data, A, measured, fit, bends, plan=plan, untold=untold)

    def described_by(self, found: Estimate) -> "FittedData":
        """The same measurements with another estimate that rests on the prior, too."""
        fit = Identification.of_estimate(
            found, self.A, self.measured, self.noise, self.fit.known, self.fit.robust
        )
        return replace(self, fit=fit)

    def naming_outliers(self) -> "FittedData":
        """The same with all outliers in the fit: of itself, and beside which causes were found."""
        rows = np.union1d(self.fit.outliers, np.array(self.found_causes.outliers, dtype=int))
        if len(rows) == len(self.fit.outliers):
            return self
        return self.with_outliers(rows)

    def with_outliers(self, rows: Indices) -> "FittedData":
        """The same with these outliers in the fit, on which the causes that were found rest not."""
        same = replace(self, fit=replace(self.fit, outliers=rows))
        vars(same)["found_causes"] = self.found_causes
        return same

    def _of_equilibrium(self) -> "FittedData":
        """The same measurements with the loaded equilibrium fitted."""
        fit = self.fit
        robust = fit.robust or fit.too_few_for_robust
        try:
            seen, again = fit_equilibrium(
                self.study.model, self.data, self._complete, robust, fit.known
            )
        except (NoEquilibriumError, NoFitError):
            # Such compliances are wrong in any case: the residuals of the linear fit tell why.
            return self
        return replace(self, A=seen.A, measured=seen.measured, fit=again, nonlinear=True)

    @cached_property
    def noise_estimate(self) -> NoiseEstimate | None:
        """Errors of tracker, joints and model, by what visits share; None if not to be told.

        Readings that are off by themselves have no part in it.
        """
        if self.untold:
            return None
        data, linear = self.others
        own = own_of_visits(self.study, data)
        seen = visit_residuals(
            self.study.model, data, linear.A, linear.measured, joint_unit(self.study), own
        )
        return None if seen is None else estimate_noise(seen)

    @property
    def noise(self) -> RowNoise:
        """The noise of A and measured."""
        return self.data.noise if self.estimated is None else self.estimated

    @property
    def _complete(self) -> Array:
        """Compliances (n,) of all joints, zero for those that count as rigid [rad/(N m)]."""
        return all_compliances(self.study.model, self.fit.unbounded, self.study.known)

    @cached_property
    def found_causes(self) -> FoundCauses:
        """Faults that explain the residuals, and readings that are off by themselves."""
        return look_for_causes(self)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Faults that explain the residuals, the likeliest first; empty where noise does."""
        return self.found_causes.named

    @cached_property
    def prior(self) -> Prior | None:
        """The study's [prior]; None where it says nothing, or cannot be read.

        Only a posterior needs one: its file may still be to be written.
        """
        try:
            prior = study_prior(self.study)
        except UserError:
            return None
        return None if prior.is_flat else prior

    @cached_property
    def told_before(self) -> PriorRows | None:
        """What the [prior] says of the size of compliances; None if it says nothing."""
        if self.prior is None:
            return None
        found = PriorRows.near(self.prior, self.fit.k)
        if self.untold:
            found = found.with_weak(self.prior)
        return found if len(found) else None

    @property
    def structural_causes(self) -> tuple[Cause, ...]:
        """The causes without that of a noise of another size."""
        return tuple(cause for cause in self.causes if cause.cause != NOISE)

    @cached_property
    def linear_regressor(self) -> Array:
        """Regressors (m, rows, p) of the linear model, Eq. (4); A itself where that was fitted."""
        if self.nonlinear or self.common_noise:
            return self.data.regressor(self.study.model)
        return self.A

    @cached_property
    def lack_of_fit(self) -> LackOfFit | None:
        """Whether repetitions agree better with each other than with the model."""
        return repetitions_agree(self)

    @property
    def others(self) -> tuple[Measurements, LinearisedData]:
        """The measurements that are not off by themselves, and their linear model."""
        off = {*self.found_causes.outliers, *self.fit.outliers.tolist()}
        if not off or len(off) > most_outliers(len(self.data)):
            return self.data, LinearisedData(self.A, self.measured)
        rows = np.delete(np.arange(len(self.data)), list(off))
        return self.data[rows], LinearisedData(self.A[rows], self.measured[rows])

    @property
    def as_linear(self) -> Array:
        """Deflections (m, rows) less what the equilibrium adds to the linear model [m, rad]."""
        return self.fit.residual + self.linear_regressor @ self.fit.unbounded

    @cached_property
    def unexplained(self) -> Array:
        """Displacements (m, rows) that are left to the unknown compliances [m, rad]."""
        return self.data.deflection - known_part(self.study, self.data)

    @cached_property
    def match(self) -> PlanMatch | None:
        """Which experiment of the plan each measurement is one of; None without a plan."""
        return None if self.plan is None else match_plan(self.study, self.data, self.plan)

    @cached_property
    def explanation(self) -> Explanation | None:
        """Other readings of the columns that explain a misfit; None where nothing is to explain."""
        if self.untold:
            return None
        return explanation(self.study, self.data, self.fit)

    @cached_property
    def equal_rows(self) -> EqualRows | None:
        """Rows that are the same to the last digit; None where all are different."""
        return equal_rows(self.data)


def residual_table(fitted: FittedData) -> "pd.DataFrame":
    """A row for each measured coordinate.

    `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name.
    """
    import pandas as pd

    fit = fitted.fit
    m, rows = fit.residual.shape
    units = np.where(fitted.data.lengths, 1e3, 180 / np.pi)
    columns = np.tile(coordinate_columns(rows), (m, 1)).astype(object)
    if fitted.data.turn is not None:
        columns[fitted.data.turn] = TURN_COLUMN
    return pd.DataFrame(
        {
            "row": np.repeat(np.arange(1, m + 1), rows),
            "pose": np.repeat(fitted.data.pose + 1, rows),
            "coordinate": columns.ravel(),
            "residual": (fit.residual * units).ravel(),
            "leverage": fit.leverage.ravel(),
            "standardised": fit.standardised.ravel(),
        }
    )
