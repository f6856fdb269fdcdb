"""Measurements that do not belong to the others."""

import numpy as np

from edtk.inference.distributions import chi_square_tail, fisher_tail
from edtk.system.typing import Array, Indices

# Probability of flagging anything at all in data without outliers.
LEVEL = 0.01

# A row whose leverages sum to more may alone determine a parameter: I - H_i is then near singular.
ALONE = 0.99

# Eigenvalues of I - H_i below this are zeros: the fit runs through that coordinate.
DETERMINED = 1e-9


def find_outliers(
    Q: Array, z: Array, dof: float, scale: float | None = None, total: float | None = None
) -> Indices:
    """Find rows (measurements of one marker, all coordinates together) that are outliers at 1 %.

    With ``H_i = Q_i Q_i'`` the block of the hat matrix, ``T_i = z_i' (I - H_i)^-1 z_i`` is the drop
    of the sum of squares S when row i is left out. Externally studentised, against the scatter of
    the others, ``(T_i / r) / ((S - T_i) / (dof - r))`` has the F distribution with (r, dof - r)
    degrees of freedom, where r is the number of coordinates in the row. Row i is flagged where that
    is exceeded with a probability below 0.01/m (Bonferroni). So it does not matter whether sigma is
    believed; but several outliers can hide each other.

    With a robust scale given, ``T_i / (r scale^2)`` is compared with F(r, dof), or chi-square where
    dof is infinite, and outliers cannot hide each other; the level is approximate then, as
    residuals of a robust fit are not quite those of least squares (simulated: 3 % for 1 %).

    Args:
        Q: Orthonormal regressors (m, rows, p).
        z: Residuals in units of the given noise (m, rows).
        dof: Degrees of freedom of the fit, or of the scale.
        scale: A scale that outliers do not spoil; None for that of the other rows.
        total: The sum of squares S; None for that of z. It is another one where errors are
            correlated, see `Whitened.deletable`.

    Returns:
        Indices of the rows, counted from 0.
    """
    T, r = _deletion(Q, z)
    if scale is not None and np.isinf(dof):
        squares = T / max(scale, np.finfo(float).tiny) ** 2
        p = np.where(r > 0, chi_square_tail(squares, np.maximum(r, 1)), 1.0)
    else:
        p = _studentised(T, r, (z**2).sum() if total is None else total, dof, scale)
    return np.flatnonzero(p < LEVEL / len(T))


def _studentised(T: Array, r: Indices, total: float, dof: float, scale: float | None) -> Array:
    """Probability (m,) of a larger T_i under Fisher's law; one where nothing can be compared."""
    rest = dof - r if scale is None else np.full(len(r), dof)
    able = (rest > 0) & (r > 0)
    numerator_dof = np.where(able, r, 1)
    denominator_dof = np.where(able, rest, 1)
    spread = (total - T) / denominator_dof if scale is None else np.full(len(r), scale**2)
    least = 1e-20 * total + np.finfo(float).tiny  # where one row is all that scatters
    ratio = T / numerator_dof / np.maximum(spread, least)
    return np.where(able, fisher_tail(ratio, numerator_dof, denominator_dof), 1.0)


def _deletion(Q: Array, z: Array) -> tuple[Array, Indices]:
    """T_i (m,) and its degrees of freedom (m,): fewer than rows where row i alone fixes parameters.

    A row that alone tells of some parameter has an I - H_i that is singular: only the coordinates
    that other rows tell of too can be tested, in its eigenvectors.
    """
    hat = Q @ np.swapaxes(Q, 1, 2)
    keep = np.eye(z.shape[1]) - hat
    rank = np.full(len(z), z.shape[1])
    T = np.zeros(len(z))
    alone = np.trace(hat, axis1=1, axis2=2) > ALONE
    solved = np.linalg.solve(keep[~alone], z[~alone, :, None])[..., 0]
    T[~alone] = (z[~alone] * solved).sum(axis=1)
    if alone.any():
        w, V = np.linalg.eigh(keep[alone])
        tested = w > DETERMINED
        component = np.einsum("mrs,mr->ms", V, z[alone])
        squares = np.where(tested, component**2 / np.where(tested, w, 1.0), 0.0)
        T[alone] = squares.sum(axis=1)
        rank[alone] = tested.sum(axis=1)
    return T, rank
