"""Columns of a design of which each instrument's rows have few: its own, and those of all."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.measure.whitening import Precision, Scatter, blocks_times
from edtk.system.typing import Array, Indices, Mask

DEPENDENT = 1e-8  # singular value of columns of unit length, beside the largest, that is rounding


@dataclass(frozen=True, eq=False)
class FewColumns:
    """A design X (m, r, p) of visits in which each of k instruments has d rows, ``r = k d``.

    A marker's place on the tool moves its own rows alone: of 200 markers and 600 such places any
    row has three. So columns are kept by instrument, and sums over rows go by these few.

    Attributes:
        part: What the rows of each instrument have (m, k, d, c).
        of: Which columns (k, c) of X these are; p where an instrument has fewer.
        p: Columns of X.
    """

    part: Array
    of: Indices
    p: int

    @classmethod
    def among(cls, X: Array, instruments: int) -> "FewColumns":
        """Of columns X (m, r, p), by which rows they are not zero in."""
        m, r, p = X.shape
        rows = X.reshape(m, instruments, r // instruments, p)
        touched = np.any(rows, axis=(0, 2))
        width = int(touched.sum(axis=1).max(initial=0))
        of = np.full((instruments, width), p)
        part = np.zeros((*rows.shape[:3], width))
        for k, own in enumerate(touched):
            chosen = np.flatnonzero(own)
            of[k, : len(chosen)] = chosen
            part[:, k, :, : len(chosen)] = rows[:, k, :, chosen].transpose(1, 2, 0)
        return cls(part, of, p)

    def __getitem__(self, chosen: slice | Indices) -> "FewColumns":
        """The rows of some visits."""
        return replace(self, part=self.part[chosen])

    @property
    def dense(self) -> Array:
        """X (m, r, p)."""
        return self.chosen(np.arange(self.p))

    def beside(self, columns: Array) -> "FewColumns":
        """With columns (m, r, c) that may move all rows behind the others."""
        m, k, d, _ = self.part.shape
        extra = columns.shape[-1]
        part = np.concatenate([self.part, columns.reshape(m, k, d, extra)], axis=-1)
        # Where an instrument has fewer columns, what stands there is zero.
        of = np.where(self.of == self.p, self.p + extra, self.of)
        behind = np.tile(np.arange(self.p, self.p + extra), (k, 1))
        return FewColumns(part, np.concatenate([of, behind], axis=1), self.p + extra)

    @cached_property
    def _split(self) -> "_Split":
        """The columns of each instrument alone, and all others."""
        return _Split.of_columns(self)

    def times(self, values: Array) -> Array:
        """``X v`` (m, r) of values (p,)."""
        return self.combined(values[:, None])[..., 0]

    def onto(self, rows: Array) -> Array:
        """``sum_b X_b' y_b`` (p, n) of rows y (m, r, n)."""
        split = self._split
        k, c, _ = split.transposed.shape
        own = (split.transposed @ split.by_instrument(rows)).reshape(k * c, rows.shape[-1])
        return np.concatenate([summed(split.rows, rows), own])[split.place]

    def seen_by(self, rows: Array) -> Array:
        """``y_b' X_b`` (m, n, p) of rows y (m, r, n), visit by visit."""
        split = self._split
        m, k, d, c = split.own.shape
        n = rows.shape[-1]
        each = np.swapaxes(rows.reshape(m, k, d, n), 2, 3) @ split.own
        seen = np.swapaxes(each, 1, 2).reshape(m, n, k * c)
        shared = np.swapaxes(rows, 1, 2) @ split.rows
        return np.concatenate([shared, seen], axis=-1)[..., split.place]

    def gram(self, blocks: Array) -> Array:
        """``sum_b X_b' S_b X_b`` (p, p) of symmetric blocks S (m, k, d, d) of the instruments."""
        split = self._split
        m, k, d, c = split.own.shape
        g = len(split.shared)
        both = blocks @ split.both
        found = np.zeros((g + k * c, g + k * c))
        found[:g, :g] = summed(split.rows, both[..., :g].reshape(m, k * d, g))
        own = split.transposed @ split.by_instrument(both)
        found[g:, :g] = own[..., :g].reshape(k * c, g)
        found[:g, g:] = found[g:, :g].T
        # The squares of each instrument alone, on the diagonal.
        at = g + np.arange(k * c).reshape(k, c)
        found[at[:, :, None], at[:, None]] = own[..., g:]
        return found[split.place[:, None], split.place]

    def information(self, weights: Precision, F: Array | None = None) -> Array:
        """``X' V^-1 X`` (p, p) of the rows of all visits.

        Args:
            weights: ``V^-1 = A - B B'``.
            F: ``B' X`` (m, n, p), where it is there already.
        """
        F = self.seen_by(weights.together) if F is None else F
        return self.gram(weights.apart) - summed(F, F)

    def combined(self, values: Array) -> Array:
        """``X C`` (m, r, c) of coefficients C (p, c)."""
        split = self._split
        m, k, d, _ = split.own.shape
        own = np.concatenate([values, np.zeros((1, values.shape[1]))])[split.of]
        return split.rows @ values[split.shared] + (split.own @ own).reshape(m, k * d, -1)

    def scaled(self, roots: Array | Mask) -> "FewColumns":
        """The same with rows times numbers that broadcast to (m, k, d)."""
        return replace(self, part=self.part * roots[..., None])

    def in_units(self, scales: Array) -> "FewColumns":
        """The same with columns times numbers (p,)."""
        return replace(self, part=self.part * np.append(scales, 0.0)[self.of][:, None])

    def chosen(self, columns: Indices) -> Array:
        """Some of the columns (m, r, c)."""
        m, k, d, _ = self.part.shape
        place = np.full(self.p + 1, len(columns))
        place[columns] = np.arange(len(columns))
        X = np.zeros((m, k, d, len(columns) + 1))
        # Of the columns that are not asked for, any one stands at the end.
        X[:, np.arange(k)[:, None], :, place[self.of]] = self.part.transpose(1, 3, 0, 2)
        return X[..., : len(columns)].reshape(m, k * d, len(columns))

    def independent(self) -> "FewColumns":
        """Orthonormal columns that span the same; as many are zero as depend on others.

        First those of each instrument alone, then what these leave of the others. Both by singular
        values, of columns of unit length.
        """
        split = self._split
        m, k, d, _ = split.own.shape
        basis = spanning(split.by_instrument(split.own))
        shared = split.by_instrument(split.rows)
        length = np.linalg.norm(shared, axis=(0, 1))
        rest = spanning(_less(shared, basis).reshape(k * m * d, -1), length)
        both = np.concatenate([basis, rest.reshape(k, m * d, -1)], axis=-1)
        of = np.concatenate([split.of, np.tile(split.shared, (k, 1))], axis=1)
        return FewColumns(np.moveaxis(both.reshape(k, m, d, -1), 0, 1), of, self.p)

    @property
    def compressed(self) -> Array:
        """Rows R (n, p) that are these turned, ``R'R = X'X``.

        The turns are those of QR factors: of each instrument alone, and of what these leave. So
        there are as few as columns, of instruments that have equally many alone.
        """
        split = self._split
        Q, R = np.linalg.qr(split.by_instrument(split.own))
        shared = split.by_instrument(split.rows)
        rows = np.zeros((*R.shape[:2], self.p + 1))
        rows[np.arange(len(R))[:, None], :, split.of] = np.swapaxes(R, 1, 2)
        rows[..., split.shared] = np.swapaxes(Q, 1, 2) @ shared
        left = _less(shared, Q).reshape(len(Q) * Q.shape[1], -1)
        last = np.zeros((min(left.shape), self.p))
        last[:, split.shared] = np.linalg.qr(left, mode="r")
        return np.concatenate([rows[..., : self.p].reshape(-1, self.p), last])

    @property
    def rank(self) -> int:
        """How many columns are not zero."""
        return len(np.setdiff1d(self.of[self.part.any(axis=(0, 2))], [self.p]))


