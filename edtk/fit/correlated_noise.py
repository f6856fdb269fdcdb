"""Noise whose errors are correlated, and rows in units of their noise."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import eigenpairs
from edtk.system.typing import Array, Indices, Mask

MANY_ROWS = 2000  # rows, beyond which pandas is quicker
# Least eigenvalue of a correlation matrix that counts as positive: errors that hang together more
# than that are one error, and its inverse would be rounding.
LEAST_EIGENVALUE = 1e-12


def groups_by_size(group: Indices) -> Iterator[Indices]:
    """Members (G, s) of groups, those of one size together.

    Args:
        group: Number (m,) of each member's group, all numbers from 0 on.
    """
    order = np.argsort(group, kind="stable")
    count = np.bincount(group)
    first = np.cumsum(count) - count
    for size in np.unique(count):
        start = first[count == size]
        yield order[start[:, None] + np.arange(size)]


def occurrence(number: Indices) -> Indices:
    """How many earlier entries (m,) have the same number.

    Args:
        number: Numbers (m,) from 0 on.
    """
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    found = np.empty(len(number), dtype=int)
    found[order] = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    return found


def row_numbers(*columns: Array | Indices) -> Indices:
    """Numbers (m,) of rows, the same for equal ones, counted from 0 in order of appearance.

    Args:
        columns: Arrays (m, c), taken side by side.
    """
    # Adding zero makes -0.0 equal to 0.0, whose bytes differ.
    rows = np.hstack(columns) + 0.0
    if len(rows) < MANY_ROWS:
        # pandas takes half a millisecond to begin, and a calibration asks many times.
        number: dict[bytes, int] = {}
        found = [number.setdefault(row.tobytes(), len(number)) for row in rows]
        return np.array(found, dtype=np.intp)
    import pandas as pd

    return np.asarray(pd.factorize(pd.util.hash_pandas_object(pd.DataFrame(rows), index=False))[0])


class NotPositiveDefiniteError(ValueError):
    """A covariance matrix is none.

    Attributes:
        row: A measurement of the group that has it, counted from 0.
        eigenvalue: Least eigenvalue of the correlation matrix; NaN where a variance is not
            positive.
    """

    def __init__(self, row: int, eigenvalue: float) -> None:
        super().__init__(row, eigenvalue)
        self.row = row
        self.eigenvalue = eigenvalue

    def __str__(self) -> str:
        return f"row {self.row + 1}: its covariance is not positive definite"


@dataclass(frozen=True, eq=False)
class NoiseBlocks:
    """Groups of as many measurements each, with the covariance of all coordinates of a group.

    Errors x of a group are whitened by ``P^-1/2 V^-1/2`` (Kessy, Lewin and Strimmer 2018, "Optimal
    whitening and decorrelation", ZCA-cor), with the variances V and the correlations P: of all
    ways to whiten it keeps each coordinate nearest to itself, so that a whitened residual is still
    that of its row and axis. The order of rows does not matter, and without correlations it divides
    by sigma.

    Attributes:
        members: Measurements (G, s) of each of G groups, counted from 0.
        covariance: Covariances (G, s rows, s rows) of their coordinates [m, rad]^2.
    """

    members: Indices
    covariance: Array

    @cached_property
    def std(self) -> Array:
        """Standard deviations (G, s rows) [m, rad]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        """Eigenvalues and eigenvectors of the correlations.

        Raises:
            NotPositiveDefiniteError: A covariance is none.
        """
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)
        bad = np.flatnonzero(~(variance > 0).all(axis=1))
        if len(bad):
            raise NotPositiveDefiniteError(int(self.members[bad[0]].min()), np.nan)
        correlation = self.covariance / (self.std[:, :, None] * self.std[:, None])
        values, vectors = eigenpairs(correlation)
        bad = np.flatnonzero(values[:, 0] < LEAST_EIGENVALUE * values.shape[1])
        if len(bad):
            row = int(self.members[bad[0]].min())
            raise NotPositiveDefiniteError(row, float(values[bad[0], 0]))
        return values, vectors

    def _root(self, power: float) -> Array:
        """Powers (G, s rows, s rows) of the correlations."""
        values, vectors = self._spectrum
        return (vectors * values[:, None] ** power) @ np.swapaxes(vectors, 1, 2)

    @cached_property
    def whitener(self) -> Array:
        """Matrices W (G, s rows, s rows) that make errors independent and of size one."""
        return self._root(-0.5) / self.std[:, None]

    @cached_property
    def colourer(self) -> Array:
        """Inverses (G, s rows, s rows) of the whiteners, which make errors of independent ones."""
        return self.std[:, :, None] * self._root(0.5)

    def subset(self, chosen: Mask, place: Indices) -> Iterable["NoiseBlocks"]:
        """The groups without the measurements that are left out, by the size that remains.

        Args:
            chosen: Mask (m,) of the measurements that stay.
            place: Their new numbers (m,).
        """
        keep = chosen[self.members]
        rows = self.covariance.shape[1] // self.members.shape[1]
        for pattern in np.unique(keep, axis=0):
            groups = np.flatnonzero((keep == pattern).all(axis=1))
            if pattern.any():
                at = np.flatnonzero(np.repeat(pattern, rows))
                left = self.covariance[groups][:, at[:, None], at]
                yield NoiseBlocks(place[self.members[groups][:, pattern]], left)


