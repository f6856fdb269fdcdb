"""The parameters in which matrices of an interior point method and their duals are the same."""

from dataclasses import dataclass

import numpy as np

from edtk.design.relaxation.step_length import step_length
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Scaling:
    """Parameters in which each inequality X (c, p, p) and its dual S are the same.

    Attributes:
        H: ``H X H' = H^-T S H^-1 = diag(l)`` (c, p, p).
        l: The diagonals (c, p).
    """

    H: Array
    l: Array  # noqa: E741, the letter of the formula

    @classmethod
    def of(cls, X: Array, S: Array) -> "Scaling":
        """The scaling of Nesterov and Todd, by the singular values of a product of factors."""
        L = np.linalg.cholesky(X)
        K = np.linalg.cholesky(S)
        _, l, rows = np.linalg.svd(np.swapaxes(K, 1, 2) @ L)  # noqa: E741
        turned = np.swapaxes(rows, 1, 2) * np.sqrt(l)[:, None]
        return cls(np.swapaxes(np.linalg.solve(np.swapaxes(L, 1, 2), turned), 1, 2), l)

    def change(self, mu: float, lost: Array) -> Array:
        """C (c, p, p) with ``(diag(l) C + C diag(l))/2 = mu I - diag(l)^2 - lost``."""
        right = -lost
        each = np.arange(self.l.shape[1])
        right[:, each, each] += mu - self.l**2
        return 2.0 * right / (self.l[:, :, None] + self.l[:, None])

    def lengths(self, X: Array, S: Array, most: float) -> tuple[float, float]:
        """How far steps along X and S (c, p, p) may go, in these parameters.

        Args:
            X: Changes of the inequalities.
            S: Changes of their duals.
            most: Part of the way to the boundary that a step may go.
        """
        root = np.sqrt(self.l)
        both = np.stack([X, S]) / (root[:, :, None] * root[:, None])
        eigenvalues = np.linalg.eigvalsh(both).reshape(2, -1)
        primal, dual = (step_length(np.ones_like(part), part, most) for part in eigenvalues)
        return primal, dual
