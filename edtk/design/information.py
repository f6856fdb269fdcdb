"""Candidates as rows or as packed information, for passes over a million of them.

A million 5 x 5 information matrices are then one array (15, 10^6), and the sensitivities of all of
them are one matrix product.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import EPS, root
from criteria.linalg.long_product import EPS_OF_SUM, long_product
from criteria.linalg.models import Models, taken
from criteria.linalg.typing import triangle
from edtk.design.conditioning import Conditioning
from edtk.system.typing import Array, Indices, Mask

# Relative size of a pivot below which a candidate's factorization ends: information is a sum of
# products, and what rounding leaves of a zero pivot stays below this.
NEGLIGIBLE_PIVOT = 1e-13
PACKED_AT_ONCE = 2**14  # matrices that are transformed at once
# Doubles in a product of many rows and a matrix: it stays in a core's cache, so that squaring it
# costs little beside the product itself.
ROWS_AT_ONCE = 2**17
SIDE_BY_SIDE = 64  # candidates whose numbers make one long row
# Products in a change of parameters that may be summed in long doubles, which takes a second.
AT_LENGTH = 2e8


def nearly_equal(values: Array, others: Array, tolerance: float) -> bool:
    """Whether arrays are equal up to a part of their largest entry."""
    size = max(float(np.abs(others).max(initial=0.0)), float(np.abs(values).max(initial=0.0)))
    return bool(np.abs(values - others).max(initial=0.0) <= tolerance * size)


def distinct(
    blocks: Iterable[Array], T: Array, tolerance: float, most: int | None = None
) -> Indices:
    """Choose experiments no two of which tell the same.

    Poses that a symmetry of robot and load maps onto each other have the same information. The
    comparison of information finds them without knowing the symmetry.

    Args:
        blocks: Information matrices (p, p), the preferred ones first; those after the last choice
            are not asked for.
        T: Matrix (p, r) that whitens the parameters, as far as they are known.
        tolerance: Relative difference up to which two experiments count as the same.
        most: Number of experiments after which to stop; by default all are compared.

    Returns:
        Indices of the experiments that differ from every preferred one that was chosen.
    """
    chosen: list[int] = []
    others = np.empty((0, T.shape[1] ** 2))
    for i, block in enumerate(blocks):
        if len(chosen) == most:
            break
        # One at a time: those of many parameters together would be deaf to Ctrl-C for a second.
        own = (T.T @ block @ T).ravel()
        least = tolerance * np.linalg.norm(own)
        if not chosen or np.linalg.norm(others - own, axis=1).min() > least:
            chosen.append(i)
            others = np.vstack([others, own])
    return np.array(chosen, dtype=int)


def order(length: int) -> int:
    """Find the order p of the matrix whose upper triangle has ``p (p + 1)/2`` entries.

    Raises:
        ValueError: No upper triangle of a square matrix has this length.
    """
    p = int((np.sqrt(8 * length + 1) - 1) / 2)
    if p < 1 or p * (p + 1) // 2 != length:
        raise ValueError(f"{length} entries are not the upper triangle of a square matrix")
    return p


def pack_gram(A: Array) -> Array:
    """Compute the information ``A' A`` of many regressors at once.

    Args:
        A: Regressors (p, rows, ...), component first.

    Returns:
        Packed matrices (p(p+1)/2, ...).
    """
    p = len(A)
    packed = np.empty((p * (p + 1) // 2, *A.shape[2:]))
    for entry, (i, j) in enumerate(zip(*triangle(p), strict=True)):
        # The products are added in place: a temporary for all rows would be as large as A itself.
        out = packed[entry, ...]
        np.multiply(A[i, 0], A[j, 0], out=out)
        for row in range(1, A.shape[1]):
            out += A[i, row] * A[j, row]
    return packed


def pack(M: Array) -> Array:
    """Pack symmetric matrices (..., p, p) as columns (p(p+1)/2, ...)."""
    rows, columns = triangle(M.shape[-1])
    return np.moveaxis(M[..., rows, columns], -1, 0)


def unpack(packed: Array) -> Array:
    """Restore symmetric matrices (..., p, p) from packed columns (p(p+1)/2, ...)."""
    p = order(len(packed))
    rows, columns = triangle(p)
    entries = packed.transpose(*range(1, packed.ndim), 0)
    M = np.empty((*packed.shape[1:], p, p))
    M[..., rows, columns] = entries
    M[..., columns, rows] = entries
    return M


def sensitivity_rows(Z: ArrayLike) -> Array:
    """Prepare multipliers so that one matrix product gives ``<Z, M>`` of all packed matrices.

    Args:
        Z: Symmetric multipliers (..., p, p).

    Returns:
        Rows (..., p(p+1)/2), in which off-diagonal entries count twice.
    """
    Z = np.asarray(Z, dtype=float)
    rows, columns = triangle(Z.shape[-1])
    return Z[..., rows, columns] * np.where(rows == columns, 1.0, 2.0)


@dataclass(frozen=True, eq=False)
class PackedInformation:
    """Information of candidates as upper triangles.

    Attributes:
        triangles: Columns (p(p+1)/2, n), see `edtk.design.information`.
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
        for start in range(0, self.n, PACKED_AT_ONCE):
            part = rows @ self.triangles[:, start : start + PACKED_AT_ONCE]
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
        for start in range(0, self.n, PACKED_AT_ONCE):
            part = slice(start, start + PACKED_AT_ONCE)
            M = T.T @ unpack(self.triangles[:, part]) @ T
            found[:, part] = pack(0.5 * (M + np.swapaxes(M, 1, 2)))
        return PackedInformation(found)

    @property
    def models(self) -> Models:
        """One model: how the blocks of block diagonal information lie."""
        return Models.single(self.p)

    def entries(self, chosen: Indices) -> Array:
        """The entries (k, e) of the blocks of some candidates, see `Models.entries`."""
        return self.blocks(chosen).reshape(len(chosen), -1)

    def sizes(self) -> Array:
        """The roots (p,) of the largest entries of each parameter."""
        return np.asarray(np.sqrt(np.maximum(self.largest(), 0.0)))

    def in_unit(self, power: int) -> "PackedInformation":
        """The same candidates with ``2^power`` times the rows."""
        return PackedInformation(np.ldexp(self.triangles, 2 * power))

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