@dataclass(frozen=True, eq=False)
class CorrelatedNoise:
    """Covariances of the errors of measurements; different groups of them are independent.

    Attributes:
        blocks: The groups, those of one size together; each measurement is in one group.
        shape: Number of measurements and of coordinates in each (m, rows).
    """

    blocks: tuple[NoiseBlocks, ...]
    shape: tuple[int, int]

    @classmethod
    def by_row(cls, covariance: Array) -> "CorrelatedNoise":
        """Measurements that are independent of each other, with covariances (m, rows, rows).

        Raises:
            NotPositiveDefiniteError: A covariance is none.
        """
        m, rows = covariance.shape[:2]
        return cls.of([NoiseBlocks(np.arange(m)[:, None], covariance)], (m, rows))

    @classmethod
    def of(cls, blocks: Iterable[NoiseBlocks], shape: tuple[int, int]) -> "CorrelatedNoise":
        """Check that every block can be whitened.

        Raises:
            NotPositiveDefiniteError: A covariance is none.
        """
        found = cls(tuple(blocks), shape)
        for block in found.blocks:
            _ = block.whitener
        return found

    @classmethod
    def of_any(cls, noise: "Array | CorrelatedNoise", shape: tuple[int, int]) -> "CorrelatedNoise":
        """The same noise, of standard deviations (m, rows) where it is none yet [m, rad].

        A standard deviation may be zero here: more noise has to be added before anything is
        whitened.
        """
        if isinstance(noise, CorrelatedNoise):
            return noise
        members = np.arange(shape[0])[:, None]
        return cls((NoiseBlocks(members, noise[:, :, None] ** 2 * np.eye(shape[1])),), shape)

    def with_more(self, std: Array) -> "CorrelatedNoise":
        """The same with further errors of standard deviations (m, rows), all independent."""
        blocks = []
        for block in self.blocks:
            more = std[block.members].reshape(len(block.members), -1) ** 2
            whole = block.covariance + more[:, :, None] * np.eye(more.shape[1])
            blocks.append(NoiseBlocks(block.members, whole))
        return CorrelatedNoise.of(blocks, self.shape)

    def over(self, times: Indices) -> "CorrelatedNoise":
        """The noise of means of so many measurements (m,) each, the same within a group."""
        blocks = [
            NoiseBlocks(block.members, block.covariance / times[block.members[:, 0], None, None])
            for block in self.blocks
        ]
        return CorrelatedNoise.of(blocks, self.shape)

    def among(self, members: Indices) -> Array:
        """Covariances (G, s, rows, s, rows) of groups of measurements (G, s).

        Args:
            members: The measurements; those whose errors hang together are in one group.
        """
        rows = self.shape[1]
        G, s = members.shape
        group = np.full(self.shape[0], -1)
        slot = np.zeros(self.shape[0], dtype=int)
        group[members] = np.arange(G)[:, None]
        slot[members] = np.arange(s)
        whole = np.zeros((G, s, rows, s, rows))
        for block in self.blocks:
            inside = np.flatnonzero(group[block.members[:, 0]] >= 0)
            of_block = block.members[inside]
            t = of_block.shape[1]
            part = block.covariance[inside].reshape(-1, t, rows, t, rows)
            g = group[of_block]
            at = slot[of_block]
            # Advanced indices on both sides of a slice come first.
            whole[g[:, :, None], at[:, :, None], :, at[:, None]] = np.swapaxes(part, 2, 3)
        return whole

    @cached_property
    def std(self) -> Array:
        """Standard deviations (m, rows) of single coordinates [m, rad]."""
        std = np.empty(self.shape)
        for block in self.blocks:
            std[block.members] = block.std.reshape(*block.members.shape, self.shape[1])
        return std

    def whiten(self, x: Array) -> Array:
        """Deflections or errors (..., m, rows) [m, rad] as independent numbers of size one."""
        return self._transformed(x, [block.whitener for block in self.blocks])

    def colour(self, z: Array) -> Array:
        """Errors (..., m, rows) [m, rad] of independent numbers z of size one."""
        return self._transformed(z, [block.colourer for block in self.blocks])

    def adjoint(self, z: Array) -> Array:
        """``W' z`` (..., m, rows) of whitened numbers z: ``W' W`` is the precision."""
        return self._transformed(z, [np.swapaxes(block.whitener, 1, 2) for block in self.blocks])

    def precision(self) -> Array:
        """Blocks (m, rows, rows) of the inverse covariance, each of one measurement."""
        found = np.empty((*self.shape, self.shape[1]))
        for block in self.blocks:
            G, s = block.members.shape
            W = block.whitener.reshape(G, -1, s, self.shape[1])
            found[block.members] = np.einsum("gcsr,gcst->gsrt", W, W)
        return found

    def company(self, rows: Indices) -> Indices:
        """All measurements of the groups that some measurements are in, in order."""
        found = [
            block.members[np.isin(block.members, rows).any(axis=1)].ravel() for block in self.blocks
        ]
        return np.sort(np.concatenate(found))

    def and_then(self, other: "CorrelatedNoise") -> "CorrelatedNoise":
        """The noise of these measurements, and of others behind them."""
        m = self.shape[0]
        behind = (replace(block, members=block.members + m) for block in other.blocks)
        return CorrelatedNoise((*self.blocks, *behind), (m + other.shape[0], self.shape[1]))

    def __getitem__(self, rows: Indices | slice) -> "CorrelatedNoise":
        """The noise of some measurements, each of which is taken once."""
        chosen = np.arange(self.shape[0])[rows]
        place = np.full(self.shape[0], -1)
        place[chosen] = np.arange(len(chosen))
        blocks = [part for block in self.blocks for part in block.subset(place >= 0, place)]
        return CorrelatedNoise(tuple(blocks), (len(chosen), self.shape[1]))

    def _transformed(self, x: Array, matrices: list[Array]) -> Array:
        """Numbers (..., m, rows) that a matrix of each group was applied to."""
        found = np.empty(x.shape)
        for block, matrix in zip(self.blocks, matrices, strict=True):
            part = x[..., block.members, :]
            whole = part.reshape(*part.shape[:-2], -1, 1)
            found[..., block.members, :] = (matrix @ whole).reshape(part.shape)
        return found


