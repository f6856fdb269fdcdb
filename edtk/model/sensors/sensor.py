"""The interface of an instrument: measured rows as a function of the joints."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from edtk.model.body_point import BodyPoint
from edtk.model.frames import Frames
from edtk.system.typing import Array


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

    @abstractmethod
    def motion(self, frames: Frames) -> Array:
        """Derivatives ``dy/dq`` (n, rows, ...) by all joints [m/rad, or 1]."""

    @abstractmethod
    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """Derivatives (n, ...) of ``<B, dy/dq>`` by all joints, weights B (n, rows, ...) fixed."""
