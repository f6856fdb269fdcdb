"""Poses that are off, mistyped joints, and groups of rows that are off together."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.findings.causes.evidence import rarity, reading_rarity
from edtk.findings.causes.family import Cause, Tried
from edtk.fit.correlated_noise import whiten
from edtk.fit.distributions import chi_square_tail
from edtk.fit.least_squares import Estimate, SingularPlanError, Whitened
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array, Indices

REFINEMENTS = 3  # finer grids, from a degree to less than a thousandth of one
LEAST_BEND = 1e-6  # of the misfit over such a step: measurements hardly tell the joint
FITS = 0.01  # probability of residuals as large, from which they fit
CLEARLY_BETTER = 9.0  # chi-square by which a joint must be better than every other one
# Poses are mostly off by one joint value: how much rarer they are off otherwise, all repeats alike.
RARER_OTHERWISE = 5
SEEN = 1e-9  # share of a shift's information that residuals show, below which it is rounding


# Values tried over a turn; the deflection has at most two periods in it, so that this is fine.
GRID = np.deg2rad(np.arange(-180.0, 180.0, 1.0))
FINER = np.linspace(-1.0, 1.0, 33)  # many values at once cost little more than one
BEND = np.deg2rad(0.1)  # step of the second derivative of the misfit


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
    alone = len(found) == 1 or found[1][0] > least + CLEARLY_BETTER
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


USUAL_CHANGE = np.deg2rad(10.0)  # of a joint value that was mistyped, or not gone to


def wrong_pose(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    tried: Tried,
    typed: tuple[int, ...],
    by_prior: float = 0.0,
) -> Tried:
    """Explain the shift of a pose by one of its joint values.

    A joint value is one parameter, and a shift has three or six: where a joint explains the pose,
    that counts for it.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) [m, rad].
        tried: The pose with any shift.
        typed: Revolute joints whose values were written by hand.
        by_prior: What a prior adds to the sum of squares.

    Returns:
        The pose, with the joint if a single one explains it.
    """
    rows = np.array(tried.cause.rows)
    others = np.setdiff1d(np.arange(len(data)), rows)
    try:
        A = data[others].regressor(model)
        rest = Whitened.of(A, data.noise[others], model.parameters)
    except SingularPlanError:
        return tried
    k = rest.solve(measured[others])
    estimate = Estimate(k, rest.covariance)
    found = mistyped_joint(model, data, measured, estimate, rows, typed)
    if found is None:
        return replace(tried, tries=tried.tries * RARER_OTHERWISE)
    z = whiten(measured[others] - A @ k, data.noise[others])
    deviance = float((z**2).sum()) + found.misfit + by_prior
    cause = tried.cause
    if found.alone:
        name = model.robot.joint_names[found.joint]
        size = float(np.rad2deg(found.change))
        cause = replace(cause, size=size, unit="deg", joint=name)
    cost = float(rarity(np.array([found.change]), np.array([[found.std**2]]), USUAL_CHANGE))
    return Tried(cause, deviance, 1, tried.tries * len(typed), cost)


def shifted(
    whitened: Whitened,
    measured: Array,
    chi2: float,
    group: Indices,
    cause: str,
    usual: Array,
    units: Array | None = None,
) -> Iterator[Tried]:
    """Try each group of rows, such as a pose with all its repetitions, as shifted by a constant.

    Args:
        whitened: The factored regressors of the measurements.
        measured: Deflections (m, rows) [m, rad].
        chi2: Sum of squares without a shift.
        group: Number (m,) of each row's group.
        cause: Name of such a fault.
        usual: Sizes (c,) that the parts of a shift usually have [m, rad].
        units: What each unit of the shift adds to the measurements (m, rows, c); defaults to a unit
            of each coordinate.
    """
    numbers = np.unique(group)
    rows = [np.flatnonzero(group == number) for number in numbers]
    gram, along = by_shifts(whitened, whitened.residual(measured), rows, units)
    # In usual sizes; what springs take up of a shift, nobody sees.
    values, vectors = eigenpairs(gram * np.outer(usual, usual))
    seen = values > SEEN * values.sum(axis=1, keepdims=True)
    parts = ((along * usual)[:, None] @ vectors)[:, 0]
    back = np.divide(parts, values, out=np.zeros_like(parts), where=seen)
    drops = (parts * back).sum(axis=1)
    counts = seen.sum(axis=1)
    tails = chi_square_tail(drops, np.maximum(counts, 1))
    shifts = usual * (vectors @ back[..., None])[..., 0]
    for i in np.flatnonzero(counts):
        at, dims, shown = rows[i], int(counts[i]), seen[i]
        size = 1e3 * float(np.linalg.norm(shifts[i, :3]))
        found = Cause(cause, size, "mm", None, float(tails[i]), rows=tuple(at.tolist()))
        cost_of = rarity if len(at) > 1 else reading_rarity
        cost = float(cost_of(back[i, shown], np.diag(1 / values[i, shown]), float(np.sqrt(dims))))
        yield Tried(found, chi2 - float(drops[i]), dims, len(numbers), cost)


def by_shifts(
    whitened: Whitened, residual: Array, groups: Sequence[Indices], units: Array | None
) -> tuple[Array, Array]:
    """What the parameters leave of each group's shift.

    Returns:
        Products (g, c, c) of the columns of the shifts, and of them with the residuals (g, c).
    """
    if whitened.correlated is not None or len(groups) < len(residual):
        parts = []
        for at in groups:
            seen_in, shift = whitened.shift(at, units)
            onto = np.einsum("mrp,mrs->ps", whitened.Q[seen_in], shift)
            gram = np.einsum("mrs,mrt->st", shift, shift) - onto.T @ onto
            parts.append((gram, np.einsum("mrs,mr->s", shift, residual[seen_in])))
        grams, alongs = zip(*parts, strict=True)
        return np.stack(grams), np.stack(alongs)
    # Single rows with errors of their own: all at once.
    at = np.concatenate(groups)
    _, shift = whitened.shift(at, units)
    turned = np.swapaxes(shift, 1, 2)
    onto = turned @ whitened.Q[at]
    gram = turned @ shift - onto @ np.swapaxes(onto, 1, 2)
    return gram, (turned @ residual[at][..., None])[..., 0]
