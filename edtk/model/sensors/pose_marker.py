"""A marker whose position and orientation are measured."""

from dataclasses import dataclass

import numpy as np

from edtk.model.columns_slope import columns_slope
from edtk.model.frames import Frames
from edtk.model.sensors.sensor import Sensor
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class PoseMarker(Sensor):
    """Six rows: the position of the point, then the rotation of its body, in world axes."""

    @property
    def rows(self) -> int:
        """Three coordinates and three angles."""
        return 6

    def motion(self, frames: Frames) -> Array:
        """Columns of the Jacobian at the point (n, 6, ...), linear ones first."""
        return np.concatenate([self.point.linear(frames), self.point.angular(frames)], axis=1)

    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """See `columns_slope`."""
        linear = self.point.linear(frames)
        return columns_slope(linear, self.point.angular(frames), B[:, :3], B[:, 3:])
