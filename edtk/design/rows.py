"""Candidates kept as rows of regressors: no digit is lost to squares, and few rows are small."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.conditioning import Conditioning
from edtk.design.packed import pack
from edtk.system.typing import Array, Indices

# Doubles in a product of many rows and a matrix: it stays in a core's cache, so that squaring it
# costs little beside the product itself.
AT_ONCE = 2**17
EPS = float(np.finfo(float).eps)
# Products in a change of parameters that may be summed in long doubles, which takes a second.
AT_LENGTH = 2e8


@dataclass(frozen=True, eq=False)
class Rows:
    """Whitened regressors ``A_i / sigma`` of candidates, whose information is ``A_i' A_i``.

    Attributes:
        A: The rows (n, r, p).
    """

    A: Array

    @classmethod
    def of(cls, A: Array) -> "Rows":
        """Keep regressors (n, rows, p), of which more than p rows are turned into p (QR).

        That rounds each column. Columns that are nearly dependent would lose all that tells them
        apart, so that they keep their rows until they are whitened.
        """
        given = cls(A)
        _, rows, p = A.shape
        if rows <= p:
            return given
        with np.errstate(over="ignore"):
            mean = given.mean()
        if not np.isfinite(mean).all() or not Conditioning.of_information(mean).keeps_digits:
            return given
        return cls(np.asarray(np.linalg.qr(A, mode="r")))

    @property
    def n(self) -> int:
        """Number of candidates."""
        return len(self.A)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return int(self.A.shape[-1])

    def __getitem__(self, chosen: Indices) -> "Rows":
        """Some of the candidates."""
        return Rows(self.A[chosen])

    def __add__(self, others: "Rows") -> "Rows":
        """These candidates, then others; rows of zeros make their numbers of rows equal."""
        r = max(self.A.shape[1], others.A.shape[1])
        return Rows(np.concatenate([_with_rows(self.A, r), _with_rows(others.A, r)]))

    def factors(self, chosen: ArrayLike) -> Array:
        """The rows (k, r, p) of some candidates."""
        return self.A[chosen]  # type: ignore[index]

    def blocks(self, chosen: ArrayLike) -> Array:
        """Information (k, p, p) of some candidates."""
        A = self.A[chosen]  # type: ignore[index]
        return np.asarray(np.swapaxes(A, -1, -2) @ A)

    def packed(self) -> Array:
        """Information of all candidates, packed (p(p+1)/2, n)."""
        found = np.empty((self.p * (self.p + 1) // 2, self.n))
        # All matrices at once would take twice the memory of their triangles.
        step = max(AT_ONCE // self.p**2, 1)
        for start in range(0, self.n, step):
            A = self.A[start : start + step]
            found[:, start : start + step] = pack(np.swapaxes(A, 1, 2) @ A)
        return found

    def weighted(self, weights: Array) -> Array:
        """``sum_i w_i A_i' A_i`` (p, p) of weights (n,)."""
        A = self.flat
        M = A.T @ (np.repeat(weights, self.A.shape[1])[:, None] * A)
        # The two triangles of such a product differ by rounding.
        return np.asarray(0.5 * (M + M.T))

    def mean(self) -> Array:
        """Mean information (p, p)."""
        # A product with itself takes half the time of one with weighted rows, and no copy of them.
        return np.asarray(self.flat.T @ self.flat / self.n)

    def weighted_plans(self, chosen: Indices, repeats: Array) -> Array:
        """``sum_j r_bj A_bj' A_bj`` (b, p, p) of chosen candidates (b, k) and repeats (b, k)."""
        A = self.A[chosen].reshape(len(chosen), -1, self.p)
        weights = np.repeat(repeats, self.A.shape[1], axis=1)
        M = np.swapaxes(A, 1, 2) @ (weights[..., None] * A)
        return np.asarray(0.5 * (M + np.swapaxes(M, 1, 2)))

    def sensitivities(self, Z: Array) -> Array:
        """``<Z, A_i' A_i> = <A_i Z, A_i>`` (..., n) of symmetric Z (..., p, p).

        Rounding is below ``2 p eps |A_i| |Z| |A_i|'``, whatever the units of the parameters.
        """
        flat = Z.reshape(-1, self.p, self.p)
        found = np.empty((len(flat), self.n))
        for one, z in zip(found, flat, strict=True):
            one[:] = self._sums(partial(_inner, z))
        return found.reshape(*Z.shape[:-2], self.n)

    def largest_sensitivities(self, Z: Array) -> Array:
        """The largest ``<A_i Z, A_i>`` (r,) to each of symmetric Z (r, p, p)."""
        return np.array([self._sums(partial(_inner, z)).max() for z in Z])

    def sensitivities_to_root(self, B: Array) -> Array:
        """``<B B', A_i' A_i> = |A_i B|^2`` (n,) of B (p, q): squares, which cannot cancel."""
        return self._sums(lambda A: np.square(A @ B).sum(axis=1))

    def diagonals(self) -> Array:
        """The diagonal entries (n, p) of ``A_i' A_i``."""
        return np.asarray(np.einsum("irp,irp->ip", self.A, self.A))

    def largest(self) -> Array:
        """The largest diagonal entries (p,) of ``A_i' A_i`` over all candidates."""
        return np.asarray(self.diagonals().max(axis=0))

    def scaled(self, factor: Array) -> "Rows":
        """The same candidates with so many times the information (n,)."""
        return Rows(self.A * np.sqrt(factor)[:, None, None])

    def times(self, T: Array) -> "Rows":
        """The rows ``A_i T`` of parameters k' where ``k = T k'``.

        Where T whitens nearly dependent rows, their terms cancel. So they are summed in the longest
        numbers that the machine has, unless there are too many.
        """
        long = self._long
        wide = T.astype(long)
        step = max(AT_ONCE // self.p, 1)
        flat = self.flat
        found = np.empty(flat.shape)
        for start in range(0, len(flat), step):
            found[start : start + step] = flat[start : start + step].astype(long, copy=False) @ wide
        return Rows(found.reshape(self.A.shape))

    def rounding_of_times(self, T: Array) -> Array:
        """Bounds (n,) on the rounding ``|E_i|`` of `times`: ``p eps | |A_i| |T| |`` (Frobenius).

        It is Higham's bound of a product (Accuracy and Stability of Numerical Algorithms, 3.5) with
        eps of the numbers in which it is summed; it is rounded to doubles once more.
        """
        size = np.abs(T)
        squares = self._sums(lambda A: np.square(np.abs(A) @ size).sum(axis=1))
        rounded = self._sums(lambda A: np.square(A @ T).sum(axis=1))
        eps = float(np.finfo(self._long).eps)
        return self.p * eps * np.sqrt(squares) + EPS * np.sqrt(rounded)

    @property
    def _long(self) -> type[np.floating[Any]]:
        """The numbers in which `times` sums."""
        return np.longdouble if self.A.size * self.p <= AT_LENGTH else np.float64

    @property
    def flat(self) -> Array:
        """All rows (n r, p), one below the other."""
        return self.A.reshape(-1, self.p)

    def _sums(self, of_rows: Callable[[Array], Array]) -> Array:
        """Sums (n,) over the rows of each candidate of a number of each row."""
        flat = self.flat
        found = np.empty(len(flat))
        step = max(AT_ONCE // self.p, 1)
        for start in range(0, len(flat), step):
            found[start : start + step] = of_rows(flat[start : start + step])
        return np.asarray(found.reshape(self.n, -1).sum(axis=1))


def _inner(Z: Array, A: Array) -> Array:
    """``<a Z, a>`` (k,) of rows a (k, p)."""
    return np.asarray(np.einsum("ia,ia->i", A @ Z, A))


def _with_rows(A: Array, r: int) -> Array:
    """Regressors (n, r, p) with rows of zeros below those of A."""
    n, rows, p = A.shape
    return np.concatenate([A, np.zeros((n, r - rows, p))], axis=1) if rows < r else A
