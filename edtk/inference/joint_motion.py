"""How each joint moves what a measurement measures."""

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array


def joint_motion(model: ElastostaticModel, data: Measurements) -> Array:
    """Derivatives (m, rows, n) of the measured rows by all joints [m/rad, or 1].

    Columns of the regressor are these, times the loads of the joints: so whatever the model
    explains of a visit is a motion of the joints.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, instruments and markers.
    """
    motion = data.motion_of(model, model.frames(data.q))
    return np.ascontiguousarray(np.moveaxis(motion, (0, 1), (-1, -2)))
