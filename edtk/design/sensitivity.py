"""The sensitivity of a design: what a multiplier pays for a measurement anywhere, and where it pays most nearby."""

import numpy as np
from numpy.typing import NDArray

from edtk.design.descend import descend
from edtk.design.packed import price_rows
from edtk.design.pose_design import Experiments, PoseDesign

Array = NDArray[np.float64]


def price_and_gradient(here: Experiments, Z: Array, per_trace: bool = False) -> tuple[Array, Array]:
    """Prices ``<Z, M(x)>`` of experiments, ``M(x) = A' A/sigma^2`` and what is shared, and their gradients.

    ``d<Z, M> = 2 <A Z, dA>/sigma^2``; per trace it is ``<Z, M>/trace(M)`` and the quotient rule.

    Args:
        here: Experiments (b, k).
        Z: Multipliers (b, p, p), one for each row of them.
        per_trace: Divide by ``trace M(x)``: for criteria of degree zero.

    Returns:
        Prices (b, k) and gradients (b, k, v).
    """
    M, A, dA = here.packed, here.regressor, here.regressor_gradient
    price = np.einsum("bt,tbk->bk", price_rows(Z), M)
    slope = 2 * np.einsum("bkri,bkriv->bkv", A @ Z[:, None], dA)
    if not per_trace:
        return price, slope
    size, growth = np.tensordot(price_rows(np.eye(Z.shape[-1])), M, 1), 2 * np.einsum("bkri,bkriv->bkv", A, dA)
    price = price / size
    return price, (slope - price[..., None] * growth) / size[..., None]


def ascend(
    design: PoseDesign, x: Array, Z: Array, per_trace: bool = False, unit: float = 1.0, accuracy: float = 1e-6
) -> Array:
    """Experiments (b, v) uphill of feasible experiments (b, v), each under its own multiplier.

    Args:
        design: Feasible set and movable variables.
        x: Where to start (b, v).
        Z: Multipliers (b, p, p).
        per_trace: See `price_and_gradient`.
        unit: A price's size.
        accuracy: On the price, in that unit.
    """

    def objective(here: Experiments, start: NDArray[np.int_]) -> tuple[Array, Array]:
        price, slope = price_and_gradient(here, Z[start], per_trace)
        return -price[:, 0] / unit, -slope / unit

    return descend(design, x[:, None], objective, iterations=200, accuracy=accuracy)[:, 0]
