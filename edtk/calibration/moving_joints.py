"""The fit where joints move all markers of a visit together, by an amount that is estimated."""

from dataclasses import replace

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise, NotPositiveDefiniteError
from edtk.inference.estimate_noise import NoiseEstimate
from edtk.inference.fit_equilibrium import LinearisedData
from edtk.inference.identification import Identification
from edtk.inference.identify import identify
from edtk.inference.joint_motion import joint_motion
from edtk.inference.lack_of_fit import LackOfFit, lack_of_fit
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.visit_covariance import (
    TooManyVisitsError,
    own_covariance,
    visit_covariance,
)
from edtk.inference.whiten import RowNoise
from edtk.study.study import Study
from edtk.system.typing import Array
from edtk.tables.pose_table import pose_factors


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
        noise = _noise(study, data, found, found.discrepancy)
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
        noise = _noise(study, data, found, 0.0)
        whitened = Whitened.of(seen.A, noise, study.model.parameters)
    except (TooManyVisitsError, NotPositiveDefiniteError, SingularPlanError):
        return found.lack_of_fit
    z = found.tracker * whitened.residual(seen.measured)
    return lack_of_fit(z, data.places, study.model.p)


def _noise(
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


def own_of_visits(study: Study, data: Measurements) -> RowNoise:
    """The noise of each measurement by itself, against which motions of the joints are seen.

    Where no pose is visited twice, nothing tells the discrepancy from errors of the tracker: a
    stated one is then taken as such.
    """
    own = data.own_noise
    if data.alone or study.noise is None or not study.noise.shares:
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
