"""A lower bound on the height of the tool point."""

from dataclasses import dataclass

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames
from edtk.robots.joint import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True)
class Height(Constraint):
    """The tool point stays above a height [m] (Table 3, p_z)."""

    minimum: float

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """The bound [mm]."""
        bound = self.minimum * MILLIMETRE.per_si
        return (Inequality(f"height p_z > {bound:g} mm", MILLIMETRE),)

    def slack(self, frames: Frames) -> Array:
        """``p_z - minimum`` (1, ...)."""
        return frames.position[2:3] - self.minimum

    def gradient(self, frames: Frames) -> Array:
        """The vertical row of the Jacobian (1, n, ...)."""
        return frames.linear[None, :, 2]
