"""Rows whose errors are correlated, made rows of unit covariance, for many poses at once."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Whitener:
    """The lower triangle L of ``Sigma = L L'`` (Cholesky), component first.

    Attributes:
        L: Lower triangles (rows, rows, ...); entries above the diagonal are not used.
    """

    L: Array

    @classmethod
    def of(cls, Sigma: Array) -> "Whitener":
        """Factorise covariances.

        Args:
            Sigma: Symmetric matrices (rows, rows, ...); only their lower triangles are read.

        Returns:
            The whitener. Where a covariance is not positive definite its rows are NaN: the caller
            decides what such a pose means.
        """
        rows = len(Sigma)
        L = np.zeros(Sigma.shape)
        # Loops over rows, array operations over poses: a call of LAPACK for each small matrix
        # takes three times as long.
        for j in range(rows):
            column = Sigma[j:, j].copy()
            for k in range(j):
                column -= L[j:, k] * L[j, k]
            L[j, j] = np.sqrt(np.where(column[0] > 0, column[0], np.nan))
            L[j + 1 :, j] = column[1:] / L[j, j]
        return cls(L)

    def rows(self, A: Array) -> Array:
        """Whitened rows ``L^-1 A`` of columns A (p, rows, ...), in the same layout."""
        shape = np.broadcast_shapes(A.shape[2:], self.L.shape[2:])
        white = np.empty((*A.shape[:2], *shape))
        for i in range(len(self.L)):
            rest = white[:, i]
            rest[...] = A[:, i]
            for k in range(i):
                rest -= self.L[i, k] * white[:, k]
            rest /= self.L[i, i]
        return white

    def transposed(self, B: Array) -> Array:
        """The adjoint, ``L^-T B`` of columns B (p, rows, ...), in the same layout."""
        shape = np.broadcast_shapes(B.shape[2:], self.L.shape[2:])
        found = np.empty((*B.shape[:2], *shape))
        last = len(self.L) - 1
        for i in range(last, -1, -1):
            rest = found[:, i]
            rest[...] = B[:, i]
            for k in range(last, i, -1):
                rest -= self.L[k, i] * found[:, k]
            rest /= self.L[i, i]
        return found
