"""Whether a matrix is positive semidefinite, but for rounding."""

import numpy as np

from criteria.linalg.root import unit_scale
from criteria.linalg.typing import Array, Mask

# A negative eigenvalue at unit diagonal that may be rounding of whoever computed the matrix: a
# gradient is a product of ill-conditioned ones. Who must not trust its author lifts it besides.
NEGATIVE = 1e-10


def is_semidefinite(Z: Array) -> Mask:
    """Which symmetric matrices (..., p, p) have no negative eigenvalue but rounding; nan has.

    Eigenvalues are those at unit diagonal, which do not depend on the units of the parameters.
    """
    return np.asarray(least_scaled_eigenvalue(Z) >= -NEGATIVE * Z.shape[-1])


def least_scaled_eigenvalue(Z: Array) -> Array:
    """Least eigenvalue (...) of symmetric matrices (..., p, p) at unit diagonal; nan is -inf."""
    finite = np.asarray(np.isfinite(Z).all(axis=(-2, -1)))
    safe = np.where(finite[..., None, None], Z, 0.0)
    d = unit_scale(np.abs(np.diagonal(safe, axis1=-2, axis2=-1)))
    least = np.linalg.eigvalsh(safe / d[..., :, None] / d[..., None, :])[..., 0]
    return np.asarray(np.where(finite, least, -np.inf))
