"""Columns of a design of which each instrument's rows have few: its own, and those of all."""

from dataclasses import dataclass, replace

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

    @property
    def shape(self) -> tuple[int, int, int]:
        """Visits m, rows r and columns p."""
        m, k, d, _ = self.part.shape
        return m, k * d, self.p

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

    def times(self, values: Array) -> Array:
        """``X v`` (m, r) of values (p,)."""
        m, r, _ = self.shape
        own = np.append(values, 0.0)[self.of]
        return np.asarray((self.part @ own[..., None]).reshape(m, r))

    def onto(self, rows: Array) -> Array:
        """``sum_b X_b' y_b`` (p, n) of rows y (m, r, n)."""
        m, k, d, c = self.part.shape
        n = rows.shape[-1]
        X = self.part.transpose(1, 3, 0, 2).reshape(k, c, m * d)
        y = rows.reshape(m, k, d, n).transpose(1, 0, 2, 3).reshape(k, m * d, n)
        found = np.zeros((self.p + 1, n))
        np.add.at(found, self.of, X @ y)
        return found[: self.p]

    def seen_by(self, rows: Array) -> Array:
        """``y_b' X_b`` (m, n, p) of rows y (m, r, n), visit by visit."""
        m, k, d, _ = self.part.shape
        y = np.swapaxes(rows.reshape(m, k, d, -1), 2, 3)
        each = y @ self.part
        found = np.zeros((m, y.shape[2], self.p + 1))
        for i, own in enumerate(self.of):
            found[..., own] += each[:, i]
        return found[..., : self.p]

    def gram(self, blocks: Array) -> Array:
        """``sum_b X_b' S_b X_b`` (p, p) of symmetric blocks S (m, k, d, d) of the instruments."""
        m, k, d, c = self.part.shape
        X = self.part.transpose(1, 3, 0, 2).reshape(k, c, m * d)
        SX = (blocks @ self.part).transpose(1, 0, 2, 3).reshape(k, m * d, c)
        found = np.zeros((self.p + 1, self.p + 1))
        for own, square in zip(self.of, X @ SX, strict=True):
            found[own[:, None], own] += square
        return found[: self.p, : self.p]

    def information(self, weights: Precision) -> Array:
        """``X' V^-1 X`` (p, p) of the rows of all visits."""
        common = self.seen_by(weights.together)
        return self.gram(weights.apart) - summed(common, common)

    def combined(self, values: Array) -> Array:
        """``X C`` (m, r, c) of coefficients C (p, c)."""
        m, k, d, c = self.part.shape
        own = np.concatenate([values, np.zeros((1, values.shape[1]))])[self.of]
        found = self.part.transpose(1, 0, 2, 3).reshape(k, m * d, c) @ own
        return np.moveaxis(found.reshape(k, m, d, -1), 0, 1).reshape(m, k * d, -1)

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
        for i, own in enumerate(place[self.of]):
            told = own < len(columns)
            X[:, i, :, own[told]] = np.moveaxis(self.part[:, i][..., told], -1, 0)
        return X[..., : len(columns)].reshape(m, k * d, len(columns))

    @property
    def _alone(self) -> Mask:
        """Which of the columns of each instrument (k, c) are those of no other; none of one."""
        count = np.bincount(self.of.ravel(), minlength=self.p + 1)
        count[self.p] = 0
        return np.asarray((count[self.of] == 1) & (len(self.of) > 1))

    def independent(self) -> "FewColumns":
        """Orthonormal columns that span the same; as many are zero as depend on others.

        First those of each instrument alone, then what these leave of the others. Both by singular
        values, of columns of unit length.
        """
        m, k, d, _ = self.part.shape
        alone = self._alone
        shared, rest = self._shared
        part = np.zeros((m, k, d, int(alone.sum(axis=1).max(initial=0))))
        of = np.full((k, part.shape[-1]), self.p)
        for i, own in enumerate(alone):
            basis = spanning(self._rows(i, own))
            rest[i] = _less(rest[i], basis)
            part[:, i, :, : basis.shape[1]] = basis.reshape(m, d, -1)
            of[i, : basis.shape[1]] = self.of[i, own]
        spanned = spanning(rest.reshape(-1, len(shared)))
        spanned = np.moveaxis(spanned.reshape(k, m, d, -1), 0, 1)
        both = np.concatenate([of, np.tile(shared, (k, 1))], axis=1)
        return FewColumns(np.concatenate([part, spanned], axis=-1), both, self.p)

    @property
    def compressed(self) -> Array:
        """Rows R (n, p) that are these turned, ``R'R = X'X``, and as few as columns.

        The turns are those of QR factors: of each instrument alone, and of what these leave.
        """
        shared, rest = self._shared
        parts = []
        for i, own in enumerate(self._alone):
            Q, R = np.linalg.qr(self._rows(i, own))
            rows = np.zeros((len(R), self.p))
            rows[:, self.of[i, own]] = R
            rows[:, shared] = Q.T @ rest[i]
            parts.append(rows)
            rest[i] = _less(rest[i], Q)
        rows = np.zeros((min(rest[..., 0].size, len(shared)) if len(shared) else 0, self.p))
        rows[:, shared] = np.linalg.qr(rest.reshape(-1, len(shared)), mode="r")
        return np.concatenate([*parts, rows])

    @property
    def _shared(self) -> tuple[Indices, Array]:
        """The columns (g,) that are not one instrument's alone, and their rows (k, m d, g)."""
        alone = self._alone
        shared = np.setdiff1d(self.of[~alone], [self.p])
        m, k, d, _ = self.part.shape
        rows = self.chosen(shared).reshape(m, k, d, -1)
        return shared, np.moveaxis(rows, 1, 0).reshape(k, m * d, -1)

    def _rows(self, instrument: int, own: Mask) -> Array:
        """Some of the columns (m d, c) of an instrument."""
        return self.part[:, instrument].reshape(-1, len(own))[:, own]

    @property
    def rank(self) -> int:
        """How many columns are not zero."""
        told = np.zeros(self.p + 1, dtype=bool)
        told[self.of[self.part.any(axis=(0, 2))]] = True
        return int(told[: self.p].sum())


