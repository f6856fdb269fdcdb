"""A pose that is off, with the joint value that explains it."""

from dataclasses import replace

import numpy as np

from edtk.calibration.causes.cause import OUTLIER
from edtk.calibration.causes.mistyped_joint import mistyped_joint
from edtk.calibration.causes.rarity import rarity
from edtk.calibration.causes.tried import Tried
from edtk.inference.least_squares import Estimate, SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.whiten import whiten
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

# Poses are mostly off by one joint value: how much rarer they are off otherwise, all repeats alike.
UNEXPLAINED = 5
USUAL_CHANGE = np.deg2rad(10.0)  # of a joint value that was mistyped, or not gone to


def wrong_pose(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    tried: Tried,
    typed: tuple[int, ...],
    by_prior: float = 0.0,
) -> Tried:
    """Explain the shift of a pose by one of its joint values.

    A joint value is one parameter, and a shift has three or six: where a joint explains the pose,
    that counts for it.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) [m, rad].
        tried: The pose with any shift.
        typed: Revolute joints whose values were written by hand.
        by_prior: What a prior adds to the sum of squares.

    Returns:
        The pose, with the joint if a single one explains it. A pose that was measured once and
        that no joint explains is an outlier.
    """
    rows = np.array(tried.cause.rows)
    others = np.setdiff1d(np.arange(len(data)), rows)
    try:
        A = data[others].regressor(model)
        rest = Whitened.of(A, data.noise[others], model.parameters)
    except SingularPlanError:
        return tried
    k = rest.solve(measured[others])
    estimate = Estimate(k, rest.covariance)
    found = mistyped_joint(model, data, measured, estimate, rows, typed)
    if found is None:
        kind = tried.cause.cause if len(rows) > 1 else OUTLIER
        rare = tried.tries * UNEXPLAINED
        return replace(tried, cause=replace(tried.cause, cause=kind), tries=rare)
    z = whiten(measured[others] - A @ k, data.noise[others])
    deviance = float((z**2).sum()) + found.misfit + by_prior
    cause = tried.cause
    if found.alone:
        name = model.robot.joint_names[found.joint]
        size = float(np.rad2deg(found.change))
        cause = replace(cause, size=size, unit="deg", joint=name)
    cost = rarity(np.array([found.change]), np.array([[found.std**2]]), USUAL_CHANGE)
    return Tried(cause, deviance, 1, tried.tries * len(typed), cost)
