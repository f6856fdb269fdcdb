"""Newton directions of the barrier function, for many starts at once."""

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.spectrum import conjugate

Array = NDArray[np.float64]
LARGE = 200  # order of a matrix of which no eigenvalues are taken
LEAST = 1e-3  # size of an eigenvalue whose sign is changed


def direction(own: Array, joint: Array, slope: Array, late: NDArray[np.bool_]) -> Array:
    """Steps (..., b, k, d) down: ``-K^-1 slope``, where K has negative eigenvalues with their signs changed.

    Blocks and what couples them are mended apart at first, which is cheap; near the end all of K is, so that no start
    is held up at a saddle, unless K is large.

    Args:
        own: Blocks (b, k, d, d) of the Hessian K, one for each experiment.
        joint: What is to be added to them (b, kd, kd).
        slope: Slopes (..., b, k, d).
        late: Which starts (b,) are near their end.
    """
    K = _sum(own, joint)
    bent, whole = ~_positive(K), late & (K.shape[-1] <= LARGE)
    early, saddle = np.flatnonzero(bent & ~whole), np.flatnonzero(bent & whole)
    if len(early):
        K[early] = _sum(_mended(own[early]), joint[early])
    if len(saddle):
        K[saddle] = _mended(K[saddle])
    right = -slope.reshape(-1, *K.shape[:2]).transpose(1, 2, 0)
    return np.asarray(np.linalg.solve(K, right).transpose(2, 0, 1).reshape(slope.shape))


def _sum(own: Array, joint: Array) -> Array:
    """Matrices (b, kd, kd): joint ones with own blocks (b, k, d, d) added on their diagonal."""
    b, k, d, _ = own.shape
    K, each = joint.copy(), np.arange(k)
    K.reshape(b, k, d, k, d)[:, each, :, each] += np.swapaxes(own, 0, 1)
    K += 1e-12 * np.diagonal(K, axis1=1, axis2=2).max(axis=1)[:, None, None] * np.eye(k * d)
    return K


def _positive(K: Array) -> NDArray[np.bool_]:
    """Whether each matrix (b, n, n) is positive definite."""
    try:
        np.linalg.cholesky(K)
    except np.linalg.LinAlgError:
        return (
            np.array([False])
            if len(K) == 1
            else np.concatenate([_positive(half) for half in np.array_split(K, 2)])
        )
    return np.ones(len(K), dtype=bool)


def _mended(K: Array) -> Array:
    """Symmetric matrices (..., n, n) with the signs of negative eigenvalues changed."""
    e, V = np.linalg.eigh(K)
    return conjugate(V, np.where(e < LEAST, np.maximum(np.abs(e), LEAST), e))
