"""Criteria of extreme eigenvalues as one kind of convex program."""

from dataclasses import dataclass, replace

import numpy as np

from criteria.linalg.typing import Array


@dataclass(frozen=True, eq=False)
class SpectralBand:
    """The program ``min b sum(w) + a kappa`` over ``w >= 0`` with ``F <= M(w) <= kappa C``.

    Attributes:
        a: Weight of the upper bound, at least zero; zero where there is none.
        b: Weight of the sum of the weights, at least zero.
        floor: F (p, p), positive semidefinite.
        ceiling: C (p, p), positive definite.
    """

    a: float
    b: float
    floor: Array
    ceiling: Array

    @classmethod
    def of(cls, a: float, b: float, p: int) -> "SpectralBand":
        """That of eigenvalues themselves, ``I <= M <= kappa I``."""
        return cls(a, b, np.eye(p), np.eye(p))

    def transformed(self, T: Array) -> "SpectralBand":
        """The same program for the information ``T'M T``."""
        return replace(self, floor=T.T @ self.floor @ T, ceiling=T.T @ self.ceiling @ T)
