"""Which joint value of a pose was mistyped, and by how much."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edtk.inference.distributions import chi_square_tail
from edtk.inference.least_squares import Estimate
from edtk.inference.measurements import Measurements
from edtk.inference.whiten import whiten
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array, Indices

# Values tried over a turn; the deflection has at most two periods in it, so that this is fine.
GRID = np.deg2rad(np.arange(-180.0, 180.0, 1.0))
FINER = np.linspace(-1.0, 1.0, 33)  # many values at once cost little more than one
REFINEMENTS = 3  # finer grids, from a degree to less than a thousandth of one
BEND = np.deg2rad(0.1)  # step of the second derivative of the misfit
LEAST_BEND = 1e-6  # of the misfit over such a step: measurements hardly tell the joint
FITS = 0.01  # probability of residuals as large, from which a joint explains them
CLEARLY = 9.0  # chi-square by which a joint must be better than every other one


@dataclass(frozen=True)
class MistypedJoint:
    """A joint value that explains the measurements of a pose.

    Attributes:
        joint: Index of the joint.
        change: The value that explains them less the written one [rad].
        misfit: Sum of squares over sigma that it leaves.
        alone: Whether it explains them much better than any other joint does.
        std: Standard deviation of the change [rad], from the curvature of the misfit.
    """

    joint: int
    change: float
    misfit: float
    alone: bool
    std: float


def mistyped_joint(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    others: Estimate,
    rows: Indices,
    joints: tuple[int, ...],
) -> MistypedJoint | None:
    """Find the one joint whose change explains the measurements of one pose.

    Args:
        model: The robot with its calibration tool.
        data: The measurements.
        measured: Deflections (m, rows) [m, rad].
        others: Compliances from the other poses, with their covariance.
        rows: Rows of the pose.
        joints: Joints that were written by hand: revolute ones.

    Returns:
        The joint that explains them best; None if none does.
    """
    here = data[rows]
    found = []
    for joint in joints:

        def misfit(change: Array, joint: int = joint) -> Array:
            """Sum of squares (c,) over sigma for changes (c,) of the joint [rad]."""
            return _misfit(model, here, measured[rows], others, joint, change)

        on_grid = misfit(GRID)
        best = float(GRID[int(on_grid.argmin())])
        change = _minimum(misfit, best)
        below, at, above = misfit(change + BEND * np.array([-1.0, 0.0, 1.0])).tolist()
        std = BEND * float(np.sqrt(2 / max(below - 2 * at + above, LEAST_BEND)))
        found.append((at, joint, change, std))
    found.sort()
    if not found:
        return None
    least, joint, change, std = found[0]
    if chi_square_tail(least, max(measured[rows].size - 1, 1)) < FITS:
        return None
    alone = len(found) == 1 or found[1][0] > least + CLEARLY
    return MistypedJoint(joint, change, least, alone, std)


def _misfit(
    model: ElastostaticModel,
    here: Measurements,
    measured: Array,
    others: Estimate,
    joint: int,
    change: Array,
) -> Array:
    """Sums of squares (c,) of a pose's residuals, for changes (c,) of one joint's shown value.

    The other poses leave the compliances uncertain, ``k = k0 + T u`` with ``T T'`` their covariance
    and u of size one: what remains of the residuals z with the regressors X is
    ``min |z - X T u|^2 + |u|^2 = z'z - g' (I + B'B)^-1 g`` with ``B = X T`` and ``g = B'z``. It is
    what the joint adds to the sum of squares of all rows where the compliances are fitted anew.
    """
    m = len(here)
    which = np.tile(np.arange(m), len(change))
    many = replace(here, covariance=None)[which]
    shown = model.robot.shown(many.q).copy()
    shown[:, joint] += np.repeat(change, m)
    q = model.robot.of_shown(shown)
    A = replace(many, q=q).regressor(model)
    residual = measured[which] - A @ others.k
    z = whiten(residual.reshape(len(change), *measured.shape), here.noise)
    z = z.reshape(len(change), -1)
    std = others.std
    B = A @ (std[:, None] * np.linalg.cholesky(others.correlation))
    B = whiten(np.moveaxis(B, -1, 0).reshape(-1, len(change), *measured.shape), here.noise)
    B = np.moveaxis(B, 0, -1).reshape(len(change), -1, len(std))
    g = (B * z[..., None]).sum(axis=1)
    gram = np.eye(len(std)) + np.swapaxes(B, 1, 2) @ B
    taken = (g * np.linalg.solve(gram, g[..., None])[..., 0]).sum(axis=1)
    return np.asarray((z**2).sum(axis=1) - taken)


def _minimum(misfit: Callable[[Array], Array], centre: float) -> float:
    """The minimum within a grid step of a value, by finer and finer grids."""
    reach = float(GRID[1] - GRID[0])
    for _ in range(REFINEMENTS):
        near = centre + reach * FINER
        centre = float(near[int(misfit(near).argmin())])
        reach *= float(FINER[1] - FINER[0])
    return centre