@dataclass(frozen=True, eq=False)
class Rows:
    """Whitened regressors ``A_i = given_i / sigma_i`` of candidates, of information ``A_i' A_i``.

    Attributes:
        given: Regressors (n, r, p), before their rows are divided by sigma.
        sigma: Standard deviations (n, r) of the rows; None where they are one.
    """

    given: Array
    sigma: Array | None = None

    @classmethod
    def of(cls, A: Array, sigma: ArrayLike = 1.0) -> "Rows":
        """Keep regressors (n, rows, p) with their noise: a number, (rows,) or (n, rows).

        Rows are divided by sigma, and more than p of them are turned into p (QR). Both round each
        entry. Columns that are nearly dependent would lose all that tells them apart, so that they
        are kept as they were given until they are whitened.
        """
        deviations = np.asarray(sigma, dtype=float)
        divided = cls(A / deviations[..., None])
        _, rows, p = A.shape
        is_exact = bool((np.frexp(deviations)[0] == 0.5).all())  # powers of two
        if is_exact and rows <= p:
            return divided
        with np.errstate(over="ignore"):
            mean = divided.mean()
        if not np.isfinite(mean).all() or not Conditioning.of_information(mean).keeps_digits:
            return divided if is_exact else cls(A, np.broadcast_to(deviations, A.shape[:2]))
        return divided if rows <= p else cls(np.asarray(np.linalg.qr(divided.A, mode="r")))

    @property
    def A(self) -> Array:
        """The rows (n, r, p)."""
        return self.given if self.sigma is None else self._divided

    @cached_property
    def _divided(self) -> Array:
        assert self.sigma is not None
        return self.given / self.sigma[:, :, None]

    @property
    def each(self) -> "Rows":
        """Every row (n r, 1, p) as a candidate of its own."""
        sigma = None if self.sigma is None else self.sigma.reshape(-1, 1)
        return Rows(self.given.reshape(-1, 1, self.p), sigma)

    @property
    def n(self) -> int:
        """Number of candidates."""
        return len(self.given)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return int(self.given.shape[-1])

    def __getitem__(self, chosen: Indices) -> "Rows":
        """Some of the candidates."""
        return Rows(self.given[chosen], None if self.sigma is None else self.sigma[chosen])

    def __add__(self, others: "Rows") -> "Rows":
        """These candidates, then others; rows of zeros make their numbers of rows equal."""
        r = max(self.given.shape[1], others.given.shape[1])
        given = np.concatenate([_with_rows(self.given, r), _with_rows(others.given, r)])
        if self.sigma is None and others.sigma is None:
            return Rows(given)
        return Rows(given, np.concatenate([self._deviations(r), others._deviations(r)]))

    def _deviations(self, r: int) -> Array:
        """The deviations (n, r) of rows, with ones for those of zeros."""
        found = np.ones((self.n, r))
        if self.sigma is not None:
            found[:, : self.sigma.shape[1]] = self.sigma
        return found

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
        step = max(ROWS_AT_ONCE // self.p**2, 1)
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
        own = self.diagonals()
        # Maxima over few long rows take a tenth of the time of those over many short ones.
        whole = len(own) // SIDE_BY_SIDE * SIDE_BY_SIDE
        folded = own[:whole].reshape(-1, SIDE_BY_SIDE * self.p).max(axis=0, initial=0.0)
        return np.asarray(np.vstack([folded.reshape(-1, self.p), own[whole:]]).max(axis=0))

    def scaled(self, factor: Array) -> "Rows":
        """The same candidates with so many times the information (n,)."""
        return Rows(self.A * np.sqrt(factor)[:, None, None])

    def times(self, T: Array) -> "Rows":
        """The rows ``A_i T`` of parameters k' where ``k = T k'``.

        Where T whitens nearly dependent rows, their terms cancel. So they are summed in the longest
        numbers that the machine has, unless there are too many, and divided by sigma only then.
        """
        product = long_product if self._at_length else np.matmul
        step = max(ROWS_AT_ONCE // self.p, 1)
        flat = self.given.reshape(-1, self.p)
        found = np.empty(flat.shape)
        for start in range(0, len(flat), step):
            part = slice(start, start + step)
            own = product(flat[part], T)
            found[part] = own if self.sigma is None else own / self.sigma.reshape(-1, 1)[part]
        return Rows(found.reshape(self.given.shape))

    def rounding_of_times(self, T: Array) -> Array:
        """Bounds (n,) on the rounding ``|E_i|`` of `times`: ``p eps | |A_i| |T| |`` (Frobenius).

        It is Higham's bound of a product (Accuracy and Stability of Numerical Algorithms, 3.5) with
        eps of the numbers in which it is summed; it is rounded to doubles once more.
        """
        size = np.abs(T)
        squares = self._sums(lambda A: np.square(np.abs(A) @ size).sum(axis=1))
        rounded = self._sums(lambda A: np.square(A @ T).sum(axis=1))
        eps = EPS_OF_SUM if self._at_length else EPS
        return self.p * eps * np.sqrt(squares) + EPS * np.sqrt(rounded)

    @property
    def _at_length(self) -> bool:
        """Whether `times` sums in longer numbers than doubles."""
        return self.A.size * self.p <= AT_LENGTH

    @property
    def models(self) -> Models:
        """One model: how the blocks of block diagonal information lie."""
        return Models.single(self.p)

    def entries(self, chosen: Indices) -> Array:
        """The entries (k, e) of the blocks of some candidates, see `Models.entries`."""
        return self.blocks(chosen).reshape(len(chosen), -1)

    def sizes(self) -> Array:
        """The largest entries (p,) of each column, whose squares may be no doubles."""
        return np.asarray(np.abs(self.A).max(axis=(0, 1)))

    def in_unit(self, power: int) -> "Rows":
        """The same candidates with ``2^power`` times the rows."""
        return Rows(np.ldexp(self.given, power), self.sigma)

    def whitened(self, T: Array, is_open: Mask, as_rows: bool) -> "Rows | PackedInformation":
        """The candidates about k', ``k = T k'``, of which some (p,) no candidate tells.

        Their columns are rounding alone, and become zero. Squares take the place of rows where
        these are more numbers, unless rows are wanted.
        """
        rows = Rows(np.where(is_open, 0.0, self.times(T).A))
        fewer = 2 * self.A.shape[1] > self.p and not as_rows
        return PackedInformation(rows.packed()) if fewer else rows

    @property
    def flat(self) -> Array:
        """All rows (n r, p), one below the other."""
        return self.A.reshape(-1, self.p)

    def _sums(self, of_rows: Callable[[Array], Array]) -> Array:
        """Sums (n,) over the rows of each candidate of a number of each row."""
        flat = self.flat
        found = np.empty(len(flat))
        step = max(ROWS_AT_ONCE // self.p, 1)
        for start in range(0, len(flat), step):
            found[start : start + step] = of_rows(flat[start : start + step])
        if len(found) == self.n:
            return found  # of one row each, which a sum would copy
        return np.asarray(found.reshape(self.n, -1).sum(axis=1))


class ModelRows(Rows):
    """Rows of the same candidates under k models, whose information is ``diag(M_1, .., M_k)``.

    Each model keeps its own rows. Of k models of order s with r rows each that are ``n k r s``
    numbers, where rows of all parameters, most of them zero, are k times as many. Sums over models
    are sums of what their rows tell: sensitivities are ``sum_j <Z_jj, M_ij>``.

    Args:
        parts: The rows of each model.
    """

    def __init__(self, parts: Sequence[Rows]) -> None:
        object.__setattr__(self, "parts", tuple(parts))
        object.__setattr__(self, "_models", Models(tuple(part.p for part in parts)))

    parts: tuple[Rows, ...]
    _models: Models

    @property
    def A(self) -> Array:
        """The rows (n, r_1 + .. + r_k, p) about all parameters, made anew."""
        return side_by_side([part.A for part in self.parts])

    @property
    def given(self) -> Array:
        """The same: parts have deviations of their own."""
        return self.A

    @property
    def models(self) -> Models:
        """Where the models stand."""
        return self._models

    @property
    def n(self) -> int:
        """Number of candidates."""
        return self.parts[0].n

    @property
    def p(self) -> int:
        """Number of parameters of all models."""
        return self._models.p

    def __getitem__(self, chosen: Indices) -> "ModelRows":
        """Some of the candidates."""
        return ModelRows([part[chosen] for part in self.parts])

    def __add__(self, others: Rows) -> Rows:
        """These candidates, then others."""
        if not isinstance(others, ModelRows) or others._models.sizes != self._models.sizes:
            return Rows(self.A) + others
        return ModelRows([a + b for a, b in zip(self.parts, others.parts, strict=True)])

    def factors(self, chosen: ArrayLike) -> Array:
        """The rows (k, r, p) of some candidates."""
        return side_by_side([part.factors(chosen) for part in self.parts])

    def entries(self, chosen: Indices) -> Array:
        """The entries (k, e) of the blocks of some candidates, see `Models.entries`."""
        return np.hstack([part.entries(chosen) for part in self.parts])

    def sizes(self) -> Array:
        """The largest entries (p,) of each column."""
        return np.concatenate([part.sizes() for part in self.parts])

    def in_unit(self, power: int) -> "ModelRows":
        """The same candidates with ``2^power`` times the rows."""
        return ModelRows([part.in_unit(power) for part in self.parts])

    def blocks(self, chosen: ArrayLike) -> Array:
        """Information (k, p, p) of some candidates."""
        return self._diagonal([part.blocks(chosen) for part in self.parts])

    def weighted(self, weights: Array) -> Array:
        """``sum_i w_i M_i`` (p, p) of weights (n,)."""
        return self._diagonal([part.weighted(weights) for part in self.parts])

    def mean(self) -> Array:
        """Mean information (p, p)."""
        return self._diagonal([part.mean() for part in self.parts])

    def weighted_plans(self, chosen: Indices, repeats: Array) -> Array:
        """``sum_j r_bj M_bj`` (b, p, p) of chosen candidates (b, k) and repeats (b, k)."""
        return self._diagonal([part.weighted_plans(chosen, repeats) for part in self.parts])

    def sensitivities(self, Z: Array) -> Array:
        """``sum_j <Z_jj, M_ij>`` (..., n) of symmetric Z (..., p, p)."""
        found = np.zeros((*Z.shape[:-2], self.n))
        for places, A in self._alike:
            # One product for all models of an order.
            flat = A.reshape(len(A), -1, A.shape[-1])
            told = ((flat @ taken(Z, places)) * flat).sum(axis=-1)
            found += told.reshape(*told.shape[:-1], *A.shape[1:3]).sum(axis=(-1, -3))
        return found

    def largest_sensitivities(self, Z: Array) -> Array:
        """The largest sensitivity (r,) to each of symmetric Z (r, p, p)."""
        return np.array([self.sensitivities(z).max() for z in Z])

    def sensitivities_to_root(self, B: Array) -> Array:
        """``sum_j |A_ij B_j|^2`` (n,) of B (p, q)."""
        found = np.zeros(self.n)
        for part, own in zip(self.parts, self._models.parts, strict=True):
            # Columns of other models are zeros.
            mine = B[own]
            found += part.sensitivities_to_root(mine[:, mine.any(axis=0)])
        return found

    def diagonals(self) -> Array:
        """The diagonal entries (n, p) of ``A_i' A_i``."""
        return np.hstack([part.diagonals() for part in self.parts])

    def scaled(self, factor: Array) -> "ModelRows":
        """The same candidates with so many times the information (n,)."""
        return ModelRows([part.scaled(factor) for part in self.parts])

    def times(self, T: Array) -> Rows:
        """The rows ``A_i T`` of parameters k' where ``k = T k'``; of models unless T mixes them."""
        if not self._models.are_apart(T):
            return Rows(self.A).times(T)
        own = zip(self.parts, self._models.parts, strict=True)
        return ModelRows([part.times(T[at, at]) for part, at in own])

    def rounding_of_times(self, T: Array) -> Array:
        """Bounds (n,) on the rounding ``|E_i|`` of `times`: rows of models are of a sum."""
        if not self._models.are_apart(T):
            return Rows(self.A).rounding_of_times(T)
        own = zip(self.parts, self._models.parts, strict=True)
        squares = [np.square(part.rounding_of_times(T[at, at])) for part, at in own]
        return np.sqrt(np.sum(squares, axis=0))

    def whitened(self, T: Array, is_open: Mask, as_rows: bool) -> Rows | PackedInformation:
        """The candidates about k', see `Rows.whitened`; they stay rows of models."""
        if not self._models.are_apart(T):
            return Rows(self.A).whitened(T, is_open, as_rows)
        own = zip(self.parts, self._models.parts, strict=True)
        return ModelRows(
            [Rows(np.where(is_open[at], 0.0, part.times(T[at, at]).A)) for part, at in own]
        )

    @cached_property
    def _alike(self) -> list[tuple[Indices, Array]]:
        """Places (g, s) and rows (g, n, r, s) of models of the same shape."""
        groups: dict[tuple[int, ...], list[int]] = {}
        for j, part in enumerate(self.parts):
            groups.setdefault(part.A.shape, []).append(j)
        return [
            (self._models.places(np.array(some)), np.stack([self.parts[j].A for j in some]))
            for some in groups.values()
        ]

    def _diagonal(self, blocks: Sequence[Array]) -> Array:
        """Matrices (..., p, p) of blocks (..., s_j, s_j)."""
        found = np.zeros((*blocks[0].shape[:-2], self.p, self.p))
        for at, block in zip(self._models.parts, blocks, strict=True):
            found[..., at, at] = block
        return found


def side_by_side(blocks: Sequence[Array]) -> Array:
    """Rows (n, rows_1 + .. + rows_k, p_1 + .. + p_k) of models with parameters of their own.

    Args:
        blocks: Rows (n, rows_j, p_j) of each model, numbers or what has their arithmetic.
    """
    rows = np.cumsum([0, *(A.shape[-2] for A in blocks)])
    columns = np.cumsum([0, *(A.shape[-1] for A in blocks)])
    shape = (*blocks[0].shape[:-2], rows[-1], columns[-1])
    found = np.zeros(shape, dtype=np.result_type(*blocks))
    for j, A in enumerate(blocks):
        found[..., rows[j] : rows[j + 1], columns[j] : columns[j + 1]] = A
    return found


@dataclass(frozen=True, eq=False)
class Known:
    """What every design has beside its experiments, such as a prior or kept experiments.

    Rows stay rows: of nearly dependent parameters their squares would have lost what tells these
    apart, and nothing brings it back.

    Attributes:
        squares: Information (p, p) that was given as such.
        rows: Rows (k, 1, p) of what was measured, each by itself.
        share: Number of experiments that share both in equal parts.
    """

    squares: Array
    rows: Rows
    share: float = 1.0

    @classmethod
    def of(cls, squares: Array) -> "Known":
        """Information (p, p) alone."""
        return cls(squares, Rows(np.zeros((0, 1, len(squares)))))

    @cached_property
    def information(self) -> Array:
        """Information (p, p) for each experiment."""
        E = self.rows.flat
        return np.asarray((self.squares + E.T @ E) / self.share)

    @cached_property
    def root(self) -> Array:
        """F (k', p) with ``F'F`` the information, for measures of its condition."""
        return np.concatenate([root(self.squares), self.rows.flat]) / np.sqrt(self.share)

    def part(self, at: slice) -> "Known":
        """What is known about some parameters, where it mixes them with no others."""
        rows = Rows(self.rows.given[..., at], self.rows.sigma)
        return replace(self, squares=self.squares[at, at], rows=rows)

    def plus(self, squares: Array) -> "Known":
        """The same with more information (p, p) for each experiment."""
        return replace(self, squares=self.squares + self.share * squares)

    def shared(self, times: float) -> "Known":
        """The same, shared by so many times as many experiments."""
        return replace(self, share=self.share * times)

    def in_unit(self, power: int) -> "Known":
        """The same in a unit in which rows are ``2^power`` times as large."""
        squares = np.ldexp(self.squares, 2 * power)
        return replace(self, squares=squares, rows=self.rows.in_unit(power))

    def times(self, T: Array) -> Array:
        """Information (p, p) for each experiment about parameters k' where ``k = T k'``."""
        F = root(self.squares) @ T
        # Only now the share: an irrational factor would round rows whose terms cancel.
        E = self.rows.times(T).flat
        return np.asarray((F.T @ F + E.T @ E) / self.share)

    def rounding(self, T: Array, W: Array) -> float:
        """The part of delta that rounding of `times` makes, see `errors` of a relaxation.

        Information R that was given as such is known to ``p eps (R_ii R_jj)^(1/2)``, as the design
        that it is a part of. Rows are wrong by E as those of candidates: that adds ``2 |E W|``.

        Args:
            T: ``k = T k'``.
            W: Whitens the design (p, r) for k'.
        """
        own = np.linalg.norm(np.sqrt(np.diag(self.squares))[:, None] * (T @ W), 2)
        of_squares = len(T) ** 2 * EPS * own**2 / self.share
        if not self.rows.n:
            return float(of_squares)
        E = np.linalg.norm(self.rows.rounding_of_times(T)) / np.sqrt(self.share)
        return float(of_squares + 2 * E * np.linalg.norm(W, 2))


def _inner(Z: Array, A: Array) -> Array:
    """``<a Z, a>`` (k,) of rows a (k, p)."""
    return np.asarray(np.einsum("ia,ia->i", A @ Z, A))


def _with_rows(A: Array, r: int) -> Array:
    """Regressors (n, r, p) with rows of zeros below those of A."""
    n, rows, p = A.shape
    return np.concatenate([A, np.zeros((n, r - rows, p))], axis=1) if rows < r else A
