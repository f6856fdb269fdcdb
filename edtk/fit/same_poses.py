"""Visits of one pose, which share what the drawing errs by, as rows that err independently."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.fit.correlated_noise import groups_by_size, row_numbers
from edtk.measure.whitening import Scatter
from edtk.system.typing import Array, Indices, Mask

# Joints nearer than a hundredth of a degree are where they were [rad, m]: controllers show no more,
# and what a drawing errs by changes over degrees.
SAME_ANGLES = float(np.deg2rad(0.01))
SINGULAR = 1e-9  # relative variance of a sum of errors that rounding makes of none


@dataclass(frozen=True, eq=False)
class Groups:
    """Groups of s visits of a pose each.

    Attributes:
        members: The visits (G, s).
        apart: A (G, s, s, k, rows): the mean of a group's visits, and what tells them apart.
        back: Its inverse, where something was read.
        worth: Readings (G, s, k, rows) that say as much as each of these.
        changes: What shares (G, s, k, rows) of the variance of a change they have.
    """

    members: Indices
    apart: Array
    back: Array
    worth: Array
    changes: Array

    @classmethod
    def of(cls, members: Indices, worth: Array, changed: Mask) -> "Groups":
        """Of visits that are worth so many readings (m, k, rows), which (m,) a load changes."""
        n = worth[members]
        s = members.shape[1]
        A, told = np.zeros((len(n), s, *n.shape[1:])), np.zeros_like(n)
        mean, so_far = np.zeros_like(n), np.zeros_like(n[:, 0])
        for i in range(s):
            total = so_far + n[:, i]
            rest, told[:, i] = (
                np.divide(one, total, out=np.zeros_like(total), where=total > 0)
                for one in (so_far, so_far * n[:, i])
            )
            A[:, i] = -mean
            A[:, i, i] += 1.0
            A[:, i] *= (told[:, i] > 0)[:, None]
            mean = mean * rest[:, None]
            mean[:, i] += 1 - rest
            so_far = total
        A[:, 0], told[:, 0] = mean, so_far
        # Errors of visits have the variances 1 / n, and their rows 1 / told.
        each = np.divide(1.0, n, out=np.zeros_like(n), where=n > 0)
        back = np.swapaxes(A, 1, 2) * each[:, :, None] * told[:, None]
        changes = np.einsum("gaikr,gi->gakr", A**2, changed[members])
        return cls(members, A, back, told, changes)

    def __getitem__(self, some: slice) -> "Groups":
        """Some of the groups."""
        each = (self.apart[some], self.back[some], self.worth[some], self.changes[some])
        return Groups(self.members[some], *each)

    def of_visits(self, covariances: Array) -> Array:
        """Covariances (G, s r, s r) of all visits of a pose, of those of its rows."""
        G, s = self.members.shape
        B = self.back.reshape(G, s, s, -1)
        C = covariances.reshape(G, s, B.shape[-1], s, -1)
        V = np.einsum("giar,garbq,gjbq->girjq", B, C, B, optimize=True)
        return np.asarray(V.reshape(covariances.shape))

    def back_to_visits(self, rows: Array) -> Array:
        """What rows (G, s, r) are of the visits."""
        B = self.back.reshape(*self.back.shape[:3], -1)
        return np.asarray(np.einsum("giar,gar->gir", B, rows))

    def roots(self, sizes: Array) -> Array:
        """What errors (G, s, r) of visits, each by itself, make of the rows (G, s, s, r)."""
        A = self.apart
        return np.asarray(A.reshape(*A.shape[:3], -1) * sizes[:, None])


@dataclass(frozen=True, eq=False)
class SamePoses:
    """Means of readings in m visits as rows that err independently, and how to go back.

    What the drawing errs by is the same in all visits of a pose, whatever loads it. Visits i of a
    pose, each the mean of n_i readings with the covariance R, have ``R / n_i + D``, and D between
    them. Their mean ``sum n_i y_i / N`` has ``R / N + D``, and a visit less the mean of those
    before it, of N_i readings, ``R (1 / n_i + 1 / N_i)`` without any D: it is a difference, as if
    that had been read. These are independent where all markers of a pose are read as often, or
    joints return exactly. The mean stands where the first of the visits was, and each difference
    where its visit was.

    A visit under a load has an error of that change besides, of which the mean and differences have
    shares: of a visit without and one with the load a quarter of its variance, and all of it. So
    rows of a pose have these errors in common, which a fit does not count when it weighs them.

    Attributes:
        pose: Number (m,) of each visit's pose, counted from 0.
        worth: As many absolute readings say as much of each row (m, k, rows).
        differs: Which (m,) are differences of two readings.
        changed: Which visits (m,) have the error of a change: they are under a load.
        changes: What shares (m, k, rows) of the variance of a change the rows have.
        groups: Visits that share a pose, by their number.
    """

    pose: Indices
    worth: Array
    differs: Mask
    changed: Mask
    changes: Array
    groups: tuple[Groups, ...]

    @classmethod
    def of(cls, q: Array, counts: Array, differs: Mask, loaded: Mask) -> "SamePoses":
        """Find those that share a pose.

        Args:
            q: Joint variables (m, n) [rad or m].
            counts: Readings (m, k, rows) of each row.
            differs: Which visits (m,) are differences, that share nothing with others.
            loaded: Which are under a load.
        """
        pose = _near(q, np.arange(1, len(q) + 1) * differs)
        changed = differs | loaded
        # A difference has the noise of two readings, and counts as half of one.
        worth = counts * np.where(differs, 0.5, 1.0)[:, None, None]
        several = (one for one in groups_by_size(pose) if one.shape[1] > 1)
        groups = tuple(Groups.of(members, worth, changed) for members in several)
        told = differs.copy()
        changes = (worth > 0) * changed[:, None, None].astype(float)
        for one in groups:
            worth[one.members] = one.worth
            changes[one.members] = one.changes
            told[one.members[:, 1:]] = True
        return cls(pose, worth, told, changed, changes, groups)

    def apart(self, visits: Array) -> Array:
        """The independent rows of what visits (m, k, rows, ...) are."""
        return self._changed(visits, [one.apart for one in self.groups])

    def back(self, rows: Array) -> Array:
        """Visits of independent rows (m, k, rows, ...); zero where nothing was read."""
        return self._changed(rows, [one.back for one in self.groups])

    def variances(self, rows: Array) -> Array:
        """Variances of visits, of those (m, k, rows) of independent rows."""
        return self._changed(rows, [one.back**2 for one in self.groups])

    def _changed(self, each: Array, matrices: list[Array]) -> Array:
        """Numbers of which those of a group are sums of all of its own."""
        found = each.copy() if matrices else each
        for one, A in zip(self.groups, matrices, strict=True):
            found[one.members] = np.einsum("gijkr,gjkr...->gikr...", A, each[one.members])
        return found

    def one_by_one(self, visits: Array) -> Iterator[tuple[Indices, Array]]:
        """Rows that visits (m, k, rows, ...) make each by itself: the first of poses, and so on.

        Returns:
            By each, of which visit the rows (m,) are then, and -1 for none; and the rows.
        """
        for i in range(max((one.members.shape[1] for one in self.every), default=0)):
            own, rows = np.full(len(self.pose), -1), np.zeros_like(visits)
            for one in self.every:
                if i < one.members.shape[1]:
                    own[one.members] = one.members[:, [i]]
                    some = visits[one.members[:, i]]
                    rows[one.members] = np.einsum("gakr,gkr...->gakr...", one.apart[:, :, i], some)
            yield own, rows

    @cached_property
    def every(self) -> "tuple[Groups, ...]":
        """All visits in groups: those that share a pose with no other one come first."""
        several = [one.members.ravel() for one in self.groups]
        alone = np.setdiff1d(np.arange(len(self.pose)), np.concatenate([[], *several]))
        if not len(alone):
            return self.groups
        worth, changes = self.worth[alone, None], self.changes[alone, None]
        itself = (worth[:, None] > 0).astype(float)
        return (Groups(alone[:, None], itself, itself, worth, changes), *self.groups)

    def together(self, covariances: Array) -> Iterator[tuple[Indices, Array]]:
        """Covariances (G, s r, s r) of visits (G, s) of a pose, of those (m, r, r) of the rows."""
        for one in self.every:
            yield one.members, one.of_visits(blocks_of(covariances[one.members]))


def blocks_of(each: Array) -> Array:
    """Matrices (G, s r, s r) with blocks (G, s, r, r) on their diagonals."""
    G, s, r, _ = each.shape
    return Scatter(each, np.zeros((G, s * r, 0))).dense


def _near(q: Array, number: Indices) -> Indices:
    """Numbers (m,) of poses, of visits that some numbers (m,) do not tell apart.

    In each joint the values of a pose are steps of `SAME_ANGLES` at most apart. Where many such
    steps lead on, as along a path, a pose ends after two.

    Args:
        q: Joint variables (m, n) [rad or m].
        number: The numbers, from 0 on.
    """
    told = -1
    while told < (told := number.max(initial=-1)):
        for values in q.T:
            order = np.lexsort((values, number))
            begins = np.zeros(len(q), dtype=bool)
            begins[1:] = np.diff(number[order]) > 0
            begins[1:] |= np.diff(values[order]) > SAME_ANGLES
            number[order] = np.cumsum(begins)
    least = np.full((len(q) + 1, q.shape[1]), np.inf)
    np.minimum.at(least, number, q)
    return row_numbers(number[:, None], (q - least[number]) // (2 * SAME_ANGLES))


def surprise_of(covariances: Array, errors: Array) -> Array:
    """Squared sizes (G, s) of errors of visits (G, s, r) of a pose, over their covariances.

    It is the larger of two: that of the visit alone, ``e_i' (V_ii)^-1 e_i``, and that where all its
    others are known, ``b_i = (P e)_i' (P_ii)^-1 (P e)_i`` with the inverse P of the covariance V of
    all visits. What another visit explains more, ``max_j b_j - b_i``, is taken from the latter: a
    sound visit is far from a wrong one, too, and all squares but ``b_i`` stay when it is left out.

    Args:
        covariances: V (G, s r, s r).
        errors: The errors.
    """
    G, s, r = errors.shape
    inverse = np.linalg.pinv(covariances, rcond=SINGULAR, hermitian=True)
    Pe = (inverse @ errors.reshape(G, s * r, 1)).reshape(errors.shape)
    V, P = (np.einsum("girix->girx", one.reshape(G, s, r, s, r)) for one in (covariances, inverse))
    beside = _squares(Pe, P)
    beside = 2 * beside - beside.max(axis=1, keepdims=True)
    return np.maximum(_squares(errors, V), beside)


def _squares(errors: Array, covariances: Array) -> Array:
    """Squared sizes (G, s) of errors (G, s, r) over covariances, of which some are singular."""
    inverse = np.linalg.pinv(covariances, rcond=SINGULAR, hermitian=True)
    return np.asarray(np.einsum("gir,girq,giq->gi", errors, inverse, errors))
