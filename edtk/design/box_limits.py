"""Bounds of the variables of a box."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.errors import ArgumentError
from edtk.system.typing import Array


def box_limits(low: ArrayLike, high: ArrayLike) -> Array:
    """Make the bounds (2, d) of d variables from two lists, or of one from two numbers.

    Args:
        low: Lower bounds (d,).
        high: Upper bounds (d,).

    Raises:
        ArgumentError: They are not finite, or one is not below the other.
    """
    try:
        lower = np.atleast_1d(np.asarray(low, dtype=float))
        upper = np.atleast_1d(np.asarray(high, dtype=float))
    except (TypeError, ValueError) as error:
        message = "expected numbers, one for each variable"
        raise ArgumentError(message, argument="low, high") from error
    if lower.ndim != 1 or lower.shape != upper.shape or not lower.size:
        raise ArgumentError(
            f"{upper.shape} beside low of {lower.shape}; expected one bound a variable",
            argument="high",
        )
    limits = np.stack([lower, upper])
    if not np.isfinite(limits).all():
        raise ArgumentError("a bound is not finite; expected a box", argument="low, high")
    if not (lower < upper).all():
        i = int(np.argmin(upper - lower))
        raise ArgumentError(
            f"bounds {lower[i]:g} and {upper[i]:g} of variable {i + 1}; expected low < high",
            argument="low, high",
        )
    return limits
