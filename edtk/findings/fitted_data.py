"""Measurements with everything that is computed from them once: regressors, fit and plan match."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.design.plan import Plan
from edtk.findings.causes.evidence import USUAL_SHARE
from edtk.findings.causes.family import NOISE, Cause
from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.find_causes import (
    MOST_SEARCHED,
    FoundCauses,
    find_causes,
    most_outliers,
)
from edtk.findings.left_out import LeftOutReadings
from edtk.findings.match_plan import EqualRows, PlanMatch, equal_rows, match_plan, some_rows
from edtk.findings.model_error import ModelErrorFound, find_model_error
from edtk.findings.moving_joints import (
    ReadingNoise,
    asked_of_sheets,
    estimated_noise,
    joint_unit,
    moving_joints,
    own_of_visits,
    shared_by_repetitions,
    sizes_beside,
    visits_lack_of_fit,
)
from edtk.findings.nonlinear_part import bends_much, known_part
from edtk.findings.readings import Explanation, explanation
from edtk.fit.correlated_noise import (
    CorrelatedNoise,
    RowNoise,
    scaled,
    whiten,
    whiten_columns,
)
from edtk.fit.distributions import chi_square_tail
from edtk.fit.equilibrium import (
    LinearisedData,
    NoFitError,
    fit_common_noise,
    fit_equilibrium,
    linearise,
)
from edtk.fit.estimate_noise import NoiseEstimate, estimate_noise, visit_residuals
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import Estimate, SingularPlanError, Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import LackOfFit, lack_of_fit
from edtk.fit.prior import Prior, PriorRows, fit_with_prior
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.task import all_compliances
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

OUTLIER_ROUNDS = 4  # of finding outliers; two are the rule


@dataclass(frozen=True, eq=False)
class HowFitted:
    """How a sheet is fitted: the options of `edtk.identify`, from the verb to whatever uses one.

    Both kinds of calibration pass it on as it is; a new option is a field here.

    Attributes:
        robust: Huber's loss instead of squares; of positions, poses that fit badly count less.
        sigma_unknown: Whether the size of the noise is estimated from the residuals; of positions,
            where repeats do not tell it.
        linear: Whether the linear model is fitted in any case.
        as_is: Whether a sheet that is certainly wrong is fitted all the same.
        plan: The plan that was to be carried out; None if it is not known.
        extended: Whether pieces beside ideal springs are looked for, and the likeliest model is
            fitted.
        sampled: Whether the posterior is to be sampled. Then the [prior] of a study may tell
            compliances that measurements alone do not.
    """

    robust: bool = False
    sigma_unknown: bool = False
    linear: bool = False
    as_is: bool = False
    plan: Plan | None = None
    extended: bool = False
    sampled: bool = False


AS_USUAL = HowFitted()


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
        how: How they were to be fitted.
        untold: Names of the parameters that the measurements alone do not tell: the estimate rests
            on the prior, too.
        estimated: The noise that was estimated where joints move all markers of a visit; None
            where that of the measurements was believed.
        model_error: What the sheet says of all that the model leaves out; None where the study says
            that it is exact, or the sheet cannot tell.
    """

    study: Study
    data: Measurements
    A: Array
    measured: Array
    fit: Identification
    nonlinear: bool = False
    common_noise: bool = False
    how: HowFitted = AS_USUAL
    untold: tuple[str, ...] = ()
    estimated: CorrelatedNoise | None = None
    model_error: ModelErrorFound | None = None

    @classmethod
    def of(cls, study: Study, data: Measurements, how: HowFitted = AS_USUAL) -> "FittedData":
        """Fit a study's compliances to measurements.

        The linear model is the first order of the loaded equilibrium. Where fitting the equilibrium
        instead moves an estimate by more than a tenth of its standard deviation, it is fitted.

        Args:
            study: The question.
            data: The measurements.
            how: How they are fitted.

        Raises:
            SingularPlanError: The measurements do not identify all parameters.
            NothingLeftError: No residuals remain to estimate sigma from.
            SigmaTooSmallError: Robust, and no residual is as small as sigma says.
        """
        A = data.regressor(study.model)
        names = study.model.parameters
        unexplained = data.deflection - known_part(study, data)
        fit = identify(A, unexplained, data.noise, names, how.robust, not how.sigma_unknown)
        found = cls(study, data, A, unexplained, fit, how=how)
        if not how.linear and bends_much(study, data, A, fit):
            found = found._of_equilibrium()
        return found._with_common_noise()._with_model_error(found)

    @classmethod
    def with_prior(
        cls,
        study: Study,
        data: Measurements,
        prior: Prior,
        untold: tuple[str, ...],
        how: HowFitted = AS_USUAL,
    ) -> "FittedData":
        """Describe measurements that leave compliances open, with a prior that tells them.

        Args:
            study: The question.
            data: The measurements.
            prior: Knowledge of the compliances before them.
            untold: Names of the parameters that the measurements alone do not tell.
            how: How they are fitted: where not by the linear model, by that of the loaded
                equilibrium about its estimate; robust where errors are to have heavy tails in a
                posterior.

        Raises:
            SingularPlanError: Prior and measurements together say nothing of a parameter.
        """
        names = study.model.parameters
        A = data.regressor(study.model)
        measured = data.deflection - known_part(study, data)
        found = fit_with_prior(A, measured, data.noise, names, prior)
        bends = False
        if not how.linear:
            k = all_compliances(study.model, np.maximum(found.k, 0.0), study.known)
            try:
                seen = LinearisedData.of(data, linearise(study.model, data, k))
                found = fit_with_prior(seen.A, seen.measured, data.noise, names, prior)
                A = seen.A
                measured = seen.measured
                bends = True
            except NoEquilibriumError:
                pass  # Such compliances are wrong in any case, which the residuals tell.
        known = not how.sigma_unknown
        fit = Identification.of_estimate(found, A, measured, data.noise, known, how.robust)
        return cls(study, data, A, measured, fit, bends, how=how, untold=untold)

    def described_by(self, found: Estimate) -> "FittedData":
        """The same measurements with another estimate that rests on the prior, too."""
        fit = Identification.of_estimate(
            found, self.A, self.measured, self.noise, self.fit.known, self.fit.robust
        )
        return replace(self, fit=fit)

    def naming_outliers(self) -> "FittedData":
        """The same with all outliers in the fit.

        They are those of itself and those beside which causes were found; where no cause was, those
        that stand out beyond what the model leaves out.
        """
        beyond = None if self.model_error is None else self.model_error.beyond
        rows = np.union1d(self.fit.outliers, np.array(self.found_causes.outliers, dtype=int))
        if beyond is not None:
            rows = np.array(beyond, dtype=int)
        return self if np.array_equal(rows, self.fit.outliers) else self.with_outliers(rows)

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

    def _with_common_noise(self) -> "FittedData":
        """The same with the noise that repetitions or visits share, where no fault explains it.

        Outliers are told by the noise, and the noise by rows that are none: each is found anew with
        the other one until they agree.
        """
        asked = asked_of_sheets(self.study)
        if self.fit.robust or (self.data.tracker is not None and not asked):
            return self  # the study says what visits share
        known = self
        for _ in range(OUTLIER_ROUNDS):
            found = known._with_noise_of_rows()
            if np.array_equal(found.fit.outliers, known.fit.outliers):
                return found
            known = self.with_outliers(found.fit.outliers)
        return found

    def _with_noise_of_rows(self) -> "FittedData":
        """The same with shared noise as rows have it that are no outliers so far."""
        data = self.data
        found = self.noise_estimate
        test = self.lack_of_fit
        shared = (test is not None and test.seen) or (found is not None and found.moves)
        if asked_of_sheets(self.study):
            shared = found is not None
        if not shared or self.structural_causes:
            return self
        seen = LinearisedData(self.A, self.measured)
        again = None
        if found is not None:
            again = moving_joints(self.study, data, seen, found, self.fit)
        elif test is not None and data.covariance is not None:
            again = shared_by_repetitions(data, seen, test, self.fit)
        elif test is not None:
            seen, fit = fit_common_noise(seen, data.sigma, data.places, test, self.fit)
            return replace(self, A=seen.A, measured=seen.measured, fit=fit, common_noise=True)
        if again is None:
            return self
        return replace(self, fit=again[1], common_noise=True, estimated=again[0])

    def _with_model_error(self, alone: "FittedData") -> "FittedData":
        """The same with what the sheet says of all that the model leaves out.

        The estimate stays that of least squares: a spring that takes up a part of what is missing
        serves a task better than its true compliance would. Where the sheet speaks for something
        that is missing, the covariance is that of the true compliances about it.

        Args:
            alone: The fit with the noise of the readings alone.
        """
        if self.untold or self.how.linear:
            return self  # what bends is no error of a linear model that was asked for
        seen = LinearisedData(alone.A, alone.measured)
        every = np.arange(len(self.data))
        rows, most = self._sound_rows, 0
        nothing = self.found_causes.unexplained and self.found_causes.possible is None
        first = next(iter(self.structural_causes), None)
        if nothing and len(self.data) <= MOST_SEARCHED:
            # Rows that are outliers beside the noise alone may as well be the model's. A cause that
            # explains much, and not all, is no error of poses: rows may stand out for want of it.
            rows, most = every, most_outliers(len(self.data))
        elif first is not None and FAULTS[first.cause].in_tasks:
            # So they are where the robot itself is the cause, but for those that are off beside it.
            rows = np.delete(every, list(self.found_causes.outliers))
        given = (self._readings_alone, rows, self._constant_error, most)
        found = find_model_error(self.study, self.data, seen, (alone.fit, self.fit), *given)
        if found is None:
            return self
        fit = self.fit
        if found.counts:
            dof = np.inf if fit.known else fit.covariance_dof
            spread = found.possible.spread(len(fit.k))
            fit = replace(fit, covariance=spread, covariance_dof=dof)
        same = replace(self, fit=fit, model_error=found)
        # What was found of the residuals before took its time, and stays.
        kept = ("found_causes", "noise_estimate", "lack_of_fit", "explanation")
        vars(same).update({name: value for name, value in vars(self).items() if name in kept})
        return same

    @cached_property
    def left_out(self) -> LeftOutReadings | None:
        """Readings as all other poses predict them; None where the estimate rests on a prior."""
        fit, data = self.fit, self.data
        if self.untold:
            return None
        size = 1.0 if fit.known or self.common_noise else fit.scale
        own = (self.noise, size)
        raw = self.A
        if self.common_noise and self.estimated is None:
            # A and measured are of rows without what repetitions share.
            test = self.lack_of_fit
            alone = 1.0 if test is None else float(np.hypot(test.pure_error, test.common))
            own = (data.noise, alone)
            raw = self.linear_regressor
        rows = (LinearisedData(self.A, self.measured), self.noise)
        scaled = not fit.known or self.common_noise
        return LeftOutReadings.of(data, fit, rows, size, own, raw, scaled, self.model_error)

    @cached_property
    def noise_estimate(self) -> NoiseEstimate | None:
        """Errors of tracker, joints and model, by what visits share; None if not to be told.

        Readings that are off by themselves have no part in it.
        """
        if self.untold:
            return None
        data, linear = self.others
        own = own_of_visits(self.study, data)
        stated = sizes_beside(self.study)
        seen = visit_residuals(
            self.study.model, data, linear.A, linear.measured, joint_unit(self.study), own
        )
        return None if seen is None else estimate_noise(seen, stated)

    @property
    def reading_noise(self) -> ReadingNoise:
        """By how much a further reading scatters."""
        if not self.common_noise:
            return ReadingNoise(1.0 if self.fit.known else self.fit.scale)
        found = self.noise_estimate
        # What repetitions share is no scatter of a reading where the model's errors count.
        own = self.model_error is None
        if found is not None and self.estimated is not None:
            return ReadingNoise(found.tracker, (found.joints, found.discrepancy))
        test = self.lack_of_fit
        if test is None:
            return ReadingNoise()
        return ReadingNoise(float(np.hypot(test.pure_error, test.common if own else 0.0)))

    @property
    def _readings_alone(self) -> RowNoise:
        """The noise of the readings, without what repetitions of a pose share.

        Where several markers tell a discrepancy by motions that no arm makes, it is a part of it.

        Raises:
            NotPositiveDefiniteError: The tracker errs next to nothing beside the joints.
        """
        data = self.data
        found = self.noise_estimate
        test = self.lack_of_fit
        if not self.common_noise:
            return scaled(data.noise, 1.0 if self.fit.known else self.fit.scale)
        if found is not None and self.estimated is not None:
            return estimated_noise(self.study, data, found, found.discrepancy)
        return scaled(data.noise, 1.0 if test is None else test.pure_error)

    @property
    def _constant_error(self) -> float:
        """Discrepancy of a coordinate, the same in all poses, as stated or estimated [m]."""
        found = self.noise_estimate
        if self.estimated is not None and found is not None:
            return found.discrepancy
        noise = self.study.noise
        return 0.0 if noise is None else float(noise.discrepancy.max())

    @property
    def plan(self) -> Plan | None:
        """The plan that was to be carried out; None if it is not known."""
        return self.how.plan

    @property
    def noise(self) -> RowNoise:
        """The noise of A and measured."""
        return self.data.noise if self.estimated is None else self.estimated

    @property
    def noise_covariance(self) -> Array:
        """Covariance (p, p) of the estimates by the noise alone, without errors of the model."""
        found = self.model_error
        return self.fit.covariance if found is None or not found.counts else found.noise

    @property
    def noise_fit(self) -> Identification:
        """The fit with the covariance by the noise alone, which rho0 is of."""
        return replace(self.fit, covariance=self.noise_covariance)

    @property
    def _complete(self) -> Array:
        """Compliances (n,) of all joints, zero for those that count as rigid [rad/(N m)]."""
        return all_compliances(self.study.model, self.fit.unbounded, self.study.known)

    @cached_property
    def found_causes(self) -> FoundCauses:
        """Faults that explain the residuals, and readings that are off by themselves.

        Of very many rows, these are looked for in some.
        """
        if self.fit.robust:
            return FoundCauses()  # a robust fit sets aside what a fault makes
        study = self.study
        rows = some_rows(len(self.data), MOST_SEARCHED)
        typed = tuple(
            j
            for j, joint in enumerate(study.robot.joints)
            if joint.kind == "revolute" and j not in study.fixed
        )
        measured = self.as_linear[rows]
        others = assumed_joints(study, np.maximum(self.fit.k, 0.0))
        noise = study.specification.noise
        stated = None if noise is None else noise.model_error_percent
        found = find_causes(
            study.model,
            self.data[rows],
            measured,
            typed,
            study.known,
            self.told_before,
            others,
            study.tasks,
            USUAL_SHARE if stated is None else stated / 100,
        )
        return found.in_rows(rows)

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
        prior = self.prior.with_weak if self.untold else self.prior
        found = PriorRows.near(prior, self.fit.k)
        return found if len(found) else None

    @property
    def structural_causes(self) -> tuple[Cause, ...]:
        """The causes without that of a noise of another size."""
        return tuple(cause for cause in self.causes if cause.cause != NOISE)

    @cached_property
    def as_doubted(self) -> float:
        """Probability that noise leaves such residuals beside what the study doubts.

        It doubts the direction of loads, the tool point and a drift, each by a standard deviation,
        and so do the readings by columns K of unit variance. What is left of the whitened residuals
        is ``min_k,u |z - A k - K u|^2 + |u|^2``, of as many degrees of freedom as without K
        (Henderson 1950). Zero where that is not known, or noise was taken into account that
        repetitions share.
        """
        if self.model_error is None or self.common_noise or not self.fit.dof:
            return 0.0
        known = self.model_error.shown.known
        columns = whiten_columns(np.concatenate([self.A, known], axis=-1), self.noise)
        X = columns.reshape(-1, columns.shape[-1])
        z = whiten(self.measured - self.A @ self.fit.unbounded, self.noise).ravel()
        p, doubts = self.A.shape[-1], known.shape[-1]
        size = np.linalg.norm(X[:, :p], axis=0)
        X[:, :p] /= np.where(size > 0, size, 1.0)
        given = np.eye(doubts, p + doubts, p)
        solved, *_ = np.linalg.lstsq(np.vstack([X, given]), np.append(z, np.zeros(doubts)))
        left = np.sum((z - X @ solved) ** 2) + np.sum(solved[p:] ** 2)
        return float(chi_square_tail(left, self.fit.dof))

    @cached_property
    def linear_regressor(self) -> Array:
        """Regressors (m, rows, p) of the linear model, Eq. (4); A itself where that was fitted."""
        if self.nonlinear or self.common_noise:
            return self.data.regressor(self.study.model)
        return self.A

    @cached_property
    def lack_of_fit(self) -> LackOfFit | None:
        """Test repetitions, or visits where joints move all markers of one.

        A reading that is off by itself disagrees with the model and not with what is not repeated,
        or with its repetitions: either way it says nothing of noise, and counts as not measured.

        Returns:
            The test; None where nothing is repeated, or not all parameters are told.
        """
        if self.untold:
            return None
        data = self.data
        found = self.noise_estimate
        if found is not None and (data.tracker is None or asked_of_sheets(self.study)):
            others, seen = self.others
            return visits_lack_of_fit(self.study, others, seen, found)
        p = len(self.fit.k)
        test = lack_of_fit(whiten(self.fit.residual, data.noise), data.places, p)
        if test is None or not (test.seen or len(self.fit.outliers)):
            return test  # nothing was found that an outlier could have made
        if not self.found_causes.outliers:
            return test
        rows = np.delete(np.arange(len(data)), self.found_causes.outliers)
        rest = data[rows]
        try:
            whitened = Whitened.of(self.linear_regressor[rows], rest.noise, self.fit.parameters)
        except SingularPlanError:
            return test
        return lack_of_fit(whitened.residual(self.as_linear[rows]), rest.places, p)

    @property
    def _sound_rows(self) -> Indices:
        """The measurements that are not off by themselves; all where these are too many."""
        every = np.arange(len(self.data))
        off = {*self.found_causes.outliers, *self.fit.outliers.tolist()}
        return every if len(off) > most_outliers(len(every)) else np.delete(every, list(off))

    @property
    def others(self) -> tuple[Measurements, LinearisedData]:
        """The measurements that are not off by themselves, and their linear model."""
        rows = self._sound_rows
        if len(rows) == len(self.data):
            return self.data, LinearisedData(self.A, self.measured)
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
