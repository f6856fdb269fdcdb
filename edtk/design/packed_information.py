"""Candidates kept as packed information: a pass over a million of them is one matrix product."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.triangle import triangle
from edtk.design.packed import order, pack, sensitivity_rows, unpack
from edtk.system.typing import Array, Indices

# Relative size of a pivot below which a candidate's factorization ends: information is a sum of
# products, and what rounding leaves of a zero pivot stays below this.
NEGLIGIBLE_PIVOT = 1e-13
AT_ONCE = 2**14  # matrices that are transformed at once
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class PackedInformation:
    """Information of candidates as upper triangles.

    Attributes:
        triangles: Columns (p(p+1)/2, n), see `edtk.design.packed`.
    """

    triangles: Array

    @property
    def n(self) -> int:
        """Number of candidates."""
        return int(self.triangles.shape[1])

    @cached_property
    def p(self) -> int:
        """Number of parameters."""
        return order(len(self.triangles))

    def __getitem__(self, chosen: Indices) -> "PackedInformation":
        """Some of the candidates."""
        return PackedInformation(self.triangles[:, chosen])

    def __add__(self, others: "PackedInformation") -> "PackedInformation":
        """These candidates, then others."""
        return PackedInformation(np.concatenate([self.triangles, others.triangles], axis=1))

    def blocks(self, chosen: ArrayLike) -> Array:
        """Information (k, p, p) of some candidates."""
        return unpack(self.triangles[:, chosen])  # type: ignore[index]

    def packed(self) -> Array:
        """The triangles themselves."""
        return self.triangles

    def factors(self, chosen: ArrayLike) -> Array:
        """Factors (k, r, p) of some candidates, with as many rows as the largest rank of all."""
        return self._factors[chosen]  # type: ignore[index]

    def weighted(self, weights: Array) -> Array:
        """``sum_i w_i M_i`` (p, p) of weights (n,)."""
        return unpack(self.triangles @ weights)

    def mean(self) -> Array:
        """Mean information (p, p)."""
        return unpack(self.triangles.mean(axis=1))

    def weighted_plans(self, chosen: Indices, repeats: Array) -> Array:
        """``sum_j r_bj M_bj`` (b, p, p) of chosen candidates (b, k) and repeats (b, k)."""
        return np.einsum("bk,bkij->bij", repeats, self.blocks(chosen))

    def sensitivities(self, Z: Array) -> Array:
        """``<Z, M_i>`` (..., n) of symmetric Z (..., p, p)."""
        return np.asarray(sensitivity_rows(Z) @ self.triangles)

    def largest_sensitivities(self, Z: Array) -> Array:
        """The largest ``<Z, M_i>`` (r,) to each of symmetric Z (r, p, p)."""
        rows = sensitivity_rows(Z)
        found = np.full(len(rows), -np.inf)
        # All sensitivities at once would be written to memory, and read again.
        for start in range(0, self.n, AT_ONCE):
            part = rows @ self.triangles[:, start : start + AT_ONCE]
            np.maximum(found, part.max(axis=1), out=found)
        return found

    def sensitivities_to_root(self, B: Array) -> Array:
        """``<B B', M_i>`` (n,) of B (p, q)."""
        return self.sensitivities(B @ B.T)

    def diagonals(self) -> Array:
        """The diagonal entries (n, p) of all candidates."""
        rows, columns = triangle(self.p)
        return np.asarray(self.triangles[rows == columns].T)

    def largest(self) -> Array:
        """The largest diagonal entries (p,) over all candidates."""
        rows, columns = triangle(self.p)
        return np.asarray([self.triangles[k].max() for k in np.flatnonzero(rows == columns)])

    def scaled(self, factor: Array) -> "PackedInformation":
        """The same candidates with so many times the information (n,)."""
        return PackedInformation(self.triangles * factor)

    def times(self, T: Array) -> "PackedInformation":
        """The information ``T' M_i T`` about parameters k' where ``k = T k'``."""
        found = np.empty_like(self.triangles)
        # All blocks at once would take twice the memory of the triangles.
        for start in range(0, self.n, AT_ONCE):
            part = slice(start, start + AT_ONCE)
            M = T.T @ unpack(self.triangles[:, part]) @ T
            found[:, part] = pack(0.5 * (M + np.swapaxes(M, 1, 2)))
        return PackedInformation(found)

    def rounding_of_times(self, T: Array) -> Array:
        """Bounds (n,) on the rounding of `times`: ``2 p eps | |T|' |M_i| |T| |``.

        An entry of M_i is at most ``(M_jj M_kk)^(1/2)``, so that the norm is a square.
        """
        rows, columns = triangle(self.p)
        roots = np.sqrt(np.maximum(self.triangles[rows == columns], 0.0))
        return 2 * self.p * EPS * np.square(np.abs(T).T @ roots).sum(axis=0)

    def plus(self, M: Array) -> "PackedInformation":
        """The same candidates with M (p, p) besides."""
        return PackedInformation(self.triangles + pack(M)[:, None])

    @cached_property
    def _factors(self) -> Array:
        """Factors of all candidates (n, r, p), computed when first asked for.

        This is a Cholesky factorization with pivots, of all candidates at once: each step removes
        the part that belongs to the largest remaining diagonal entry, until only rounding remains.
        """
        # At a diagonal of order one the size of a pivot tells the rank, whatever the units.
        own = unpack(self.triangles.mean(axis=1))
        scale = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
        remaining = unpack(self.triangles) / np.outer(scale, scale)
        diagonal = np.diagonal(remaining, axis1=1, axis2=2)
        each = np.arange(self.n)
        least = NEGLIGIBLE_PIVOT * diagonal.max(axis=1)
        rows: list[Array] = []
        while len(rows) < self.p:
            top = diagonal.max(axis=1)
            if not (top > least).any():
                break
            # An infinite pivot gives candidates of lower rank a row of zeros.
            pivot = np.sqrt(np.where(top > least, top, np.inf))
            row = remaining[each, diagonal.argmax(axis=1)] / pivot[:, None]
            remaining -= row[:, :, None] * row[:, None]
            rows.append(row)
        return np.stack(rows or [np.zeros((self.n, self.p))], axis=1) * scale
