"""How large the error |b + A dk| of a compensation may be that is off by b on average."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.inference.distributions import chi_square_quantile
from edtk.inference.error_quantiles import error_quantiles
from edtk.system.typing import Array

# The quantiles of 2.5 and 97.5 % are then off by up to 6e-3 and 1e-3 of themselves.
POINTS = 2**14


def offset_error_quantiles(
    A: Array, cov: Array, mean: Array, levels: ArrayLike, dof: float = np.inf
) -> Array:
    """Quantiles of ``|b + A dk|`` for errors dk with that covariance, and known offsets b.

    Without an offset they are those of `error_quantiles`, exactly. With one, the Laplace transform
    has essential singularities where that one has branch points, and its inversion loses all digits
    for large offsets. So the distribution is that of a fixed, evenly spread set of points: a
    lattice in the unit cube (Roberts' generalised golden ratio), mapped to normal variables along
    the axes of ``A cov A'``, and to a chi-square for the estimated noise.

    Args:
        A: Regressors (t, rows, p) of the task poses [m/(rad/(N m))].
        cov: Covariance (p, p) of the compliances; if dof is finite, the estimated one.
        mean: Offsets b (t, rows) [m].
        levels: Probabilities (c,) strictly between 0 and 1.
        dof: Degrees of freedom of the covariance; inf where sigma is known.

    Returns:
        Quantiles (t, c) [m].
    """
    from scipy.special import ndtri

    levels = np.asarray(levels, dtype=float)
    found = np.zeros((len(A), len(levels)))
    offset = mean.any(axis=-1)
    found[~offset] = error_quantiles(A[~offset], cov, levels, dof)
    rows = A.shape[1]
    points = _lattice(rows + 1)
    z = ndtri(points[:, :rows])
    if np.isfinite(dof):
        z /= np.sqrt(chi_square_quantile(points[:, rows:], dof) / dof)
    spectrum, axes = np.linalg.eigh(A @ cov @ np.swapaxes(A, 1, 2))
    for i in np.flatnonzero(offset):
        along = z * np.sqrt(np.maximum(spectrum[i], 0.0)) + mean[i] @ axes[i]
        found[i] = np.quantile(np.linalg.norm(along, axis=1), levels)
    return found


def _lattice(dimension: int) -> Array:
    """Points (POINTS, dimension) that fill the open unit cube evenly."""
    # The generalised golden ratio is the root of g^(d+1) = g + 1.
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    steps = ratio ** -np.arange(1, dimension + 1)
    return (0.5 + np.arange(1, POINTS + 1)[:, None] * steps) % 1.0
