"""A bound on the inclination of the tool."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames, cross
from edtk.robots.joint import DEGREE
from edtk.robots.robot import Robot
from edtk.system.typing import Array

# Keeps the gradient finite where the tool points straight up or down and phi has a kink.
LEAST_COSINE = 1e-12


@dataclass(frozen=True)
class Tilt(Constraint):
    """The tool frame's z-axis stays within an angle [rad] of the horizontal plane (Table 3, phi).

    ``phi = asin(z_tool . e_z)`` is bounded on both sides, as two inequalities that are smooth at
    phi = 0.
    """

    maximum: float

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """Upper and lower side [deg]."""
        bound = np.rad2deg(self.maximum)
        return (
            Inequality(f"tilt phi < {bound:g} deg", DEGREE),
            Inequality(f"tilt phi > {-bound:g} deg", DEGREE),
        )

    def slack(self, frames: Frames) -> Array:
        """``maximum - phi`` and ``maximum + phi`` (2, ...)."""
        phi = np.arcsin(np.clip(frames.rotation[2, 2], -1.0, 1.0))
        return np.stack([self.maximum - phi, self.maximum + phi])

    def gradient(self, frames: Frames) -> Array:
        """``dphi/dq_k = (w_k x z)_z / cos(phi)`` with both signs (2, n, ...)."""
        z = frames.rotation[2]
        cos = np.maximum(np.hypot(z[0], z[1]), LEAST_COSINE)
        dphi = cross(frames.angular, z[None])[:, 2] / cos
        return np.stack([-dphi, dphi])
