"""Eigenvalues: matrices made of them, definite parts, and constraints on them in cvxpy."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.linalg.graded_parts import ROUNDING, graded_parts
from criteria.linalg.root import root, unit_scale
from criteria.linalg.typing import Array

if TYPE_CHECKING:
    import cvxpy as cp

# Ratio of the roots of diagonal entries from which on a matrix is graded: the square of it is lost
# in its eigenvalues.
GRADED = 1e3


def conjugate(V: Array, d: Array) -> Array:
    """``V diag(d) V'`` (..., p, p) of V (..., p, p) and d (..., p)."""
    return (V * d[..., None, :]) @ np.swapaxes(V, -1, -2)


def extreme_eigenvalues(T: Array) -> tuple[float, float]:
    """Least and largest eigenvalue of the information that T whitens, ``(T T')^-1``."""
    # In uneven units the least singular value is a rounding of the largest, and that of the inverse
    # is a largest one.
    return float(np.linalg.norm(T, 2) ** -2), float(np.linalg.norm(np.linalg.inv(T), 2) ** 2)


def sharp_variances(cov: Array) -> Array:
    """Eigenvalues (..., p) of covariances (..., p, p) whose roots are right beside the largest.

    Eigenvalues of a graded matrix are known beside the largest of all, and roots of the small ones
    to half the digits. The singular values of a root, formed at unit diagonal, are these roots.
    """
    found = np.linalg.eigvalsh(cov)
    d = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
    graded = d.max(axis=-1) > GRADED * d.min(axis=-1)
    if graded.any():
        found[graded] = np.square(np.linalg.svd(root(cov[graded]), compute_uv=False)[..., ::-1])
    return np.maximum(found, 0.0)


def definite_parts(Z: Array) -> Array:
    """``trace(Z+)`` and ``trace(Z-)`` (2, ...) of ``Z = Z+ - Z-`` (..., p, p), safe for bounds.

    A bound must not profit from rounding: the positive part is lowered, and the negative part is
    raised, by what rounding may have changed. So a bound on ``trace(Z+)/trace(Z-)`` is lowered by
    the part ``16 p eps`` times itself. Only a Z that is positive semidefinite after scaling to a
    unit diagonal has no negative part.

    Where the entries of Z are graded, and the negative part is beside its small ones, the parts are
    not those of the eigenvalues, but of `graded_parts`.
    """
    z = np.linalg.eigvalsh(Z)
    p = z.shape[-1]
    lost = ROUNDING * p * np.abs(z).max(axis=-1)
    positive = np.maximum(z, 0.0).sum(axis=-1)
    negative = -np.minimum(z, 0.0).sum(axis=-1)
    d = unit_scale(np.abs(np.diagonal(Z, axis1=-2, axis2=-1)))
    # In bad units an eigenvalue far below `lost` can be negative in truth; scaling shows it.
    least = np.linalg.eigvalsh(Z / (d[..., :, None] * d[..., None, :]))[..., 0]
    is_semidefinite = least >= -ROUNDING * p
    above = np.maximum(positive - lost, 0.0)
    below = np.where(is_semidefinite, 0.0, negative + lost)
    parts = np.stack([above, below])
    graded = ~is_semidefinite & (d.max(axis=-1) > GRADED * d.min(axis=-1))
    for i in np.argwhere(graded):
        found = graded_parts(Z[tuple(i)])
        if found is not None and found[1] < parts[(1, *i)]:
            parts[(slice(None), *i)] = found
    return parts


def bounded_below(M: "cp.Expression", T: Array) -> "cp.Constraint":
    """``T^-T M T^-1 >= l I`` as ``M >= l T'T``, l the least eigenvalue of what T whitens."""
    return M >> extreme_eigenvalues(T)[0] * (T.T @ T)


def largest_eigenvalue(M: "cp.Expression", T: Array) -> "cp.Expression":
    """Largest eigenvalue of ``T^-T M T^-1``, divided by that of what T whitens."""
    import cvxpy as cp

    S = np.linalg.inv(T) / np.sqrt(extreme_eigenvalues(T)[1])
    X = S.T @ M @ S  # symmetric, which cvxpy cannot tell
    return cp.lambda_max(0.5 * (X + X.T))
