"""A maximum, or a smooth function a little above it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.typing import Array


def soft_maximum(x: NDArray[np.floating[Any]], sharpness: float) -> tuple[Array, Array]:
    """``f = (sum x_i^s)^(1/s)`` of positive x along the last axis, with its derivatives.

    The derivatives are ``(x_i/f)^(s-1)``, and ``max x <= f <= n^(1/s) max x``. For s = inf, f is
    the maximum itself, and the derivatives are one at a single largest entry and zero elsewhere.

    Args:
        x: Positive numbers (..., n).
        sharpness: s, above one; inf for the maximum.

    Returns:
        f (...) and its derivatives (..., n).
    """
    top = x.max(axis=-1, keepdims=True)
    if np.isinf(sharpness):
        is_first_largest = np.arange(x.shape[-1]) == x.argmax(axis=-1)[..., None]
        return top[..., 0], is_first_largest.astype(float)
    # Divided by the largest, no power overflows, whatever the units of x are.
    ratio = x / top
    total = (ratio**sharpness).sum(axis=-1, keepdims=True) ** (1.0 / sharpness)
    return (top * total)[..., 0], (ratio / total) ** (sharpness - 1.0)
