"""Residuals and columns of the poses of a sheet."""

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.system.typing import Array

MM = 1e3


class PoseRows:
    """Residuals, columns and motions of the poses, in millimetres; zero where nothing was seen."""

    def __init__(self, residual: Array, design: Array, motion: Array) -> None:
        self.residual = residual
        self.design = design
        self.motion = motion

    @classmethod
    def of(
        cls, model: GeometricModel, theta: Array, means: MarkerPositions, torque: Array | None
    ) -> "PoseRows":
        """At parameters theta (p,)."""
        seen = model.see(theta, means.q, torque)
        assert seen.jacobian is not None
        assert seen.by_joints is not None
        m, k = means.seen.shape
        there = means.seen[..., None]
        z = np.where(there, means.measured - seen.points, 0.0)
        design = np.where(there[..., None], seen.jacobian * model.scales, 0.0)
        return cls(
            MM * z.reshape(m, 3 * k),
            MM * design.reshape(m, 3 * k, -1),
            seen.by_joints.reshape(m, 3 * k, -1),
        )
