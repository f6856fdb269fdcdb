"""Residuals and columns of the poses of a sheet."""

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.geometry.geometric_model import GeometricModel, Seen
from edtk.model.geometry.rotation import rotation_vectors
from edtk.system.typing import Array

MM = 1e3


class PoseRows:
    """Residuals, columns and motions of the poses, in millimetres and milliradians.

    They are zero where nothing was seen.
    """

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
        width = means.rows * k
        there = means.seen[..., None, None]
        design = np.where(there, seen.jacobian * model.scales, 0.0)
        return cls(
            MM * measured_less_seen(means, seen).reshape(m, width),
            MM * design.reshape(m, width, -1),
            seen.by_joints.reshape(m, width, -1),
        )

    def weighted(self, weights: Array) -> "PoseRows":
        """With residuals and columns scaled by the roots of the poses' weights (m,)."""
        root = np.sqrt(weights)[:, None]
        return PoseRows(self.residual * root, self.design * root[..., None], self.motion)


def measured_less_seen(means: MarkerPositions, seen: Seen) -> Array:
    """Residuals (m, k, rows) [m, rad], zero where nothing was seen.

    That of an orientation is the vector of the turn from the predicted to the measured one, in the
    axes of the instrument.
    """
    apart = np.where(means.seen[..., None], means.measured - seen.points, 0.0)
    if means.turns is None:
        return apart
    turned = means.turns @ np.swapaxes(seen.turns, -1, -2)
    turned = np.where(means.seen[..., None, None], turned, np.eye(3))
    return np.concatenate([apart, rotation_vectors(turned)], axis=-1)
