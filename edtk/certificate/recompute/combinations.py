"""Combinations of the parameters that a certificate's criterion is about."""

from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import numbers
from edtk.system.typing import Array

DEPENDENT = 1e-10  # least singular value of independent combinations of length one
EPS = float(np.finfo(float).eps)


def combinations(value: Any, p: int, where: str) -> Array:
    """Combinations K (p, s), one a column.

    Raises:
        ValueError: They are not finite, or depend on each other.
    """
    K = numbers(value, (p, None), where)
    if not 0 < K.shape[1] <= p or not np.abs(K).max(axis=0).all():
        raise ValueError(f"{where}: expected from one to {p} columns, none of them zero")
    if np.linalg.svd(K / np.linalg.norm(K, axis=0), compute_uv=False)[-1] < DEPENDENT:
        raise ValueError(f"{where}: a column follows from the others")
    return K


def deviations(stacked: Array, K: Array) -> Array | None:
    """L (s, r) with ``L L'`` the covariance of K'k, from whitened rows (N, p); None if K'k is open.

    With columns of unit length, ``stacked / d = U S V'``, ``L = (K/d)' V S^-1`` over the singular
    values that are more than rounding. K'k is known if K/d has no part in the other directions.
    """
    length = np.linalg.norm(stacked, axis=0)
    d = np.where(length > len(stacked) * EPS * length.max(), length, 1.0)
    unit = np.where(length > len(stacked) * EPS * length.max(), stacked, 0.0) / d
    # Rows of zeros make V square; to ask for a square one would make U (N, N), too.
    unit = np.pad(unit, ((0, max(unit.shape[1] - len(unit), 0)), (0, 0)))
    _, s, V = np.linalg.svd(unit, full_matrices=False)
    # Rows have half the digits of their squares to lose; M itself counts as singular at 16 p eps.
    is_known = s > 4 * np.sqrt(len(d) * EPS)
    scaled = K / d[:, None]
    outside = np.abs(V[~is_known] @ scaled).max(axis=0, initial=0.0)
    least = s[is_known].min(initial=1.0)
    allowed = 64 * len(d) * EPS / least**2 * np.linalg.norm(scaled, axis=0)
    if not is_known.any() or (outside > allowed).any():
        return None
    return np.asarray(scaled.T @ V[is_known].T / s[is_known])
