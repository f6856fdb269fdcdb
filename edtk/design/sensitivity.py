"""The sensitivity of a design: what a multiplier pays for a measurement in any pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edtk.design.descend import descend
from edtk.design.exact import PoseDesign

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Price ``<Z, M(q)>`` of the pose q, where ``M(q) = A' A / sigma^2``.

    Args:
        design: Model, noise, wrench and feasible set.
        Z: Multiplier (p, p).
        per_trace: Divide by ``trace M(q)``: for criteria of degree zero.
    """

    design: PoseDesign
    Z: Array
    per_trace: bool = False

    def __call__(self, q: Array) -> Array:
        """Prices (k,) of poses (k, n)."""
        A = self.design.model.regressor(q, self.design.wrench) / self.design.sigma[:, None]
        price = np.einsum("kri,ij,krj->k", A, self.Z, A)
        return price / np.square(A).sum(axis=(1, 2)) if self.per_trace else price

    def gradient(self, q: Array) -> tuple[Array, Array]:
        """Prices (k,) and their derivatives (k, n): ``d<Z, M> = 2 <A Z, dA> / sigma^2``, and the quotient rule."""
        A, dA = self.design.model.linearise(q, self.design.wrench)
        A, dA = A / self.design.sigma[:, None], dA / self.design.sigma[:, None, None]
        B = A @ self.Z
        price, slope = np.einsum("kri,kri->k", B, A), 2 * np.einsum("kri,krin->kn", B, dA)
        if not self.per_trace:
            return price, slope
        size, growth = np.square(A).sum(axis=(1, 2)), 2 * np.einsum("kri,krin->kn", A, dA)
        price = price / size
        return price, (slope - price[:, None] * growth) / size[:, None]

    def ascend(self, q: Array, unit: float, accuracy: float) -> Array:
        """The pose (n,) uphill of a feasible pose (n,), which is nowhere less feasible; `unit` is a price's size."""

        def objective(x: Array) -> tuple[float, Array]:
            price, slope = self.gradient(x)
            return -float(price[0]) / unit, -slope / unit

        return descend(self.design, q[None], objective, iterations=100, tolerance=accuracy)[0]
