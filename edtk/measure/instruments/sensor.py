"""The interface of an instrument: measured rows as a function of the joints."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from edtk.robots.frames import BodyPoint, Frames
from edtk.system.typing import Array, Mask


@dataclass(frozen=True, eq=False)
class Sensor(ABC):
    """Rows y(q) that are measured at one point of the robot.

    Attributes:
        point: The point.
        name: Name for people; empty without one.
    """

    point: BodyPoint = field(default_factory=BodyPoint)
    name: str = ""

    @property
    @abstractmethod
    def rows(self) -> int:
        """Number of measured rows."""

    @property
    def lengths(self) -> Mask:
        """Whether each row (rows,) is a length; the others are angles."""
        return np.ones(self.rows, dtype=bool)

    def at(self, point: BodyPoint) -> Self:
        """The same instrument at another point."""
        return replace(self, point=point)

    @abstractmethod
    def motion(self, frames: Frames) -> Array:
        """Derivatives ``dy/dq`` (n, rows, ...) by all joints [m/rad, or 1]."""

    @abstractmethod
    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """Derivatives (n, ...) of ``<B, dy/dq>`` by all joints, weights B (n, rows, ...) fixed."""

    @abstractmethod
    def place(self, frames: Frames) -> Array:
        """The lengths that it shows of a robot: position (3, ...), or distance (1, ...) [m]."""

    @abstractmethod
    def translation(self, frames: Frames) -> Array:
        """Derivatives (rows, 3, ...) of the rows where the whole robot moves along the axes."""

    @abstractmethod
    def change(self, before: Frames, after: Frames) -> Array:
        """What the rows (rows, ...) show when the robot moves from some poses to others."""

    def change_derivative(self, before: Frames, after: Frames, start: Array, end: Array) -> Array:
        """Derivatives (rows, p, ...) of `change` by parameters that move the robot.

        Args:
            before: Poses at the start of the motion.
            after: Poses at its end.
            start: Derivatives (n, p, ...) of the joint variables at the start.
            end: The same at the end.
        """
        at_end = np.einsum("nr...,np...->rp...", after.folded(self.motion(after)), end)
        if not start.any():
            return at_end
        return at_end - np.einsum("nr...,np...->rp...", before.folded(self.motion(before)), start)


def unit_translation(frames: Frames, rows: int) -> Array:
    """The identity above zeros (rows, 3, ...): positions move with the robot, rotations do not."""
    shape = frames.position.shape[1:]
    unit = np.eye(rows, 3).reshape(rows, 3, *[1] * len(shape))
    return np.broadcast_to(unit, (rows, 3, *shape))
