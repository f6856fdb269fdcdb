"""A maximum, or a smooth one a little above it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def soft_maximum(x: NDArray[np.floating[Any]], sharpness: float) -> tuple[Array, Array]:
    """``f = (sum x_i^s)^(1/s)`` of positive x along the last axis, and its derivatives ``(x_i/f)^(s-1)``.

    ``max x <= f <= n^(1/s) max x``; for s = inf it is the maximum itself, and the derivative that of one largest
    entry.

    Args:
        x: Positive numbers (..., n).
        sharpness: s, above one; inf for the maximum.
    """
    top = x.max(axis=-1, keepdims=True)
    if np.isinf(sharpness):
        return top[..., 0], (np.arange(x.shape[-1]) == x.argmax(axis=-1)[..., None]).astype(float)
    ratio = x / top
    total = (ratio**sharpness).sum(axis=-1, keepdims=True) ** (1.0 / sharpness)
    return (top * total)[..., 0], (ratio / total) ** (sharpness - 1.0)


def conjugate(V: Array, d: Array) -> Array:
    """``V diag(d) V'`` (..., p, p)."""
    return (V * d[..., None, :]) @ np.swapaxes(V, -1, -2)