ROWS_AT_ONCE = 20_000  # measurements whose columns are kept at once


def whole_groups(group: Indices) -> Iterator[Indices]:
    """Measurements, about `ROWS_AT_ONCE` at a time, of which none of a group (m,) is apart.

    Where sums over all of them are sought, so many columns need not be kept. Groups are numbered
    from 0.
    """
    if len(group) <= ROWS_AT_ONCE:
        yield np.arange(len(group))
        return
    block = np.cumsum(np.bincount(group))[group] // ROWS_AT_ONCE
    for number in np.unique(block):
        yield np.flatnonzero(block == number)


# Standard deviations (m, rows), or covariances of groups of measurements.
RowNoise = Array | CorrelatedNoise
# The same where one number, or one for each row, will do.
AnyNoise = ArrayLike | CorrelatedNoise


def whiten(x: Array, noise: AnyNoise) -> Array:
    """Make errors of measured rows independent and of size one.

    Args:
        x: Deflections or residuals (..., m, rows) [m, rad].
        noise: Standard deviations that broadcast to (m, rows), or correlated noise.

    Returns:
        ``x / sigma``, or ``W x`` where noise is correlated.
    """
    if isinstance(noise, CorrelatedNoise):
        return noise.whiten(x)
    return np.asarray(x / np.asarray(noise, dtype=float))


def scaled(noise: RowNoise, factor: float) -> RowNoise:
    """The same noise with errors that are so many times as large."""
    if not isinstance(noise, CorrelatedNoise):
        return factor * noise
    blocks = (replace(one, covariance=factor**2 * one.covariance) for one in noise.blocks)
    return CorrelatedNoise(tuple(blocks), noise.shape)


def whiten_columns(A: Array, noise: AnyNoise) -> Array:
    """The same for each column of regressors (m, rows, p)."""
    if isinstance(noise, CorrelatedNoise):
        return np.moveaxis(noise.whiten(np.moveaxis(A, -1, 0)), 0, -1)
    sigma = np.broadcast_to(np.asarray(noise, dtype=float), A.shape[:2])
    return np.asarray(A / sigma[..., None])


def numbers_of(noise: AnyNoise) -> list[Array]:
    """All numbers that a noise has, by which it is told from another one."""
    if isinstance(noise, CorrelatedNoise):
        members = [block.members.astype(float) for block in noise.blocks]
        return [*members, *(block.covariance for block in noise.blocks)]
    return [np.asarray(noise)]


def std_of(noise: AnyNoise) -> Array:
    """Standard deviations of single coordinates [m, rad]."""
    return noise.std if isinstance(noise, CorrelatedNoise) else np.asarray(noise, dtype=float)
