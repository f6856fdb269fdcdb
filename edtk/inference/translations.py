"""How readings follow a motion of the whole robot."""

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def translations(model: ElastostaticModel, data: Measurements) -> Array:
    """Derivatives (m, rows, 3) of the readings where the robot moves along the world's axes.

    Args:
        model: Says what is measured.
        data: Poses and instruments.
    """
    frames = model.frames(data.q)
    found = np.empty((*data.deflection.shape, 3))
    for rows, sensor in data.instruments(model):
        found[rows] = np.moveaxis(sensor.translation(frames[rows]), -1, 0)
    return found