@dataclass(frozen=True, eq=False)
class _Split:
    """Columns of each instrument alone, and those of several, so that sums are few products.

    Attributes:
        shared: Columns (g,) that are not one instrument's alone; all, where there is but one.
        rows: Their rows (m, r, g).
        of: Columns (k, c) of each instrument alone; p where it has fewer.
        own: Their rows (m, k, d, c).
        place: Where each column (p,) is among the shared and after them those of instruments.
    """

    shared: Indices
    rows: Array
    of: Indices
    own: Array
    place: Indices

    @classmethod
    def of_columns(cls, few: FewColumns) -> "_Split":
        """Of all columns."""
        count = np.bincount(few.of.ravel(), minlength=few.p + 1)
        alone = np.where((count[few.of] == 1) & (len(few.of) > 1), few.of, few.p)
        first = np.argsort(alone, axis=1)[:, : (alone < few.p).sum(axis=1).max()]
        of = np.take_along_axis(alone, first, axis=1)
        own = np.take_along_axis(few.part, first[None, :, None], axis=-1) * (of < few.p)[:, None]
        shared = np.setdiff1d(np.arange(few.p), of)
        place = np.argsort(np.append(shared, of), kind="stable")[: few.p]
        return cls(shared, few.chosen(shared), of, own, place)

    def by_instrument(self, rows: Array) -> Array:
        """Rows (m, r, c), or (m, k, d, c), of all visits of each instrument (k, m d, c)."""
        m, k, d, _ = self.own.shape
        each = rows.reshape(m, k, d, rows.shape[-1])
        return np.swapaxes(each, 0, 1).reshape(k, m * d, rows.shape[-1])

    @cached_property
    def both(self) -> Array:
        """What the rows of each instrument have (m, k, d, g + c): the shared, and its own."""
        rows = self.rows.reshape(*self.own.shape[:3], len(self.shared))
        return np.concatenate([rows, self.own], axis=-1)

    @cached_property
    def transposed(self) -> Array:
        """The instruments' own columns (k, c, m d)."""
        return np.ascontiguousarray(np.swapaxes(self.by_instrument(self.own), 1, 2))


