"""The sensitivity of a design: what a multiplier pays for a measurement anywhere, and where it pays most nearby."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edtk.design.design_space import DesignSpace
from edtk.design.experiments import Experiments
from edtk.design.interior_point.descend import Indices, Local, Objective, descend
from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.packed import sensitivity_rows

Array = NDArray[np.float64]


def sensitivity_and_slope(
    here: Experiments, Z: Array, per_trace: bool = False
) -> tuple[Array, Array]:
    """Prices ``<Z, M(x)>`` of experiments, ``M(x) = A' A/sigma^2`` and what is shared, and their gradients.

    ``d<Z, M> = 2 <A Z, dA>/sigma^2``; per trace it is ``<Z, M>/trace(M)`` and the quotient rule.

    Args:
        here: Experiments (..., b, k).
        Z: Multipliers (b, p, p), one for each row of them.
        per_trace: Divide by ``trace M(x)``: for criteria of degree zero.

    Returns:
        Prices (..., b, k) and gradients (..., b, k, v).
    """
    M, A = here.packed, here.regressor
    price, slope = (
        np.einsum("bt,t...bk->...bk", sensitivity_rows(Z), M),
        here.slope(2 * A @ Z[:, None]),
    )
    if not per_trace:
        return price, slope
    size, growth = np.tensordot(sensitivity_rows(np.eye(Z.shape[-1])), M, 1), here.slope(2 * A)
    price = price / size
    return price, (slope - price[..., None] * growth) / size[..., None]


@dataclass(frozen=True, eq=False)
class _Price(Objective):
    """The price of one experiment by a multiplier of each start (n, p, p), to be raised."""

    Z: Array
    per_trace: bool

    def value(self, here: Experiments, start: Indices) -> Array:
        """Minus the prices (b,)."""
        return -sensitivity_and_slope(here, self.Z[start], self.per_trace)[0][:, 0]

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Minus the prices, slopes and curvature."""
        price, slope = sensitivity_and_slope(near.experiments, self.Z[start], self.per_trace)
        slope = -near.first(slope)
        own = near.second(slope)
        return -price[0, :, 0], slope[0], own, np.zeros_like(own[:, 0])


def ascend(
    space: DesignSpace,
    x: Array,
    Z: Array,
    per_trace: bool = False,
    unit: float = 1.0,
    accuracy: float = 1e-6,
) -> Array:
    """Experiments (b, v) uphill of feasible experiments (b, v), each under its own multiplier.

    Args:
        space: Feasible set and movable variables.
        x: Where to start (b, v).
        Z: Multipliers (b, p, p).
        per_trace: See `sensitivity_and_slope`.
        unit: A price's size.
        accuracy: On the price, in that unit.
    """
    return descend(space, x[:, None], _Price(Z / unit, per_trace), accuracy=accuracy, barrier=0.1)[
        :, 0
    ]
