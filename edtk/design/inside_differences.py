"""Derivatives of a function of a box by differences that never leave the box."""

from collections.abc import Callable

import numpy as np

from edtk.system.typing import Array

# Distance of the nodes in parts of a variable's range. A second-order difference errs by its square
# (truncation) and by eps over it (rounding): about 4e-11 each, of the change over a whole range of
# a function that is as smooth as a wave of that range.
STEP = float(np.finfo(float).eps ** (1 / 3))


def inside_differences(function: Callable[[Array], Array], x: Array, limits: Array) -> Array:
    """Differentiate by each variable: the slope at x of a parabola through three nodes.

    The nodes c - h, c, c + h lie in the box, with c as close to x as that allows. With
    ``u = (x - c)/h`` the slope is ``((2u - 1) f_- - 4u f_0 + (2u + 1) f_+)/(2h)``: the central
    difference where x is away from the bounds, the one-sided one of second order on a bound.

    Args:
        function: Maps points (m, d) of the box to values (m, ...).
        x: Points (n, d) of the box.
        limits: Bounds (2, d).

    Returns:
        Derivatives (n, ..., d). Ten digits of them are good, see `STEP`.
    """
    n, d = x.shape
    low, high = limits
    h = STEP * (high - low)
    centre = np.clip(x, low + h, high - h)
    nodes = np.broadcast_to(x, (3, d, n, d)).copy()
    each = np.arange(d)
    for place in range(3):
        # Rounding may carry a node over the bound by a last digit.
        moved = np.clip(centre + (place - 1) * h, low, high)
        nodes[place, each, :, each] = moved.T
    values = function(nodes.reshape(-1, d))
    values = values.reshape(3, d, n, *values.shape[1:])
    u = ((x - centre) / h).T.reshape(d, n, *[1] * (values.ndim - 3))
    width = 2 * h.reshape(d, *[1] * (values.ndim - 2))
    slopes = ((2 * u - 1) * values[0] - 4 * u * values[1] + (2 * u + 1) * values[2]) / width
    return np.asarray(np.moveaxis(slopes, 0, -1))
