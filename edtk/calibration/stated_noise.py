"""The noise of a sheet as the study's [noise] states it: tracker, joints and discrepancy."""

from dataclasses import replace

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.inference.joint_motion import joint_motion
from edtk.inference.measurements import Measurements
from edtk.inference.tracker_noise import tracker_noise
from edtk.inference.visit_covariance import visit_covariance
from edtk.model.noise.shared_visits import shared_visits
from edtk.model.noise.visit_noise import VisitNoise
from edtk.study.study import Study
from edtk.system.typing import Array, Indices


def stated_noise(study: Study, data: Measurements, repeats: Indices | None = None) -> Measurements:
    """Give measurements the covariance of their visits; the same where noise is white.

    A sheet that states the noise of its displacements speaks for tracker and white noise; motions
    of the joints and the discrepancy are added to what it says.

    Args:
        study: Its [noise].
        data: Poses, markers, visits, and the white noise or that of the sheet.
        repeats: Visits (m,) of which each row is the mean; one by default.

    Raises:
        NotPositiveDefiniteError: A measurement has no noise in some direction.
        TooManyVisitsError: A pose is visited more often than a computer likes.
    """
    noise = study.noise
    if noise is None:
        return data
    times = np.ones(len(data), dtype=int) if repeats is None else repeats
    own = CorrelatedNoise.of_any(data.noise, data.sigma.shape)
    if noise.tracker is not None and not data.stated:
        own = tracker_noise(study.model, data, noise.tracker, noise.readings)
    tracker = own.over(times)
    joints = np.sqrt(noise.readings) * noise.repeatability
    motion = joint_motion(study.model, data) * joints / np.sqrt(times)[:, None, None]
    covariance = visit_covariance(data, tracker, motion, _discrepancy(study, noise, data, times))
    visit = data.visits.astype(float)
    return replace(data, covariance=covariance, sigma=covariance.std, tracker=tracker, visit=visit)


def _discrepancy(study: Study, noise: VisitNoise, data: Measurements, times: Indices) -> Array:
    """Standard deviations (m, rows) of the model's errors, which visits of a pose share.

    Poses near each other share an unknown part of it. As in a design, the variance of a pose is
    counted as often as there are visits near it, over its own visits: that is never too little.
    """
    size = float(noise.discrepancy.max())
    if not size:
        return np.zeros(data.sigma.shape)
    first = np.unique(data.pose, return_index=True)[1]
    of_visit = np.unique(data.visits, return_index=True)[1]
    visits = np.bincount(data.pose[of_visit], times[of_visit])
    prismatic = np.array([joint.kind == "prismatic" for joint in study.robot.joints])
    near = shared_visits(data.q[first], visits, prismatic, noise.within)
    return np.sqrt(near / visits)[data.pose, None] * np.where(data.lengths, size, 0.0)
