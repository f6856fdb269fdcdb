"""Starts that lie on or outside the constraints, moved inside."""

import numpy as np

from edtk.design.space import Space
from edtk.system.typing import Array

# An interior-point method cannot start on a constraint, where the barrier is infinite. Starts keep
# this distance from constraints [m, rad], and from bounds in parts of their range.
MARGIN = 1e-3
ROUNDS = 10  # Gauss-Newton steps; two or three are the rule, and a pose that needs more is lost
OVERSHOOT = 1.5  # of the step to a constraint, so that a curved one is passed in few rounds
RIDGE = 1e-9  # keeps the steps finite where gradients of violated constraints are dependent


def inward(space: Space, x: Array) -> Array:
    """Move experiments off bounds and constraints; those already inside stay as they are.

    Each round solves ``G dx = 1.5 (margin - s)`` for the slacks s that are below the margin, with
    the gradients G of these slacks, by the shortest dx: a Gauss-Newton step on the violation.

    Args:
        space: Feasible set and movable variables.
        x: Design variables (..., v).

    Returns:
        Design variables (..., v) of which some may still be outside.
    """
    x = np.array(x)
    move = space.movable
    lower, upper = space.limits[:, move]
    edge = MARGIN * (upper - lower)
    for _ in range(ROUNDS):
        x[..., move] = np.clip(x[..., move], lower + edge, upper - edge)
        here = space.at(x)
        short = np.maximum(MARGIN - here.slack, 0.0)
        if not short.any():
            break
        G = here.slack_gradient[..., move] * (short > 0)[..., None]
        transposed = np.swapaxes(G, -1, -2)
        K = G @ transposed + RIDGE * np.eye(G.shape[-2])
        pushes = np.linalg.solve(K, OVERSHOOT * short[..., None])
        x[..., move] += (transposed @ pushes)[..., 0]
    return x
