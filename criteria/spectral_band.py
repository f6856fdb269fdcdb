"""Criteria of extreme eigenvalues as one kind of convex program."""

from dataclasses import dataclass, replace

import numpy as np

from criteria.linalg.typing import Array

GRADED = 1e3  # condition number of R: duals have its square


@dataclass(frozen=True, eq=False)
class SpectralBand:
    """The program ``min b sum(w) + a kappa``, ``w >= 0``, with ``F <= M(w), R'M(w) R <= kappa I``.

    The upper bound is ``M <= kappa C`` for ``C^-1 = R R'``. In parameters that are very different
    from those of the criterion C has the squares of a large condition number, and would leave no
    digits of its small entries; what counts in R are its large ones.

    Attributes:
        a: Weight of the upper bound, at least zero; zero where there is none.
        b: Weight of the sum of the weights, at least zero.
        floor: F (p, p), positive semidefinite.
        cap: R (p, p), regular.
    """

    a: float
    b: float
    floor: Array
    cap: Array

    @classmethod
    def of(cls, a: float, b: float, p: int) -> "SpectralBand":
        """That of eigenvalues themselves, ``I <= M <= kappa I``."""
        return cls(a, b, np.eye(p), np.eye(p))

    @property
    def is_graded(self) -> bool:
        """Whether the upper bound is so uneven that its dual is lost beside that of the lower."""
        return bool(self.a and np.linalg.cond(self.cap) > GRADED)

    def transformed(self, T: Array) -> "SpectralBand":
        """The same program for the information ``T'M T``."""
        return replace(
            self, floor=T.T @ self.floor @ T, cap=np.asarray(np.linalg.solve(T, self.cap))
        )
