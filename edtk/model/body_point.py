"""A point that is fixed to a body of the chain: where it is, and how each joint moves it."""

from dataclasses import dataclass, field

import numpy as np

from edtk.model.frames import Frames, cross
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """A point of the tool, or of the body that a joint moves.

    Attributes:
        offset: Offset (3,) from the tool point in the tool frame, or in the joint's frame [m]; for
            a point that is elsewhere in each pose, one a pose (3, ...).
        joint: Index of the joint that moves the body, among all joints of the chain; None for the
            tool.
    """

    offset: Array = field(default_factory=lambda: np.zeros(3))
    joint: int | None = None

    @property
    def is_tool_point(self) -> bool:
        """Whether the point is the tool point itself."""
        return self.joint is None and not np.any(self.offset)

    @property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames the point needs, see `Robot.frames`."""
        return () if self.joint is None else (self.joint,)

    def position(self, frames: Frames) -> Array:
        """Position (3, ...) in the world [m]."""
        if self.joint is None:
            return frames.position + self._lever(frames.rotation)
        rotation, origin = frames.bodies[self.joint]
        return origin + self._lever(rotation)

    def orientation(self, frames: Frames) -> Array:
        """The frame of the body (3, 3, ...): its k-th unit vector is the k-th entry."""
        return frames.rotation if self.joint is None else frames.bodies[self.joint][0]

    def linear(self, frames: Frames) -> Array:
        """Velocity of the point per joint (N, 3, ...) [m/rad, or 1 if prismatic].

        ``a x (p - o)`` for a revolute joint with axis a through o, ``a`` for a prismatic one, and
        zero for joints behind the body.
        """
        if self.is_tool_point:
            return frames.linear_of_each
        J = cross(frames.axes, self.position(frames) - frames.origins)
        J[frames.prismatic] = frames.axes[frames.prismatic]
        if self.joint is not None:
            J[self.joint + 1 :] = 0.0
        return J

    def angular(self, frames: Frames) -> Array:
        """Angular velocity of the body per joint (N, 3, ...), zero for joints behind it."""
        if self.joint is None:
            return frames.angular_of_each
        J = frames.angular_of_each.copy()
        J[self.joint + 1 :] = 0.0
        return J

    def _lever(self, rotation: Array) -> Array:
        """The offset (3, ...) in world axes [m]."""
        return np.einsum("k...,kc...->c...", self.offset, rotation)
