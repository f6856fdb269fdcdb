"""Predictions for markers that were put elsewhere on the tool, and are placed by some poses."""

from dataclasses import replace

import numpy as np

from edtk.inference.geometry.geometric_fit import FittedGeometry, Loads, Predicted
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Array, Mask


def tool_from_rows(
    fitted: FittedGeometry, data: MarkerPositions, placing: Mask, loads: Loads | None
) -> Predicted:
    """Predict positions of markers whose places on the tool are those of some poses.

    A marker's place is the mean over the s poses that place it, of what brings prediction and
    position together, in the tool's frame. Errors of these poses, turned by the tool, come on top
    of those of the pose that is predicted: the variance grows by ``1/s`` of a pose's own.

    Args:
        fitted: The geometry.
        data: The poses.
        placing: Which positions (v, k) place the markers.
        loads: What loads the joints.
    """
    found = fitted.predict(data.q, data.wrench, loads)
    torque = fitted.torque(data.q, data.wrench, loads)
    tips = fitted.model.see(fitted.theta, data.q, torque, derivatives=False).turns
    std = found.std.copy()
    points = found.points.copy()
    for marker in range(len(data.markers)):
        rows = np.flatnonzero(placing[:, marker])
        if not len(rows):
            continue
        apart = data.measured[rows, marker] - found.points[rows, marker]
        local = np.einsum("vji,vj->vi", tips[rows, marker], apart)
        points[:, marker] += tips[:, marker] @ local.mean(axis=0)
        # How errors of the placing poses lie to the axes is not known: they count alike on all.
        own = (found.std[rows, marker] ** 2).mean() / len(rows)
        std[:, marker] = np.sqrt(found.std[:, marker] ** 2 + own)
    half = found.half * _ratio(std, found.std)
    return replace(found, points=points, std=std, half=half)


def _ratio(a: Array, b: Array) -> Array:
    """Quotients, one where the denominator is zero."""
    return np.divide(a, b, out=np.ones_like(a), where=b > 0)
