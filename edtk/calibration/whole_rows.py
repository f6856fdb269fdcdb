"""The regressors of whole displacements and rotations, where a sheet has single coordinates."""

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.sensors.one_row import OneRow
from edtk.system.typing import Array, Indices


def whole_rows(
    model: ElastostaticModel, data: Measurements, A: Array
) -> tuple[Array, Indices | None]:
    """Regressors of the vectors that rows are coordinates of.

    Args:
        model: Says what is measured.
        data: The measurements.
        A: Their regressors (m, rows, p).

    Returns:
        Regressors (m, v, 3, p) of v vectors of each row: its displacement, and its rotation where
        both are measured. And the coordinate (m,) that a row of a single one is of its vector, -1
        for a distance; None where rows are whole.
    """
    m, rows, p = A.shape
    if rows > 1:
        return A.reshape(m, rows // 3, 3, p), None
    whole = np.zeros((m, 1, 3, p))
    own = np.full(m, -1)
    frames = model.frames(data.q)
    torque = model.torque_of(frames, data.wrench)[model.joints]
    for members, sensor in data.instruments(model):
        if isinstance(sensor, OneRow):
            first = sensor.row // 3 * 3
            part = frames[members]
            motion = part.folded(sensor.whole.motion(part))[model.joints, first : first + 3]
            whole[members, 0] = np.moveaxis(motion * torque[:, None, members], (0, 1), (-1, -2))
            own[members] = sensor.row % 3
    return whole, own
