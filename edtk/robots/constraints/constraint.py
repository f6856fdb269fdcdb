"""The interface of a constraint on poses."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from edtk.robots.frames import Frames
from edtk.robots.joint import Unit
from edtk.robots.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True)
class Inequality:
    """The name of one inequality of a constraint.

    Attributes:
        label: Quantity, sign and bound for people: "height p_z > 800 mm".
        unit: The unit in which people read its slack.
    """

    label: str
    unit: Unit


class Constraint(ABC):
    """One or more inequalities ``slack >= 0`` on a pose.

    Arrays are component first, as in `Frames`. A descent needs slacks that are smooth, and their
    derivatives.
    """

    @abstractmethod
    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """Name and unit of each inequality (c,)."""

    @abstractmethod
    def slack(self, frames: Frames) -> Array:
        """Distance to each bound (c, ...) [m or rad], positive inside."""

    @abstractmethod
    def gradient(self, frames: Frames) -> Array:
        """Derivative (c, n, ...) of the slack with respect to the joint variables."""

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Name of each inequality (c,)."""
        return tuple(inequality.label for inequality in self.inequalities(robot))
