"""The primal-dual step of each start: its direction, and the barrier that it is taken with."""

from dataclasses import dataclass

import numpy as np

from edtk.design.interior_point.barrier import reachable, shortened
from edtk.design.interior_point.newton_direction import newton_direction
from edtk.design.interior_point.state import State
from edtk.system.typing import Array

# Weight of the barrier below which a start is near its end: the eigenvalues of its whole Hessian
# are then worth their price, as a saddle would hold it up for good. Of many variables that price is
# most of a step's, and is paid later: plans of twelve experiments became no worse.
LATE = 1e-4
LATE_OF_MANY = 1e-5
MANY = 36


@dataclass(frozen=True, eq=False)
class SearchDirection:
    """Steps of b starts.

    Attributes:
        mu: Weights (b,) of the barrier.
        dy: Steps (b, k, d) of the movable variables.
        ds: Changes (b, k, c) of the slacks, to first order.
        dz: Steps (b, k, c) of the multipliers.
        slope: Slopes (b,) of the barrier function along dy; negative, as the steps lead down.
    """

    mu: Array
    dy: Array
    ds: Array
    dz: Array
    slope: Array


def search_direction(state: State) -> SearchDirection:
    """Solve the primal-dual equations, with the barrier that Mehrotra's rule chooses.

    With the gradients G of the slacks s, the Hessian H of the Lagrangian ``f - z's`` and
    ``W = diag(z/s)``,

        (H + G' W G) dy = -(grad f - mu G' (1/s)),    dz = mu/s - z - W G dy,

    which is Eq. (19.12) of Nocedal and Wright with the slacks eliminated. Its right-hand side is
    linear in mu, and so is ``dy = affine + mu centring``. Both are solved at once; then mu is the
    mean of ``s z`` to which the affine step alone would lead, within the bounds of the state.
    """
    here = state.point
    s = here.slack
    z = state.z
    G = here.slack_slope
    C = here.slack_curvature
    W = z / s
    # Slacks of bounds are linear, so that only the first ones bend the Lagrangian.
    bent = np.einsum("bkc,bkcij->bkij", z[..., : C.shape[2]], C)
    own = here.own - bent + np.swapaxes(G * W[..., None], -1, -2) @ G
    inwards = ((1.0 / s)[..., None, :] @ G)[..., 0, :]
    right = np.stack([here.slope, -inwards])
    late = LATE_OF_MANY if here.joint.shape[-1] > MANY else LATE
    affine, centring = newton_direction(own, here.joint, right, state.mu < late)
    predicted = reachable(s, z, here.slack_change(affine), shortened(affine))
    mu = np.clip(predicted, *state.bounds)
    each = mu[:, None, None]
    slope = here.slope - each * inwards
    dy = affine + each * centring
    dy *= shortened(dy)
    ds = here.slack_change(dy)
    dz = each / s - z - W * ds
    return SearchDirection(mu, dy, ds, dz, (slope * dy).sum(axis=(1, 2)))