def _less(columns: Array, basis: Array) -> Array:
    """What an orthonormal basis (n, b) leaves of columns (n, c)."""
    # Twice is enough: one pass leaves rounding of the size of what it removes.
    for _ in range(2 if basis.size else 0):
        columns = columns - basis @ (basis.T @ columns)
    return columns


def spanning(columns: Array) -> Array:
    """Orthonormal columns (n, c) that span some (n, c), the last of them zero if these depend."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(length > 0, length, 1.0)
    U, sizes, _ = np.linalg.svd(unit, full_matrices=False)
    told = sizes > DEPENDENT * sizes.max(initial=0.0)
    found = np.zeros_like(columns)
    found[:, : len(sizes)] = U * told
    return found


def root_of(information: Array) -> Array:
    """C (p, p), ``C C'`` the inverse of an information matrix; rows of zero columns are zero."""
    told = np.flatnonzero(np.diagonal(information) > 0)
    # Of unit columns: parameters of other sizes are no rounding.
    size = np.sqrt(np.diagonal(information)[told])
    L = np.linalg.cholesky(information[np.ix_(told, told)] / np.outer(size, size))
    C = np.zeros_like(information)
    C[np.ix_(told, told)] = np.linalg.solve(L, np.diag(1 / size)).T
    return C


def inverse_of(information: Array) -> tuple[Array, float]:
    """Inverse H (p, p) of an information matrix, and the logarithm of its determinant.

    Columns that are zero tell nothing, and their rows of H are zero.
    """
    C = root_of(information)
    sizes = np.diagonal(C)
    return C @ C.T, -2 * float(np.log(sizes[sizes > 0]).sum())


def between(
    design: FewColumns, weights: Precision, K: Array, F: Array | None = None
) -> tuple[Array, Array]:
    """``X' W K W X`` (p, p) and ``B' K W X`` (m, n, p) of weights ``W = A - B B'``.

    With ``F = B' X``, ``E = B' K A X`` and ``D = B' K W X = E - B' K B F`` the first is
    ``X' A K A X - Y - Y'``, ``Y = F' (E + D) / 2``.

    Args:
        design: Columns X.
        weights: The weights W.
        K: Symmetric blocks (m, k, d, d) of the instruments.
        F: ``B' X`` (m, n, p), where it is there already.
    """
    A, B = weights.apart, weights.together
    KB = blocks_times(K, B)
    F = design.seen_by(B) if F is None else F
    E = design.seen_by(blocks_times(A, KB))
    D = E - np.swapaxes(B, 1, 2) @ KB @ F
    Y = summed(F, (E + D) / 2)
    return design.gram(A @ K @ A) - Y - Y.T, D


def sandwich(design: FewColumns, weights: Precision, V: Scatter) -> Array:
    """``X' W V W X`` (p, p) of weights W and covariances V."""
    seen = design.seen_by(weights.times(V.together))
    return between(design, weights, V.apart)[0] + summed(seen, seen)


def summed(left: Array, right: Array) -> Array:
    """``sum_b L_b' R_b`` (p, q) of rows (m, n, p) and (m, n, q)."""
    return np.tensordot(left, right, axes=((0, 1), (0, 1)))


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
