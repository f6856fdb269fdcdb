"""Where the points of a sheet are."""

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def measured_points(model: ElastostaticModel, data: Measurements) -> Array:
    """Positions (m, 3) of the points in the poses of each row, without any load [m].

    Args:
        model: Says what is measured.
        data: Poses and instruments.
    """
    frames = model.frames(data.q)
    found = np.empty((len(data), 3))
    for rows, sensor in data.instruments(model):
        found[rows] = sensor.point.position(frames[rows]).T
    return found
