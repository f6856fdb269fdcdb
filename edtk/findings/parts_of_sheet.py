"""Parts of a sheet that are in another unit than the rest, or of another pose or load."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from criteria.linalg.inverse import TINY, eigenpairs
from edtk.findings.causes.faults import UNITS
from edtk.findings.nonlinear_part import known_part
from edtk.fit.measurements import Measurements
from edtk.measure.pose_table import DEFLECTION_COLUMNS
from edtk.study.study import Study
from edtk.system.typing import Array, Indices, Mask

LENGTHS = ("metres", "centimetres", "inches", "micrometres")
FORCES = ("kilonewtons", "kilograms", "pounds")


@dataclass(frozen=True)
class PartsOfSheet:
    """How rows are told that are in another unit than the others."""

    fewest: int = 2  # rows: one alone is an outlier
    rounds: int = 10  # rounds of telling the rows and the compliances, in turn
    same_unit: float = 1.2  # factor up to which a ratio of two loads is that of a unit
    # Factor up to which displacements of a part are, beside what springs move there, those of the
    # rest: a unit that makes numbers small makes any of them fit.
    like_the_rest: float = 5.0
    # Loads of one day that differ by more are in another unit.
    most_load: float = 3.0
    loads: int = 25  # up to this, over the written ones, of which the best one is refined
    singular: float = 1e-12  # of the largest eigenvalue: below it springs are not told


PARTS = PartsOfSheet()


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
        if m < 2 * PARTS.fewest:
            return None
        each = np.arange(m)
        own, levers = (
            np.linalg.norm(np.where(self.lengths, x, 0.0), axis=1) for x in (self.y, self.levers)
        )
        sizes = own / np.maximum(levers, TINY)
        by_size = np.argsort(sizes if factor > 1 else -sizes, kind="stable")
        found = [self._first(order, factor) for order in (each, each[::-1], by_size)]
        found.append(self._settled(found[-1], factor))
        sound = [one for one in found if PARTS.fewest <= one.sum() <= m - PARTS.fewest]
        return min(sound, key=partial(self._cost, factor), default=None)

    def _first(self, order: Indices, factor: float) -> Mask:
        """The first rows of an order, as many as fit best."""
        own = np.where(self.lengths, self.y, 0.0)
        of_each = np.einsum("mrp,mr->mp", self.Q, own)[order]
        gradient = np.einsum("mrp,mr->p", self.Q, self.y) + (factor - 1) * of_each.cumsum(axis=0)
        squares = (self.y**2).sum() + (factor**2 - 1) * (own**2).sum(axis=1)[order].cumsum()
        count = self.lengths.sum(axis=1)[order].cumsum()
        cost = squares - (gradient**2).sum(axis=1) - 2 * np.log(factor) * count
        last = slice(PARTS.fewest - 1, len(order) - PARTS.fewest)
        found = np.zeros(len(order), dtype=bool)
        found[order[: PARTS.fewest + int(cost[last].argmin())]] = True
        return found

    def _settled(self, rows: Mask, factor: float) -> Mask:
        """The rows that each fit better so, told in turn with the compliances."""
        count = self.lengths.sum(axis=1)
        for _ in range(PARTS.rounds):
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
        return (
            1 / PARTS.like_the_rest < factor * sizes[0] / max(sizes[1], TINY) < PARTS.like_the_rest
        )


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
        if not 1 / PARTS.same_unit < ratio / factor < PARTS.same_unit:
            continue
        rows = (size > 0) & (size < middle)
        wrench = np.where(rows, factor, 1.0)[:, None] * data.wrench
        yield Part("forces", unit, "", rows, replace(data, wrench=wrench))


def _angles(study: Study, data: Measurements) -> Iterator[Part]:
    """Rows whose angles are all within 2 pi degrees of zero, where others are not."""
    turns = ~study.robot.slides
    free = turns & ~np.isin(np.arange(len(turns)), list(study.fixed))
    shown = study.robot.shown(data.q)
    rows = np.abs(np.rad2deg(shown[:, free])).max(axis=1, initial=0.0) <= 2 * np.pi
    if rows.any() and not rows.all():
        read = np.where(rows[:, None] & free, np.rad2deg(shown), shown)
        yield Part("angles", "radians", "", rows, replace(data, q=study.robot.of_shown(read)))


@dataclass(frozen=True, eq=False)
class OtherRows:
    """Rows that are of another pose or load.

    Attributes:
        kind: A word for programs: "shifted_rows", "unloaded_rows" or "other_loads".
        rows: Which rows they are.
        data: All measurements, read so; without a row that is of no pose.
        anew: Which of these are the rows.
        factor: Their load over the written one; 1 where poses differ.
        step: From the row of a reading to that of its pose: -1, 1, or 0 where loads differ.
    """

    kind: str
    rows: Indices
    data: Measurements
    anew: Mask
    factor: float = 1.0
    step: int = 0


def rows_of_others(study: Study, data: Measurements, adjacent: bool) -> Iterator[OtherRows]:
    """Read some rows of displacements with another pose or load.

    Args:
        study: The model.
        data: The measurements as they are written.
        adjacent: Whether rows follow each other as in the file.
    """
    if len(data) < 2 * PARTS.fewest:
        return
    own = _Sums.of(study, data)
    without = _Sums.of(study, replace(data, wrench=np.zeros_like(data.wrench)), own.norms)
    yield from _unloaded(data, own, without)
    yield _under_other_loads(data, own, without)
    if adjacent and data.sensor is None:
        for step in (-1, 1):
            yield _shifted(study, data, own, step)


def _unloaded(data: Measurements, own: "_Sums", without: "_Sums") -> Iterator[OtherRows]:
    """Rows that were read without their load: some that hardly move, or all from one on."""
    each = np.arange(len(data))
    orders = [each[::-1], each]
    if not data.absolute:  # which move by the weight of the links, too
        orders.append(np.argsort((own.y**2).sum(axis=1), kind="stable"))
    found = [(*own.best_start(without, order), order) for order in orders]
    _, count, order = min(found, key=lambda one: one[0])
    yield _under(data, order[:count], 0.0)


def _under_other_loads(data: Measurements, own: "_Sums", without: "_Sums") -> OtherRows:
    """All rows up to one, or from one on, that were read under so many times their load."""
    from scipy.optimize import minimize_scalar

    # A smaller load in one part is a larger one in the other: either order has both.
    order = np.arange(len(data))[::-1]
    most = np.log(PARTS.most_load)

    def left(log_factor: float) -> float:
        return own.best_start(own.under(without, float(np.exp(log_factor))), order)[0]

    tried = np.linspace(-most, most, PARTS.loads)
    best = int(np.argmin([left(one) for one in tried]))
    near = (tried[max(best - 1, 0)], tried[min(best + 1, PARTS.loads - 1)])
    factor = float(np.exp(minimize_scalar(left, bounds=near, options={"xatol": 1e-6}).x))
    count = own.best_start(own.under(without, factor), order)[1]
    if 2 * count > len(data):  # the smaller part is named
        return _under(data, order[count:], 1 / factor)
    return _under(data, order[:count], factor)


def _under(data: Measurements, rows: Indices, factor: float) -> OtherRows:
    """Some rows under so many times their load."""
    wrench = data.wrench.copy()
    wrench[rows] *= factor
    kind = "other_loads" if factor else "unloaded_rows"
    anew = np.isin(np.arange(len(data)), rows)
    return OtherRows(kind, np.flatnonzero(anew), replace(data, wrench=wrench), anew, factor)


def _shifted(study: Study, data: Measurements, own: "_Sums", step: int) -> OtherRows:
    """All rows from one on, whose poses are those of the rows before (-1) or after (1).

    At one end of them is a row whose pose has no reading, or whose reading has no pose.
    """
    m = len(data)
    pose = np.clip(np.arange(m) + step, 0, m - 1)
    other = replace(data, q=data.q[pose], wrench=data.wrench[pose])
    if data.absolute:
        moved = data.rigid(study.model) - other.rigid(study.model)
        whole = data.deflection.copy()
        whole[:, : moved.shape[1]] += moved
        other = replace(other, deflection=whole)
    read = _Sums.of(study, other, own.norms)
    if step > 0:
        own, read = own.without(m - 1), read.without(m - 1)
    count = own.best_start(read, np.arange(m)[::-1], but_last=step < 0)[1]
    rows = np.arange(m - count, m)
    none = rows[0] if step < 0 else rows[-1]
    late = np.arange(m) >= rows[0]
    told = replace(
        data,
        q=np.where(late[:, None], other.q, data.q),
        wrench=np.where(late[:, None], other.wrench, data.wrench),
        deflection=np.where(late[:, None], other.deflection, data.deflection),
    )
    kept = np.delete(np.arange(m), none)
    return OtherRows("shifted_rows", np.setdiff1d(rows, none), told[kept], late[kept], step=step)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Rows in units of the noise, and what least squares need of each.

    Attributes:
        A: Regressors (m, rows, p), in units of their norms.
        y: Displacements (m, rows).
        norms: Norms (p,) of the columns of the sheet as it is written.
    """

    A: Array
    y: Array
    norms: Array

    @classmethod
    def of(cls, study: Study, data: Measurements, norms: Array | None = None) -> "_Sums":
        """Of measurements, read in one way."""
        sigma = data.own_sigma
        A = data.regressor(study.model) / sigma[..., None]
        if norms is None:
            norms = np.maximum(np.linalg.norm(A, axis=(0, 1)), TINY)
        return cls(A / norms, (data.deflection - known_part(study, data)) / sigma, norms)

    def under(self, without: "_Sums", factor: float) -> "_Sums":
        """With loads that are as many times as large; what links weigh stays (`without`)."""
        A = without.A + factor * (self.A - without.A)
        return replace(self, A=A, y=without.y + factor * (self.y - without.y))

    def without(self, row: int) -> "_Sums":
        """Without what one row says."""
        kept = (np.arange(len(self.y)) != row)[:, None]
        return replace(self, A=self.A * kept[..., None], y=self.y * kept)

    def best_start(
        self, other: "_Sums", order: Indices, but_last: bool = False
    ) -> tuple[float, int]:
        """Read the first rows of an order in another way: what is left at best, and how many.

        With ``G`` the sum of ``A'A``, ``b`` that of ``A'y`` and ``s`` that of ``|y|^2``, least
        squares leave ``s - b'G^-1 b``. Running sums tell that of all choices.

        Args:
            other: The rows, read in the other way.
            order: The rows, those first that are likeliest read so.
            but_last: Whether the last of those that are read so does not count.
        """
        changed = order[: len(order) - PARTS.fewest]
        G, b, s = (
            (mine.sum(axis=0) + np.cumsum((its - mine)[changed], axis=0) - but_last * its[changed])[
                PARTS.fewest - 1 :
            ]
            for mine, its in zip(self._of_rows, other._of_rows, strict=True)
        )
        values, vectors = eigenpairs(G)
        along = np.einsum("mpk,mp->mk", vectors, b)
        told = values > PARTS.singular * values[:, -1:]
        left = s - np.where(told, along**2 / np.where(told, values, 1.0), 0.0).sum(axis=1)
        first = int(left.argmin())
        return float(left[first]), PARTS.fewest + first

    @property
    def _of_rows(self) -> tuple[Array, Array, Array]:
        """``A'A`` (m, p, p), ``A'y`` (m, p) and ``|y|^2`` (m,) of each row."""
        return (
            np.einsum("mri,mrj->mij", self.A, self.A),
            np.einsum("mri,mr->mi", self.A, self.y),
            (self.y**2).sum(axis=1),
        )
