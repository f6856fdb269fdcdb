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


@dataclass(frozen=True, eq=False)
class Scatter:
    """Covariances ``V = N + U U'`` of what k instruments read in m visits, ``r = k d`` rows each.

    Each instrument errs by itself, N, and few things move all of them together, U: joints that do
    not come back. So nothing of the size r^2 is ever needed, whatever the number of instruments.

    Attributes:
        apart: The blocks of N (m, k, d, d).
        together: U (m, r, n), in units of the standard deviations of what moves them.
    """

    apart: Array
    together: Array

    @classmethod
    def of(cls, V: Array) -> "Scatter":
        """Of matrices V (m, r, r) without such a form: as of one instrument."""
        return cls(V[:, None], np.zeros((*V.shape[:2], 0)))

    def __getitem__(self, chosen: slice | Indices) -> "Scatter":
        """Of some of the visits."""
        return Scatter(self.apart[chosen], self.together[chosen])

    @property
    def variances(self) -> Array:
        """The diagonal of V (m, r)."""
        own = np.einsum("mkdd->mkd", self.apart).reshape(self.together.shape[:2])
        return np.asarray(own + (self.together**2).sum(axis=-1))

    @property
    def dense(self) -> Array:
        """V (m, r, r)."""
        m, k, d, _ = self.apart.shape
        own = np.zeros((m, k, d, k, d))
        each = np.arange(k)
        own[:, each, :, each] = np.swapaxes(self.apart, 0, 1)
        V = own.reshape(m, k * d, k * d)
        return V + self.together @ np.swapaxes(self.together, 1, 2)

    def with_white(self, variances: Array) -> "Scatter":
        """The same with independent errors of the rows besides, of variances (m, r)."""
        white = diagonal_blocks(variances.reshape(self.apart.shape[:3]))
        return Scatter(self.apart + white, self.together)

    def over(self, weights: Array) -> "Scatter":
        """The same over the weights (m,) of the visits."""
        share = 1 / weights
        root = np.sqrt(share)[:, None, None]
        return Scatter(self.apart * share[:, None, None, None], self.together * root)

    def times(self, columns: Array) -> Array:
        """``V C`` (m, r, c) of columns C."""
        common = self.together @ (np.swapaxes(self.together, 1, 2) @ columns)
        return np.asarray(blocks_times(self.apart, columns) + common)

    @property
    def inverse(self) -> "Precision":
        """``V^-1 = A - B B'``, ``A = N^-1``, ``B = A U L^-T``, ``L L' = I + U' A U`` (Woodbury).

        Raises:
            numpy.linalg.LinAlgError: An N is no covariance.
        """
        U = self.together
        root = np.linalg.cholesky(self.apart)
        own = np.linalg.inv(root)
        A = np.swapaxes(own, -1, -2) @ own
        AU = blocks_times(A, U)
        L = np.linalg.cholesky(np.eye(U.shape[2]) + np.swapaxes(U, 1, 2) @ AU)
        B = AU @ np.swapaxes(np.linalg.inv(L), 1, 2)
        log = sum(np.log(np.diagonal(one, axis1=-2, axis2=-1)).sum() for one in (root, L))
        return Precision(A, B, 2 * float(log))


@dataclass(frozen=True, eq=False)
class Precision:
    """Inverses ``V^-1 = A - B B'`` of a `Scatter`.

    Attributes:
        apart: The blocks of A (m, k, d, d).
        together: B (m, r, n).
        log_det: Logarithm of the determinants of all V.
    """

    apart: Array
    together: Array
    log_det: float

    def __getitem__(self, chosen: slice | Indices) -> "Precision":
        """Of some of the visits; the determinant stays that of all."""
        return Precision(self.apart[chosen], self.together[chosen], self.log_det)

    def times(self, columns: Array) -> Array:
        """``V^-1 C`` (m, r, c) of columns C."""
        common = self.together @ (np.swapaxes(self.together, 1, 2) @ columns)
        return np.asarray(blocks_times(self.apart, columns) - common)


def diagonal_blocks(variances: Array) -> Array:
    """Blocks (..., d, d) with some variances (..., d) on their diagonals."""
    return np.asarray(variances[..., None] * np.eye(variances.shape[-1]))


def blocks_times(blocks: Array, columns: Array) -> Array:
    """Blocks (m, k, d, d) of the instruments times columns (m, k d, c)."""
    m, r, c = columns.shape
    return np.asarray((blocks @ columns.reshape(*blocks.shape[:3], c)).reshape(m, r, c))
