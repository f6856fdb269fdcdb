"""Rows in units of their noise, and covariances of rows of which some are not read."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array, Indices, Mask


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

    def slope_weights(self, weights: Array, rows: Array) -> Array:
        """Weights (rows, rows, ...) of dSigma in ``-<P Q', dSigma>/2``, which whitened rows add.

        Args:
            weights: Weights ``P = L^-T B`` (p, rows, ...) of the rows themselves.
            rows: Whitened rows ``L^-1 A`` (p, rows, ...), so that ``Q = Sigma^-1 A``.
        """
        return -0.5 * np.einsum("pr...,ps...->rs...", weights, self.transposed(rows))


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """What makes errors of size one of independent ones, as `Whitener` does of others.

    Attributes:
        sizes: Standard deviations (rows,) or (rows, ...).
    """

    sizes: Array

    def rows(self, A: Array) -> Array:
        """Rows over their standard deviations, of columns A (p, rows, ...)."""
        return np.asarray(A / lifted(self.sizes, A[0]))

    def transposed(self, B: Array) -> Array:
        """The adjoint, which is the same."""
        return self.rows(B)


def lifted(numbers: Array, like: Array) -> Array:
    """Numbers (n,) or (n, ...) that multiply arrays (n, rows, ...)."""
    missing = like.ndim - numbers.ndim
    return numbers.reshape(len(numbers), *[1] * missing, *numbers.shape[1:])


def component_first(A: Array) -> Array:
    """Arrays (c, r, m) of those (m, r, c), as `VisitNoise` has them."""
    return np.ascontiguousarray(np.moveaxis(A, 0, -1).swapaxes(0, 1))


def of_rows(by_marker: Array | Indices | Mask, width: int) -> Array:
    """Numbers (m, width) of all rows, of those (m, k) of markers or (m, k, rows) of their rows."""
    m, k = by_marker.shape[:2]
    if by_marker.ndim == 3:
        return by_marker.reshape(m, width).astype(float)
    return np.repeat(by_marker, width // k, axis=1).astype(float)


def only_seen(V: Array, seen: Mask) -> Array:
    """Covariances (m, r, r) in which rows that were not seen are independent, of size one.

    Args:
        V: Covariances.
        seen: Which markers (m, k) were seen, or which rows (m, r).
    """
    there = of_rows(seen, V.shape[1])
    return np.ascontiguousarray(np.moveaxis(read_alone(np.moveaxis(V, 0, -1), there.T), -1, 0))


def read_alone(V: Array, there: Array | Mask) -> Array:
    """Covariances (r, r, ...) in which rows that are not read are independent, of size one.

    So those that are read have, once whitened, no part in the others: it is as if the others had
    been struck out before.

    Args:
        V: Covariances.
        there: Whether each row (r, ...) is read: true or one, else false or zero.
    """
    there = np.asarray(there, dtype=float)
    found = V * there[:, None] * there
    for row, own in enumerate(there):
        found[row, row] += 1 - own
    return found
