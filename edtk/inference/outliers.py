"""Measurements that do not belong to the others."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, f

Array = NDArray[np.float64]
LEVEL = 0.01  # probability of flagging anything at all in data without outliers


def find_outliers(Q: Array, z: Array, dof: float, scale: float | None = None) -> NDArray[np.int_]:
    """Rows (measurements of one marker, all coordinates together) that are outliers at 1 %, Bonferroni-corrected.

    With H_i = Q_i Q_i' the block of the hat matrix, ``T_i = z_i' (I - H_i)^-1 z_i`` is what the sum of squares S loses
    when row i is left out. Externally studentised, against the scatter of the others,
    ``(T_i / r) / ((S - T_i) / (dof - r))`` has the F distribution with (r, dof - r) degrees of freedom, where r is the
    number of coordinates in the row. Row i is flagged where that is exceeded with a probability below 0.01/m. So it
    does not matter whether sigma is believed; but several outliers can hide each other. With a robust scale given,
    ``T_i / (r scale^2)`` is compared with F(r, dof), or chi-square where dof is infinite, and they cannot; the level
    is approximate then, as residuals of a robust fit are not quite those of least squares (simulated: 3 % for 1 %).

    Args:
        Q: Orthonormal regressors (m, rows, p).
        z: Residuals in units of the given noise (m, rows).
        dof: Degrees of freedom of the fit, or of the scale.
        scale: A scale that outliers do not spoil; None for that of the other rows.

    Returns:
        Indices of the rows, counted from 0.
    """
    T, r = _deletion(Q, z)
    if scale is not None and np.isinf(dof):
        p = chi2.sf(T / max(scale, np.finfo(float).tiny) ** 2, r)
    else:
        rest = dof - r if scale is None else np.full(len(r), dof)
        able = (rest > 0) & (r > 0)
        total = (z**2).sum()
        spread = (
            (total - T) / np.where(able, rest, 1) if scale is None else np.full(len(r), scale**2)
        )
        least = 1e-20 * total + np.finfo(float).tiny  # where one row is all that scatters
        ratio = T / np.where(able, r, 1) / np.maximum(spread, least)
        p = np.where(able, f.sf(ratio, np.where(able, r, 1), np.where(able, rest, 1)), 1.0)
    return np.flatnonzero(p < LEVEL / len(T))


def _deletion(Q: Array, z: Array) -> tuple[Array, NDArray[np.int_]]:
    """T_i (m,) and its degrees of freedom (m,): fewer than rows where only row i tells of some parameter."""
    keep = np.eye(z.shape[1]) - Q @ np.swapaxes(Q, 1, 2)
    rank = np.full(len(z), z.shape[1])
    T = np.zeros(len(z))
    alone = (
        np.trace(Q @ np.swapaxes(Q, 1, 2), axis1=1, axis2=2) > 0.99
    )  # else I - H_i is far from singular
    T[~alone] = (z[~alone] * np.linalg.solve(keep[~alone], z[~alone, :, None])[..., 0]).sum(axis=1)
    if alone.any():
        w, V = np.linalg.eigh(keep[alone])
        tested = w > 1e-9
        along = np.einsum("mrs,mr->ms", V, z[alone])
        T[alone] = np.where(tested, along**2 / np.where(tested, w, 1.0), 0.0).sum(axis=1)
        rank[alone] = tested.sum(axis=1)
    return T, rank
