"""How well the circumstances of a calibration are known."""

from dataclasses import dataclass

import numpy as np

from edtk.model.assumed_joint import AssumedJoint


@dataclass(frozen=True)
class Uncertainty:
    """How well the circumstances of a calibration are known: standard deviations.

    Attributes:
        load_size: Relative, of the size of the calibration load; 0.01 is one per cent.
        load_direction: Of its direction, about each axis across it [rad].
        tool: Of the calibration tool point, and the marker on it, along each axis [m].
        drift: Of a shift between unloaded and loaded readings that all rows share, along each axis
            [m].
        repeatability: Of the robot between an unloaded and a loaded reading, along each axis [m].
        joints: The joints that are not identified, and how far each may be off.
    """

    load_size: float = 0.01
    load_direction: float = float(np.deg2rad(1.0))
    tool: float = 1e-3
    drift: float = 0.0
    repeatability: float = 0.0
    joints: tuple[AssumedJoint, ...] = ()
