"""A distance from a fixed point, as a draw wire or a ballbar measures it."""

from dataclasses import dataclass, field

import numpy as np

from edtk.measure.instruments.sensor import Sensor
from edtk.robots.frames import Frames, columns_slope, dot
from edtk.system.typing import Array

NEAREST = 1e-9  # distance below which a wire has no direction [m]


@dataclass(frozen=True, eq=False)
class Distance(Sensor):
    """One row: the distance ``|p - a|`` of the point p from an anchor a.

    Attributes:
        anchor: The fixed point (3,) in the world [m].
    """

    anchor: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def rows(self) -> int:
        """One distance."""
        return 1

    def motion(self, frames: Frames) -> Array:
        """``u . v_j`` (n, 1, ...), with the direction u from the anchor to the point."""
        direction, _ = self._wire(frames)
        return dot(self.point.linear(frames), direction[None])[:, None]

    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """With ``s = sum_j b_j v_j``, the wire's own turn adds ``v_k . (s - u u.s) / |p - a|``."""
        direction, length = self._wire(frames)
        linear = self.point.linear(frames)
        turned = columns_slope(linear, self.point.angular(frames), B * direction)
        moved = (B * linear).sum(axis=0)
        across = (moved - direction * (direction * moved).sum(axis=0)) / length
        return turned + dot(linear, across[None])

    def place(self, frames: Frames) -> Array:
        """Distance (1, ...) [m]."""
        return self._wire(frames)[1][None]

    def translation(self, frames: Frames) -> Array:
        """The direction from the anchor to the point."""
        return self._wire(frames)[0][None]

    def change(self, before: Frames, after: Frames) -> Array:
        """Change of the distance (1, ...) [m]."""
        # The difference of the squares over the sum: two large distances would cancel.
        first = self.point.position(before)
        moved = self.point.position(after) - first
        anchor = self.anchor.reshape(3, *[1] * (first.ndim - 1))
        longer = (moved * (moved + 2 * (first - anchor))).sum(axis=0)
        lengths = self._wire(before)[1] + self._wire(after)[1]
        return (longer / lengths)[None]

    def _wire(self, frames: Frames) -> tuple[Array, Array]:
        """Direction (3, ...) from the anchor to the point, and distance (...) [m]."""
        position = self.point.position(frames)
        wire = position - self.anchor.reshape(3, *[1] * (position.ndim - 1))
        length = np.maximum(np.sqrt((wire**2).sum(axis=0)), NEAREST)
        return wire / length, length
