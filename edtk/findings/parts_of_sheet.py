"""Parts of a sheet that look written in another unit than the rest: some rows, or one column."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from edtk.findings.causes.faults import UNITS
from edtk.findings.nonlinear_part import known_part
from edtk.fit.measurements import Measurements
from edtk.measure.pose_table import DEFLECTION_COLUMNS
from edtk.study.study import Study
from edtk.system.typing import Array, Indices, Mask

LENGTHS = ("metres", "centimetres", "inches", "micrometres")
FORCES = ("kilonewtons", "kilograms", "pounds")
FEWEST_IN_PART = 2  # rows: one alone is an outlier
TOLD_APART = 10  # rounds of telling the rows and the compliances, in turn
SAME_UNIT = 1.2  # factor up to which a ratio of two loads is that of a unit
# Factor up to which displacements of a part are, beside what springs move there, those of the rest:
# a unit that makes numbers small makes any of them fit.
LIKE_THE_REST = 5.0
TINY = 1e-300  # in place of nothing, which nothing is divided by


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a sheet, read in another unit.

    Attributes:
        what: "displacements", "forces" or "angles".
        unit: The unit that it is read in, in the plural.
        column: The column of all rows; empty where it is of some rows.
        rows: Which rows (m,) it is of.
        data: All measurements, read so.
        density: Twice the logarithm of the density of the numbers read so, over that of the
            written ones: f for each that is the written one times f.
    """

    what: str
    unit: str
    column: str
    rows: Mask
    data: Measurements
    density: float = 0.0

    def numbers(self, kept: Indices) -> tuple[int, ...]:
        """Rows of the file, of which a sheet with very many has kept some (m,)."""
        if self.column:
            return ()
        own = np.flatnonzero(self.rows)
        if np.ptp(own) == len(own) - 1:  # one after the other
            return tuple(range(int(kept[own[0]]), int(kept[own[-1]]) + 1))
        return tuple(kept[own].tolist())


def parts_in_other_units(study: Study, data: Measurements) -> Iterator[Part]:
    """Read a part of the displacements, loads or angles in each other unit that may be meant."""
    yield from _displacements(study, data)
    yield from _forces(data)
    yield from _angles(study, data)


def _displacements(study: Study, data: Measurements) -> Iterator[Part]:
    """Some rows, or one coordinate of all rows."""
    left = _Scaled.of(study, data)
    for unit in LENGTHS:
        factor = UNITS[unit][0]
        rows = left.rows(factor)
        each = [("", rows)] if rows is not None else []
        if data.deflection.shape[1] > 1:
            each += [(name, np.ones(len(data), dtype=bool)) for name in DEFLECTION_COLUMNS]
        for name, own in each:
            scaled = own[:, None] & data.lengths
            if name:
                scaled = scaled & (np.arange(scaled.shape[1]) == DEFLECTION_COLUMNS.index(name))
            if left.is_like_the_rest(factor, scaled):
                moved = np.where(scaled, factor, 1.0) * data.deflection
                read = replace(data, deflection=moved)
                density = 2 * float(np.log(factor)) * int(scaled.sum())
                yield Part("displacements", unit, name, own, read, density)


