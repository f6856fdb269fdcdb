"""The fit where joints move between visits, or repetitions share a part of their noise."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.correlated_noise import (
    CorrelatedNoise,
    NotPositiveDefiniteError,
    RowNoise,
)
from edtk.fit.equilibrium import LinearisedData
from edtk.fit.estimate_noise import NoiseEstimate, StatedSizes
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements, joint_motion, model_errors
from edtk.fit.noise import TooManyVisitsError, own_covariance, tracker_noise, visit_covariance
from edtk.fit.outliers import LackOfFit, lack_of_fit
from edtk.measure.noise import VisitNoise, shared_visits
from edtk.measure.pose_table import pose_factors
from edtk.study.study import Study
from edtk.system.typing import Array, Indices


def stated_noise(study: Study, data: Measurements, repeats: Indices | None = None) -> Measurements:
    """Give measurements the covariance of their visits; the same where noise is white.

    A sheet that states the noise of its displacements speaks for tracker and white noise; motions
    of the joints and the discrepancy are added to what it says. A stated share of what springs do
    is for plans, which have no readings: a sheet tells itself what the springs leave out.

    Args:
        study: Its [noise].
        data: Poses, markers, visits, and the white noise or that of the sheet.
        repeats: Visits (m,) of a plan of which each row is the mean; None for a sheet.

    Raises:
        NotPositiveDefiniteError: A measurement has no noise in some direction.
        TooManyVisitsError: A pose is visited more often than a computer likes.
    """
    noise = study.noise
    if noise is not None and repeats is None:
        noise = noise.of_readings
    if noise is None:
        return data
    times = np.ones(len(data), dtype=int) if repeats is None else repeats
    tracker = _tracker(study, data).over(times)
    joints = np.sqrt(noise.readings) * noise.repeatability
    motion = joint_motion(study.model, data) * joints / np.sqrt(times)[:, None, None]
    covariance = visit_covariance(data, tracker, motion, *_model_errors(study, noise, data, times))
    visit = data.visits.astype(float)
    return replace(data, covariance=covariance, sigma=covariance.std, tracker=tracker, visit=visit)


def _tracker(study: Study, data: Measurements) -> CorrelatedNoise:
    """The stated noise of the instruments themselves, or that of the sheet."""
    noise = study.noise
    if noise is None or noise.tracker is None or data.stated:
        return CorrelatedNoise.of_any(data.noise, data.sigma.shape)
    return tracker_noise(study.model, data, noise.tracker, noise.readings)


@dataclass(frozen=True)
class ReadingNoise:
    """By how much a further reading scatters, as a fit has it.

    Attributes:
        ratio: Its noise over the stated one.
        joints: How well joints return [deg, mm], and the error of the model [m], where both were
            estimated; None where the study states what visits share.
    """

    ratio: float = 1.0
    joints: tuple[float, float] | None = None

    def variance(self, study: Study, data: Measurements) -> Array:
        """Variances (m, rows) of single readings, each by itself [m^2, rad^2].

        Args:
            study: Its [noise].
            data: Poses, instruments, and the white noise or that of the sheet.
        """
        stated = study.noise
        own = _tracker(study, data).std
        moves = np.zeros(study.robot.n)
        model = 0.0
        if self.joints is not None:
            moves = joint_unit(study) * self.joints[0] / self.ratio
            model = self.joints[1] / self.ratio
        elif stated is not None:
            moves = np.sqrt(stated.readings) * stated.repeatability
            model = float(stated.discrepancy.max())
        moved = ((joint_motion(study.model, data) * moves) ** 2).sum(axis=-1)
        return self.ratio**2 * (own**2 + moved + np.where(data.lengths, model, 0.0) ** 2)


def _model_errors(
    study: Study, noise: VisitNoise, data: Measurements, times: Indices
) -> tuple[Array, Array | None]:
    """The model's stated errors, which visits of a pose share, as `visit_covariance` takes them.

    Poses near each other share an unknown part of it. As in a design, the variance of a pose is
    counted as often as there are visits near it, over its own visits: that is never too little.

    Returns:
        Standard deviations (m, rows) of rows by themselves, and a root (m, rows, n) of errors that
        the rows of a pose share; None where springs turn as the model says.
    """
    if not noise.shares:
        return np.zeros(data.sigma.shape), None
    first = np.unique(data.pose, return_index=True)[1]
    of_visit = np.unique(data.visits, return_index=True)[1]
    visits = np.bincount(data.pose[of_visit], times[of_visit])
    near = shared_visits(
        data.q[first], visits, study.robot.slides, noise.within, data.wrench[first]
    )
    counted = np.sqrt(near / visits)[data.pose, None]
    sizes = np.where(data.lengths, float(noise.discrepancy.max()), 0.0)
    if noise.error is None:
        return counted * sizes, None
    turns, anywhere = model_errors(study.model, data, noise.error)
    return counted * np.hypot(sizes, anywhere), counted[..., None] * turns


def moving_joints(
    study: Study,
    data: Measurements,
    seen: LinearisedData,
    found: NoiseEstimate,
    fit: Identification,
) -> tuple[CorrelatedNoise, Identification] | None:
    """Fit again with the estimated errors of tracker, joints and model.

    Args:
        study: The robot and the names of the parameters.
        data: The measurements.
        seen: Their linear model.
        found: The estimate.
        fit: The fit with the stated noise, whose chi-square stays.

    Returns:
        The noise, and the fit: intervals have the degrees of freedom of what tells the largest
        errors. None where a pose is visited more often than a computer likes, or the tracker errs
        next to nothing beside the joints.
    """
    try:
        noise = estimated_noise(study, data, found, found.discrepancy)
    except (TooManyVisitsError, NotPositiveDefiniteError):
        return None
    return noise, _refit(seen, noise, fit, found.common_dof)


def shared_by_repetitions(
    data: Measurements, seen: LinearisedData, test: LackOfFit, fit: Identification
) -> tuple[CorrelatedNoise, Identification] | None:
    """Fit again with the estimated noise that repetitions share, where rows have covariances.

    Args:
        data: The measurements.
        seen: Their linear model.
        test: How much repetitions scatter, and share.
        fit: The fit with the stated noise, whose chi-square stays.

    Returns:
        The noise, and the fit; None where a pose is repeated more often than a computer likes.
    """
    own = test.pure_error**2 * own_covariance(data.own_noise, data.sigma.shape)
    still = np.zeros((*data.sigma.shape, 1))
    try:
        noise = visit_covariance(
            data, CorrelatedNoise.by_row(own), still, test.common * data.own_sigma
        )
    except (TooManyVisitsError, NotPositiveDefiniteError):
        return None
    return noise, _refit(seen, noise, fit, float(test.dof[0]))


def _refit(
    seen: LinearisedData, noise: CorrelatedNoise, fit: Identification, dof: float
) -> Identification:
    """The fit with an estimated noise; chi-square and scale stay those of the stated one."""
    again = identify(seen.A, seen.measured, noise, fit.parameters)
    return replace(
        again,
        chi2=fit.chi2,
        p_value=fit.p_value,
        scale=fit.scale,
        covariance_dof=float(dof),
        known=fit.known,
        too_few_for_robust=fit.too_few_for_robust,
    )


def visits_lack_of_fit(
    study: Study, data: Measurements, seen: LinearisedData, found: NoiseEstimate
) -> LackOfFit | None:
    """Test whether visits of a pose agree better with each other than with the model.

    Motions of the joints hang together in a visit: rows are whitened by the estimate of them. Where
    no pose is visited twice it is markers that are compared, with motions of the joints.

    Args:
        study: The robot and the names of the parameters.
        data: The measurements.
        seen: Their linear model.
        found: The estimate.
    """
    if not found.revisited:
        return found.lack_of_fit
    try:
        noise = estimated_noise(study, data, found, 0.0)
        whitened = Whitened.of(seen.A, noise, study.model.parameters)
    except (TooManyVisitsError, NotPositiveDefiniteError, SingularPlanError):
        return found.lack_of_fit
    z = found.tracker * whitened.residual(seen.measured)
    return lack_of_fit(z, data.places, study.model.p)


def estimated_noise(
    study: Study, data: Measurements, found: NoiseEstimate, discrepancy: float
) -> CorrelatedNoise:
    """The estimated noise of tracker and joints, and of a discrepancy [m].

    Raises:
        TooManyVisitsError: A pose is visited more often than a computer likes.
        NotPositiveDefiniteError: The tracker errs next to nothing beside the joints.
    """
    own = found.tracker**2 * own_covariance(data.own_noise, data.sigma.shape)
    motion = joint_motion(study.model, data) * (joint_unit(study) * found.joints)
    of_model = np.where(data.lengths, discrepancy, 0.0)
    return visit_covariance(data, CorrelatedNoise.by_row(own), motion, of_model)


def joint_unit(study: Study) -> Array:
    """Standard deviations (n,) of what joints add to a row, for a variance of one [rad or m].

    Joints err by as many degrees each, or millimetres where they slide, as nothing tells them apart
    beforehand; where the study states several sizes, these keep their proportions. A displacement
    is the difference of two readings, to each of which the robot comes anew.
    """
    readings = 2 if study.specification.measurement.reference == "unloaded" else 1
    unit = pose_factors(study.robot)
    stated = stated_repeatability(study)
    if study.noise is not None and stated is not None:
        unit = study.noise.repeatability / stated
    return np.asarray(np.sqrt(readings) * unit)


def sizes_beside(study: Study) -> StatedSizes:
    """What the study says of joints and discrepancy, where it asks the sheet for some of them.

    A study that asks for none is compared with estimates of all.
    """
    asked = asked_of_sheets(study)
    if not asked:
        return StatedSizes()
    noise = study.noise
    return StatedSizes(
        joints=stated_repeatability(study) or 0.0,
        discrepancy=0.0 if noise is None else float(noise.discrepancy.max()),
        estimated=(True, "joints" in asked, "discrepancy" in asked),
    )


def asked_of_sheets(study: Study) -> tuple[str, ...]:
    """Which errors the study wants to be estimated from sheets."""
    table = study.specification.noise
    return () if table is None else table.estimated


def own_of_visits(study: Study, data: Measurements) -> RowNoise:
    """The noise of each measurement by itself, against which motions of the joints are seen.

    Where no pose is visited twice, nothing tells the discrepancy from errors of the tracker: a
    stated one is then taken as such.
    """
    own = data.own_noise
    if data.alone or study.noise is None or not study.noise.shares or asked_of_sheets(study):
        return own
    if data.visits.max() > data.pose.max():
        return own
    size = np.where(data.lengths, float(study.noise.discrepancy.max()), 0.0)
    return CorrelatedNoise.of_any(own, data.sigma.shape).with_more(size)


def stated_repeatability(study: Study) -> float | None:
    """Root mean square of the stated repeatabilities [deg, mm]; None where none is stated."""
    if study.noise is None or not study.noise.repeatability.any():
        return None
    sizes = study.noise.repeatability / pose_factors(study.robot)
    return float(np.sqrt(np.mean(sizes**2)))
