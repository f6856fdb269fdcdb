"""The residuals of a sheet's visits, of which noise is estimated."""

import numpy as np

from edtk.inference.joint_motion import joint_motion
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.visited import Visited
from edtk.inference.whiten import RowNoise, whiten_columns
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array, Indices

MOST_ROWS = 1500  # measurements from which noise is estimated; of more, some poses
MOST_IN_POSE = 150  # measurements of one pose; of more, the first ones


def visit_residuals(
    model: ElastostaticModel,
    data: Measurements,
    A: Array,
    measured: Array,
    joints: Array,
    own: RowNoise | None = None,
) -> Visited | None:
    """Fit with the tracker's noise alone, and keep what joints and model may have added.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, markers, visits and the tracker's noise.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        joints: Standard deviations (n,) of the joints for a variance of one [rad or m].
        own: Noise of each measurement by itself; that of the measurements by default.

    Returns:
        The residuals; None where no visit has more than one measurement, so that nothing tells
        motions of the joints from errors of the tracker, or compliances are left open.
    """
    if data.alone:
        return None
    rows = _some_visits(data)
    some = data[rows]
    if len(np.unique(some.visits)) == len(some):
        return None
    noise = (data.own_noise if own is None else own)[rows]
    try:
        whitened = Whitened.of(A[rows], noise, model.parameters)
    except SingularPlanError:
        return None
    # The discrepancy is one of lengths.
    unit = some.lengths[:, :, None] * np.eye(A.shape[1])[:, :3]
    return Visited(
        residual=whitened.residual(measured[rows]),
        Q=whitened.Q,
        motion=whiten_columns(joint_motion(model, some) * joints, noise),
        pose=some.pose,
        visit=some.visits,
        place=some.places,
        unit=whiten_columns(unit, noise),
    )


def _some_visits(data: Measurements) -> Indices:
    """Rows of at most so many measurements, whole visits of whole poses as far as these go."""
    if len(data) <= MOST_IN_POSE:
        return np.arange(len(data))
    pose = data.pose
    # Rows of a visit stand together, the first visits of the first poses ahead.
    order = np.lexsort((data.visits, pose))
    first = np.cumsum(np.bincount(pose)) - np.bincount(pose)
    in_pose = np.arange(len(order)) - first[pose[order]]
    chosen = order[in_pose < MOST_IN_POSE][:MOST_ROWS]
    return np.sort(chosen)
