"""The error of a calibration's linear model in the test pose."""

import numpy as np

from edtk.inference.equilibrium_deflection import marker_motion
from edtk.inference.least_squares import SingularPlanError, estimate
from edtk.inference.measurements import Measurements
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.study.study import Study
from edtk.system.typing import Array

MOST_POSES = 2000  # of more, every second, third, ... is enough to tell


def bias_in_test_pose(study: Study, data: Measurements, A: Array, k: Array) -> float | None:
    """Measure by how far the linear model is off, if the robot has the identified compliances.

    Args:
        study: Model and test pose.
        data: The measurements from which the compliances were identified.
        A: Their regressors (m, rows, p).
        k: The compliances (p,) [rad/(N m)].

    Returns:
        Length of the mean error ``|A0 (E(k_hat) - k)|`` [m]; None without a test pose, or if such a
        robot would not come to rest.
    """
    if study.target is None:
        return None
    all_joints = np.zeros(study.robot.n)
    all_joints[study.model.joints] = k
    every = -(-(1 + data.pose.max()) // MOST_POSES)
    rows = np.flatnonzero(data.pose % every == 0)
    some = data[rows]
    # Poses stay contiguous, as the model makes them: another layout sums in another order.
    some_A = A.T.take(rows, axis=-1).T
    one = some[np.unique(some.pose, return_index=True)[1]]
    try:
        # Rows of one pose, such as those of several markers, share its equilibrium.
        at_rest = equilibrium(study.robot, one.q, one.wrench, all_joints).displacement
        measured = marker_motion(study.model, some.q, at_rest[some.pose], some.marker)
        expected = estimate(some_A, measured, some.sigma, study.model.parameters).k
    except (NoEquilibriumError, SingularPlanError):
        return None
    return float(np.linalg.norm(study.target @ (expected - k)))