def _less(columns: Array, basis: Array) -> Array:
    """What orthonormal bases (k, n, b) leave of columns (k, n, c)."""
    # Twice is enough: one pass leaves rounding of the size of what it removes.
    for _ in range(2 if basis.size else 0):
        columns = columns - basis @ (np.swapaxes(basis, 1, 2) @ columns)
    return columns


def spanning(columns: Array, whole: Array | None = None) -> Array:
    """Orthonormal columns (..., n, c) that span some, the last of them zero if these depend.

    Args:
        columns: The columns.
        whole: Their lengths (c,) before others were taken out of them: rounding may be all that
            was left of one. None where nothing was.
    """
    length = np.linalg.norm(columns, axis=-2, keepdims=True)
    told = length > (0.0 if whole is None else DEPENDENT * whole)
    unit = np.where(told, columns, 0.0) / np.where(told, length, 1.0)
    U, sizes, _ = np.linalg.svd(unit, full_matrices=False)
    apart = sizes > DEPENDENT * sizes.max(axis=-1, keepdims=True, initial=0.0)
    found = np.zeros_like(columns)
    found[..., : sizes.shape[-1]] = U * apart[..., None, :]
    return found


def root_of(information: Array) -> Array:
    """C (p, p), ``C C'`` the inverse of an information matrix; rows of zero columns are zero."""
    from scipy.linalg.lapack import dtrtri  # not needed to read a study

    told = np.flatnonzero(np.diagonal(information) > 0)
    # Of unit columns: parameters of other sizes are no rounding.
    size = np.sqrt(np.diagonal(information)[told])
    some = np.ix_(told, told)
    L = np.linalg.cholesky(information[some] / np.outer(size, size))
    C = np.zeros_like(information)
    C[some] = dtrtri(L.T)[0] / size[:, None] if len(told) else 0.0
    return C


def inverse_of(information: Array) -> tuple[Array, float]:
    """Inverse H (p, p) of an information matrix, and the logarithm of its determinant.

    Columns that are zero tell nothing, and their rows of H are zero.
    """
    C = root_of(information)
    sizes = np.diagonal(C)
    return C @ C.T, -2 * float(np.log(sizes[sizes > 0]).sum())


def between(
    design: FewColumns,
    weights: Precision,
    K: Array,
    F: Array | None = None,
    moved: Array | None = None,
) -> tuple[Array, Array]:
    """``X' W K W X`` (p, p) and ``C' K W X`` (m, c, p) of weights ``W = A - B B'``.

    With ``F = B' X``, ``E = C' K A X`` and ``D = C' K W X = E - C' K B F`` the first is
    ``X' A K A X - Y - Y'``, ``Y = F' (E + D) / 2`` of the columns B among C.

    Args:
        design: Columns X.
        weights: The weights W.
        K: Symmetric blocks (m, k, d, d) of the instruments.
        F: ``B' X`` (m, n, p), where it is there already.
        moved: ``K C`` (m, r, c) of columns C of which the first are B; of B by default.
    """
    A, B = weights.apart, weights.together
    KC = blocks_times(K, B) if moved is None else moved
    F = design.seen_by(B) if F is None else F
    E = design.seen_by(blocks_times(A, KC))
    D = E - np.swapaxes(KC, 1, 2) @ B @ F
    Y = summed(F, (E + D)[:, : B.shape[2]] / 2)
    return design.gram(A @ K @ A) - Y - Y.T, D


def sandwich(design: FewColumns, weights: Precision, V: Scatter) -> Array:
    """``X' W V W X`` (p, p) of weights W and covariances V."""
    seen = design.seen_by(weights.times(V.together))
    return between(design, weights, V.apart)[0] + summed(seen, seen)


def summed(left: Array, right: Array) -> Array:
    """``sum_b L_b' R_b`` (p, q) of rows (m, n, p) and (m, n, q)."""
    m, n, p = left.shape
    return left.reshape(m * n, p).T @ right.reshape(m * n, right.shape[-1])


@dataclass(frozen=True, eq=False)
class Beside:
    """Columns and residuals beside a design X that is fitted with them, by weights W.

    Attributes:
        design: Columns X.
        weights: W.
        root: C (p, p), ``C C' = (X' W X)^-1``, so that ``X C`` is orthonormal.
    """

    design: FewColumns
    weights: Precision
    root: Array

    @classmethod
    def of(cls, design: FewColumns, V: Scatter) -> "Beside":
        """Of rows whose errors have covariances V."""
        weights = V.inverse
        return cls(design, weights, root_of(design.information(weights)))

    def along(self, columns: Array) -> Array:
        """``C' X_b' W_b Y_b`` (m, p, c) of columns Y (m, r, c), visit by visit."""
        seen = self.design.seen_by(self.weights.times(columns))
        return np.swapaxes(seen @ self.root, 1, 2)

    def left(self, columns: Array) -> Array:
        """What the design leaves of columns (m, r, c): ``Y - X (X' W X)^-1 X' W Y``."""
        # Twice is enough: one pass leaves rounding of the size of what it removes.
        for _ in range(2):
            onto = self.design.onto(self.weights.times(columns))
            columns = columns - self.design.combined(self.root @ (self.root.T @ onto))
        return columns