@dataclass(frozen=True, eq=False)
class _Scaled:
    """Displacements of which some are to be multiplied by a factor.

    With orthonormal columns Q of the regressors, in units of the noise, displacements y of which
    those of a part P are f times as large leave ``|y_f|^2 - |Q'y_f|^2``. Running sums over rows in
    any order tell that of all parts that begin with it. As the written number is the true one over
    f, its density has the factor f for each coordinate, of which -2 log counts.

    Attributes:
        Q: Columns (m, rows, p).
        y: Displacements (m, rows).
        lengths: Which of these (m, rows) are lengths.
        levers: How much each (m, rows) moves by usual compliances.
    """

    Q: Array
    y: Array
    lengths: Mask
    levers: Array

    @classmethod
    def of(cls, study: Study, data: Measurements) -> "_Scaled":
        """Of measurements that tell all compliances."""
        sigma = data.own_sigma
        A = data.regressor(study.model) / sigma[..., None]
        flat = A.reshape(-1, A.shape[-1])
        unit = flat / np.maximum(np.linalg.norm(flat, axis=0), TINY)
        Q = np.linalg.qr(unit)[0].reshape(A.shape)
        levers = np.linalg.norm(unit.reshape(A.shape), axis=-1)
        y = (data.deflection - known_part(study, data)) / sigma
        return cls(Q, y, data.lengths, levers)

    def rows(self, factor: float) -> Mask | None:
        """The rows (m,) that fit best so: from one on, up to one, or any; None of too few rows."""
        m = len(self.y)
        if m < 2 * FEWEST_IN_PART:
            return None
        each = np.arange(m)
        own, levers = (
            np.linalg.norm(np.where(self.lengths, x, 0.0), axis=1) for x in (self.y, self.levers)
        )
        sizes = own / np.maximum(levers, TINY)
        by_size = np.argsort(sizes if factor > 1 else -sizes, kind="stable")
        found = [self._first(order, factor) for order in (each, each[::-1], by_size)]
        found.append(self._settled(found[-1], factor))
        sound = [one for one in found if FEWEST_IN_PART <= one.sum() <= m - FEWEST_IN_PART]
        return min(sound, key=partial(self._cost, factor), default=None)

    def _first(self, order: Indices, factor: float) -> Mask:
        """The first rows of an order, as many as fit best."""
        own = np.where(self.lengths, self.y, 0.0)
        of_each = np.einsum("mrp,mr->mp", self.Q, own)[order]
        gradient = np.einsum("mrp,mr->p", self.Q, self.y) + (factor - 1) * of_each.cumsum(axis=0)
        squares = (self.y**2).sum() + (factor**2 - 1) * (own**2).sum(axis=1)[order].cumsum()
        count = self.lengths.sum(axis=1)[order].cumsum()
        cost = squares - (gradient**2).sum(axis=1) - 2 * np.log(factor) * count
        last = slice(FEWEST_IN_PART - 1, len(order) - FEWEST_IN_PART)
        found = np.zeros(len(order), dtype=bool)
        found[order[: FEWEST_IN_PART + int(cost[last].argmin())]] = True
        return found

    def _settled(self, rows: Mask, factor: float) -> Mask:
        """The rows that each fit better so, told in turn with the compliances."""
        count = self.lengths.sum(axis=1)
        for _ in range(TOLD_APART):
            predicted = self.y_of(rows[:, None] & self.lengths, factor)[1]
            every = np.where(self.lengths, factor, 1.0) * self.y
            so = ((every - predicted) ** 2).sum(axis=1) - 2 * np.log(factor) * count
            after = so < ((self.y - predicted) ** 2).sum(axis=1)
            if (after == rows).all():
                break
            rows = after
        return rows

    def y_of(self, scaled: Mask, factor: float) -> tuple[Array, Array]:
        """Displacements (m, rows) of which some are scaled, and what the springs make of them."""
        y = np.where(scaled, factor, 1.0) * self.y
        return y, self.Q @ np.einsum("mrp,mr->p", self.Q, y)

    def _cost(self, factor: float, rows: Mask) -> float:
        """Twice the negative logarithm of the likelihood."""
        scaled = rows[:, None] & self.lengths
        y, predicted = self.y_of(scaled, factor)
        return float(((y - predicted) ** 2).sum() - 2 * np.log(factor) * scaled.sum())

    def is_like_the_rest(self, factor: float, scaled: Mask) -> bool:
        """Whether what is scaled (m, rows) is as large as the rest, beside what springs move."""
        sizes = [
            float(np.linalg.norm(self.y[part]))
            / max(float(np.linalg.norm(self.levers[part])), TINY)
            for part in (scaled, self.lengths & ~scaled)
        ]
        return 1 / LIKE_THE_REST < factor * sizes[0] / max(sizes[1], TINY) < LIKE_THE_REST


def _forces(data: Measurements) -> Iterator[Part]:
    """Rows whose loads are as much smaller than the others as a unit is."""
    size = np.linalg.norm(data.wrench[:, :3], axis=1)
    loaded = size[size > 0]
    if not len(loaded):
        return
    ratio = float(loaded.max() / loaded.min())
    middle = float(np.sqrt(loaded.max() * loaded.min()))
    for unit in FORCES:
        factor = float(UNITS[unit][0])
        if not 1 / SAME_UNIT < ratio / factor < SAME_UNIT:
            continue
        rows = (size > 0) & (size < middle)
        wrench = np.where(rows, factor, 1.0)[:, None] * data.wrench
        yield Part("forces", unit, "", rows, replace(data, wrench=wrench))


def _angles(study: Study, data: Measurements) -> Iterator[Part]:
    """Rows whose angles are all within 2 pi degrees of zero, where others are not."""
    turns = np.array([joint.kind == "revolute" for joint in study.robot.joints])
    free = turns & ~np.isin(np.arange(len(turns)), list(study.fixed))
    shown = study.robot.shown(data.q)
    rows = np.abs(np.rad2deg(shown[:, free])).max(axis=1, initial=0.0) <= 2 * np.pi
    if rows.any() and not rows.all():
        read = np.where(rows[:, None] & free, np.rad2deg(shown), shown)
        yield Part("angles", "radians", "", rows, replace(data, q=study.robot.of_shown(read)))
