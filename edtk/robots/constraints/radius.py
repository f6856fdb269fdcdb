"""A lower bound on the distance of the tool point from the base axis."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames
from edtk.robots.joint import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True)
class Radius(Constraint):
    """The tool point stays outside a vertical cylinder around the base axis [m] (Table 3, r)."""

    minimum: float

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """The bound [mm]."""
        bound = self.minimum * MILLIMETRE.per_si
        return (Inequality(f"radius r > {bound:g} mm", MILLIMETRE),)

    def slack(self, frames: Frames) -> Array:
        """``hypot(p_x, p_y) - minimum`` (1, ...)."""
        return np.hypot(frames.position[0], frames.position[1])[None] - self.minimum

    def gradient(self, frames: Frames) -> Array:
        """``(p_x v_x + p_y v_y) / r`` (1, n, ...).

        On the axis itself it is not defined, and zero is returned.
        """
        x = frames.position[0]
        y = frames.position[1]
        r = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
        return ((x * frames.linear[:, 0] + y * frames.linear[:, 1]) / r)[None]
