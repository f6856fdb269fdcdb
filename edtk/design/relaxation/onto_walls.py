"""Points that end a hair off a bound or a constraint, moved onto it."""

import numpy as np

from edtk.design.region import Region
from edtk.system.typing import Array

# A barrier holds points off the walls by about its accuracy over the slope, far below this part of
# a range.
NEAR = 1e-5
ROUNDS = 3  # Newton steps onto curved constraints
RIDGE = 1e-14  # keeps the steps finite where gradients of constraints are dependent


def onto_walls(region: Region, x: Array, near: float = NEAR) -> Array:
    """Move points onto the bounds and constraints that they almost touch, by the shortest way.

    Args:
        region: The region.
        x: Points (n, d).
        near: Distance of what counts as almost, in parts of a range.

    Returns:
        Points (n, d), some of which may violate another constraint.
    """
    low, high = region.limits
    span = high - low
    before = (x - low) / span
    y = np.where(before < near, 0.0, np.where(before > 1 - near, 1.0, before))
    on_bound = (y == 0) | (y == 1)
    active = None
    for _ in range(ROUNDS):
        slack = region.slack_at(low + span * y)
        if not slack.shape[-1]:
            break
        G = region.slack_derivative_at(low + span * y) * span
        size = np.linalg.norm(G, axis=-1)
        if active is None:
            active = np.abs(slack) <= near * size
        # Points on a bound move along it.
        G = np.where(on_bound[:, None], 0.0, G) * active[..., None]
        K = G @ np.swapaxes(G, -1, -2)
        scale = np.maximum(np.trace(K, axis1=-2, axis2=-1), np.finfo(float).tiny)[:, None, None]
        K = K / scale + RIDGE * np.eye(K.shape[-1])
        push = np.linalg.solve(K, (np.where(active, -slack, 0.0) / scale[:, 0])[..., None])
        y = np.clip(y + (np.swapaxes(G, -1, -2) @ push)[..., 0], 0.0, 1.0)
    # The bounds and the points themselves, not what rounding makes of them.
    moved = np.where(y == before, x, low + span * y)
    return np.where(y == 0, low, np.where(y == 1, high, moved))
