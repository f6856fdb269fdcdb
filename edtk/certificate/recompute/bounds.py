"""Lower bounds that multipliers prove: every design X obeys ``<Z_j, X> <= t_j`` for all j.

The closed forms are derived in the documentation, page "Bounds". Multipliers come from a file, so that
nothing of them is believed: they must be finite, symmetric and, where the form needs it, positive
semidefinite.
"""

from itertools import combinations

import numpy as np

from edtk.certificate.recompute.values import DEGREE
from edtk.system.typing import Array

INDEFINITE = ("O2", "O4")  # criteria whose multipliers may have negative eigenvalues
ROUNDING = 1e-9  # of an eigenvalue, beside the largest one, at unit diagonal
WEIGHT_STEPS = 20  # towards the best weights of the variances for G; any weights prove a bound


def require_multipliers(name: str, Z: Array, p: int) -> None:
    """Check that multipliers (r, p, p) can prove anything.

    Raises:
        ValueError: Their shape is wrong, or they are not finite, not symmetric or not psd.
    """
    if Z.ndim != 3 or Z.shape[1:] != (p, p) or not len(Z):
        raise ValueError(f"the multipliers have shape {Z.shape}, expected (r, {p}, {p})")
    if not np.isfinite(Z).all():
        raise ValueError("a multiplier is not finite")
    size = np.abs(Z).max(axis=(1, 2), keepdims=True)
    if (np.abs(Z - np.swapaxes(Z, 1, 2)) > 1e-9 * size).any():
        raise ValueError("a multiplier is not symmetric")
    if name not in INDEFINITE:
        scale = np.sqrt(np.maximum(np.diagonal(Z, axis1=1, axis2=2), 0.0))
        scale = np.where(scale > 0, scale, 1.0)
        unit = Z / (scale[:, :, None] * scale[:, None])
        if (np.linalg.eigvalsh(unit)[:, 0] < -ROUNDING * p).any():
            raise ValueError("a multiplier is not positive semidefinite")


def lower_bound(name: str, Z: Array, t: Array, target: Array | None, M: Array) -> float:
    """The least cost that any design can have.

    Args:
        name: One of the ten criteria.
        Z: Multipliers (r, p, p).
        t: Their largest sensitivities (r,); those of O2 are per trace.
        target: A0 (3, p), for rho0.
        M: The information matrix (p, p) of the design, near which the bound of G is tight.
    """
    if name == "O2":
        return max(_condition_number(z, top) for z, top in zip(Z, t, strict=True))
    if name == "O4":
        return _noise_amplification(Z, t)
    found = 0.0
    for z, top in zip(Z, t, strict=True):
        if top > 0:
            found = max(found, _polar(name, z, target, M) * top ** -DEGREE[name])
    return found


def _polar(name: str, Z: Array, target: Array | None, M: Array) -> float:
    """The least cost of any X with ``<Z, X> <= 1``."""
    p = len(Z)
    if name in ("D", "O1"):
        sign, log_det = np.linalg.slogdet(Z)
        determinant = p * np.exp(log_det / p) if sign > 0 else 0.0
        return float(determinant if name == "D" else np.sqrt(determinant))
    if name in ("E", "O3"):
        trace = float(np.trace(Z))
        return trace if name == "E" else float(np.sqrt(trace))
    if name == "G":
        return _largest_variance(Z, M)
    roots = _roots(Z if name != "rho0" or target is None else target @ Z @ target.T)
    if name == "A":
        return float(roots.sum() ** 2)
    if name == "rho0":
        return float(roots.sum())
    return float((roots ** (2 / 3)).sum() ** 1.5)  # O5


def _roots(Z: Array) -> Array:
    """Roots of the eigenvalues (p,) of a positive semidefinite matrix, as singular values of a factor."""
    scale = np.sqrt(np.maximum(np.diag(Z), 0.0))
    scale = np.where(scale > 0, scale, 1.0)
    values, V = np.linalg.eigh(Z / np.outer(scale, scale))
    factor = np.sqrt(np.maximum(values, 0.0))[:, None] * V.T * scale
    return np.linalg.svd(factor, compute_uv=False)


def _largest_variance(Z: Array, M: Array) -> float:
    """The best of ``(trace (U^1/2 Z U^1/2)^1/2)^2`` over weights u of sum one, by a fixed-point iteration."""
    best = 0.0
    variances = np.diag(np.linalg.inv(M))
    relevance = np.diag(M @ Z @ M) * variances
    natural = np.where(relevance > 1e-8 * relevance.max(), relevance / variances, 0.0)
    largest = (variances == variances.max()).astype(float)
    for weights in (natural, largest):
        for _ in range(WEIGHT_STEPS):
            root = np.sqrt(weights / weights.sum())
            values, V = np.linalg.eigh(root[:, None] * Z * root)
            values = np.sqrt(np.maximum(values, 0.0))
            best = max(best, float(values.sum() ** 2))
            weights = (V**2) @ values
    return best


def _condition_number(Z: Array, t: float) -> float:
    """``s_1/s_p >= (trace Y+ / trace Y-)^1/2`` with ``Y = Z - t I``, for designs of trace one."""
    y = np.linalg.eigvalsh(Z - t * np.eye(len(Z)))
    positive = y[y > 0].sum()
    negative = -y[y < 0].sum()
    return float(np.sqrt(max(1.0, positive / negative))) if negative > 0 else 1.0


def _noise_amplification(Z: Array, t: Array) -> float:
    """The least ``(s kappa)^1/2`` over ``t s + trace(Z-) kappa >= trace(Z+), s >= 0, kappa >= 1``.

    The product is quasiconcave where both are positive, so that its least value is at a corner.
    """
    z = np.linalg.eigvalsh(Z)
    positive = np.maximum(z, 0.0).sum(axis=1)
    negative = np.maximum(-z, 0.0).sum(axis=1)
    unit = float(np.median(positive[positive > 0] / t[positive > 0]))  # of s, for good scaling
    planes = np.column_stack([t * unit, negative, positive])[positive > 0]
    planes = planes / planes[:, 2:]
    planes = np.vstack([planes, [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]])
    least = np.inf
    for a, b in combinations(planes, 2):
        lines = np.stack([a[:2], b[:2]])
        if abs(np.linalg.det(lines)) <= 1e-14 * np.linalg.norm(a[:2]) * np.linalg.norm(b[:2]):
            continue
        corner = np.linalg.solve(lines, [a[2], b[2]])
        if (planes[:, :2] @ corner >= planes[:, 2] - 1e-9).all():
            least = min(least, float(np.prod(np.maximum(corner, 0.0))))
    return float(np.sqrt(least * unit)) if np.isfinite(least) else 0.0
