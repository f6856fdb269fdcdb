"""Other ways of reading the columns of a measurement file, and how well they fit."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, permutations, product

import numpy as np

from edtk.findings.causes.faults import cause_of_rows, cause_wording
from edtk.findings.causes.scene import AXES
from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.findings.match_plan import some_rows
from edtk.findings.nonlinear_part import known_part, nonlinear_part
from edtk.findings.parts_of_sheet import parts_in_other_units, rows_of_others
from edtk.fit.correlated_noise import row_numbers
from edtk.fit.distributions import chi_square_tail
from edtk.fit.identify import Identification
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.outliers import find_outliers
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    MARKER_COLUMNS,
    ROTATION_COLUMNS,
    WRENCH_COLUMNS,
    pose_columns,
)
from edtk.study.study import Study
from edtk.system.typing import Array, Indices, Mask

OFFSETS_DEG = (90, -90, 180)  # by which zeros of joints differ between conventions


@dataclass(frozen=True)
class OtherReadings:
    """When another reading of the columns explains a sheet."""

    most_exchanged: int = 6  # of which each two may be exchanged
    most_outliers: float = 0.1  # share of the rows that may be outliers of a reading
    rounds: int = 10  # of finding outliers, which can hide each other
    outlier: float = 25.0  # chi-square of a row from which it is one, of a thousand rows
    suspect: float = 3.0  # residuals over sigma beyond which other readings are tried
    better: float = 3.0  # factor by which another reading must reduce the residuals
    # Probability of its residuals below which a reading does not explain them.
    least_p: float = 1e-3
    # Ratio of likelihoods up to which the best reading is not better than another.
    as_likely: float = 1e3
    # Degrees of freedom from which residuals tell a good reading from a bad one.
    least_freedom: int = 3
    by_far: float = -3.0  # standard deviations below zero that no compliance can have
    most_corrected: int = 12  # readings, the best ones, whose equilibrium is computed
    named: int = 150  # characters of the readings that are named; of more, the number is said
    enough_rows: int = 1000  # rows on which readings are compared


OTHER = OtherReadings()


@dataclass(frozen=True, eq=False)
class Reading:
    """One way of reading the columns.

    Attributes:
        finding: The error of the columns that it assumes.
        data: The measurements, read so.
        density: Twice the logarithm of the density of the numbers read so, over that of the
            written ones; not zero where they are multiplied.
        anew: Which rows are read anew; None for all, or where it does not matter.
    """

    finding: Finding
    data: Measurements
    density: float = 0.0
    anew: Mask | None = None


def readings(study: Study, data: Measurements, only_signs: bool = False) -> Iterator[Reading]:
    """Read the columns in other ways, the likeliest first.

    Args:
        study: Says which joints the file must have.
        data: The measurements as the columns are headed.
        only_signs: Whether only signs and axes of the displacements are read in other ways.
    """
    yield Reading(
        Finding.of(Severity.ALARM, WORDING, "wrong_sign"),
        replace(data, deflection=-data.deflection),
    )
    directed = data.deflection.shape[1] > 1  # distances have no axes to exchange
    if not only_signs:
        if directed:
            yield from _displacements(data)
        yield from _joint_signs(study, data)
        yield from _joints(study, data)
        yield from _wrenches(data)
        yield from _wrench_signs(data)
        yield from _rotations(data)
        yield from _markers(data)
        yield from _swapped_markers(study, data)
    if directed:
        yield from _other_axes(data)
    if not only_signs:
        yield from _joint_offsets(study, data)


def _displacements(data: Measurements) -> Iterator[Reading]:
    """Two displacements are exchanged, or the positions that they come from."""
    for i, j in combinations(range(3), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield Reading(_swapped(DEFLECTION_COLUMNS, i, j, positions=AXES[i] + AXES[j]), other)


def _joint_signs(study: Study, data: Measurements) -> Iterator[Reading]:
    """One or two joints are counted the other way round."""
    columns = pose_columns(study.robot)
    robot = study.robot
    free = [j for j in _free(study) if robot.shown(data.q)[:, j].any()]
    for turned in chain(combinations(free, 1), combinations(free, 2)):
        shown = robot.shown(data.q).copy()
        shown[:, turned] *= -1
        q = robot.of_shown(shown)
        finding = Finding.of(
            Severity.ALARM, WORDING, "opposite_sign", columns=tuple(columns[j] for j in turned)
        )
        yield Reading(finding, replace(data, q=q))


def _joints(study: Study, data: Measurements) -> Iterator[Reading]:
    """Two joints of one kind are exchanged."""
    kinds = [joint.kind for joint in study.robot.joints]
    for i, j in combinations(_free(study), 2):
        if kinds[i] == kinds[j]:
            shown = _exchanged(study.robot.shown(data.q), i, j)
            other = replace(data, q=study.robot.of_shown(shown))
            yield Reading(_swapped(pose_columns(study.robot), i, j), other)


def _joint_offsets(study: Study, data: Measurements) -> Iterator[Reading]:
    """One joint is counted from another zero."""
    columns = pose_columns(study.robot)
    revolute = [j for j in _free(study) if study.robot.joints[j].kind == "revolute"]
    for j, degrees in product(revolute, OFFSETS_DEG):
        shown = study.robot.shown(data.q).copy()
        shown[:, j] += np.deg2rad(degrees)
        q = study.robot.of_shown(shown)
        offset = {"degrees": degrees}
        finding = Finding.of(
            Severity.ALARM, WORDING, "joint_offset", columns=(columns[j],), **offset
        )
        yield Reading(finding, replace(data, q=q))


def _wrenches(data: Measurements) -> Iterator[Reading]:
    """Two forces or two torques are exchanged."""
    for i, j in [*combinations(range(3), 2), *combinations(range(3, 6), 2)]:
        if data.wrench[:, [i, j]].any():
            other = replace(data, wrench=_exchanged(data.wrench, i, j))
            yield Reading(_swapped(WRENCH_COLUMNS, i, j), other)


def _wrench_signs(data: Measurements) -> Iterator[Reading]:
    """A force or torque beside others has the opposite sign."""
    acting = np.flatnonzero(data.wrench[:, :6].any(axis=0))
    for i in acting if len(acting) > 1 else ():
        wrench = data.wrench.copy()
        wrench[:, i] *= -1
        finding = Finding.of(Severity.ALARM, WORDING, "opposite_sign", columns=(WRENCH_COLUMNS[i],))
        yield Reading(finding, replace(data, wrench=wrench))


def _rotations(data: Measurements) -> Iterator[Reading]:
    """Two rotations are exchanged, or all of them have the opposite sign."""
    if data.deflection.shape[1] == 6:
        turned = data.deflection * np.repeat([1, -1], 3)
        finding = Finding.of(Severity.ALARM, WORDING, "opposite_sign", columns=ROTATION_COLUMNS)
        yield Reading(finding, replace(data, deflection=turned))
    for i, j in combinations(range(3, data.deflection.shape[1]), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield Reading(_swapped(ROTATION_COLUMNS, i - 3, j - 3), other)


def _markers(data: Measurements) -> Iterator[Reading]:
    """Two offsets of the marker are exchanged, or all of them are in metres."""
    if not data.marker.any():
        return
    for i, j in combinations(range(3), 2):
        other = replace(data, marker=_exchanged(data.marker, i, j))
        yield Reading(_swapped(MARKER_COLUMNS, i, j), other)
    in_metres = replace(data, marker=1e3 * data.marker)
    yield Reading(
        Finding.of(Severity.ALARM, WORDING, "marker_unit", columns=MARKER_COLUMNS), in_metres
    )


def _swapped_markers(study: Study, data: Measurements) -> Iterator[Reading]:
    """Two markers, or other instruments of one kind, are exchanged in all rows."""
    index = np.zeros(len(data), dtype=int) if data.sensor is None else data.sensor
    which = row_numbers(index[:, None], data.marker)
    first = np.unique(which, return_index=True)[1]
    if not 1 < len(first) <= OTHER.most_exchanged:
        return
    model = study.model
    for i, j in combinations(range(len(first)), 2):
        a, b = first[[i, j]]
        if type(model.instruments[index[a]]) is not type(model.instruments[index[b]]):
            continue
        row = np.arange(len(data))
        row = np.where(which == i, b, np.where(which == j, a, row))
        sensor = None if data.sensor is None else index[row]
        other = replace(data, sensor=sensor, marker=data.marker[row])
        if data.absolute:
            moved = data.rigid(model) - other.rigid(model)
            whole = data.deflection.copy()
            whole[:, : moved.shape[1]] += moved
            other = replace(other, deflection=whole)
        names = tuple(_marker_name(study, data, index, one) for one in (a, b))
        yield Reading(Finding.of(Severity.ALARM, WORDING, "swapped_markers", columns=names), other)


def _marker_name(study: Study, data: Measurements, index: Indices, row: int) -> str:
    """The marker of a row, by its name or its place on the tool."""
    name = study.model.instruments[index[row]].name
    place = ", ".join(f"{1e3 * x:g}" for x in data.marker[row])
    return name or f"({place}) mm"


def _other_axes(data: Measurements) -> Iterator[Reading]:
    """Displacements and rotations are those of a frame with the axes permuted or reversed.

    First come the 23 frames that are turned, then the mirrored ones, as of a left-handed tracker.
    """
    moved = data.deflection
    rotations = moved.shape[1] == 6
    for T in _frames():
        handed = round(float(np.linalg.det(T)))
        # Without rotations these are readings from above: the wrong sign, and exchanged columns.
        if not rotations and handed < 0 and (np.trace(T) == -3 or (T >= 0).all()):
            continue
        parts = [moved[:, :3] @ T.T]
        if rotations:
            # Rotation vectors are axial: a left-handed frame reverses them.
            parts.append(handed * moved[:, 3:] @ T.T)
        expected = tuple(
            f"{'-' * bool(row.sum() < 0)}{DEFLECTION_COLUMNS[int(np.abs(row).argmax())]}"
            for row in T
        )
        named = {"expected": expected, "turn": _turn(T)}
        finding = Finding.of(
            Severity.ALARM, WORDING, "other_axes", columns=DEFLECTION_COLUMNS, **named
        )
        yield Reading(finding, replace(data, deflection=np.hstack(parts)))


def _frames() -> list[Array]:
    """Permutations of the axes with signs (3, 3), the rotations first, without the identity."""
    frames = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order, signs in product(permutations(range(3)), product((1, -1), repeat=3))
    ]
    return sorted(frames[1:], key=lambda T: -np.linalg.det(T))


def _turn(T: Array) -> str:
    """A rotation or reflection (3, 3) of the axes, in words."""
    if np.linalg.det(T) < 0:
        return "left-handed"
    angle = round(float(np.rad2deg(np.arccos(np.clip((np.trace(T) - 1) / 2, -1.0, 1.0)))))
    # Of a rotation by 180 degrees about a, T + I is 2 a a'; of others T + T' + ... is along a too.
    fixed = T + T.T + (1 - np.trace(T)) * np.eye(3)
    row = fixed[int(np.abs(np.diag(fixed)).argmax())]
    along = [f"{'-' * bool(a < 0)}{axis}" for a, axis in zip(row, AXES, strict=True) if a]
    about = along[0] if len(along) == 1 else "a diagonal"
    return f"turned by {angle} degrees about {about}"


def _parts(study: Study, data: Measurements, kept: Indices) -> Iterator[Reading]:
    """Some rows, or one column, are in another unit.

    Args:
        study: The model.
        data: The measurements as the columns are headed.
        kept: Their rows of the file (m,).
    """
    for part in parts_in_other_units(study, data):
        named = {"what": part.what, "unit": part.unit, "rows": part.numbers(kept)}
        columns = (part.column,) if part.column else ()
        finding = Finding.of(Severity.ALARM, WORDING, "part_unit", columns=columns, **named)
        yield Reading(finding, part.data, part.density)


def _rows(study: Study, data: Measurements, kept: Indices) -> Iterator[Reading]:
    """Some rows are of another pose or load; arguments as of `_parts`."""
    adjacent = bool(np.ptp(kept) == len(kept) - 1)
    for other in rows_of_others(study, data, adjacent):
        rows = tuple(kept[other.rows].tolist())
        told = {"factor": other.factor, "step": other.step}
        finding = Finding.of(Severity.ALARM, WORDING, other.kind, rows=rows, **told)
        # A row that does not count has any reading, as an outlier has.
        yield Reading(
            finding, other.data, -OTHER.outlier * (len(data) - len(other.data)), other.anew
        )


def _free(study: Study) -> list[int]:
    """The joints that the file must have."""
    return [j for j in range(study.robot.n) if j not in study.fixed]


def _swapped(columns: Sequence[str], i: int, j: int, positions: str = "") -> Finding:
    """Two columns that were exchanged, or the positions along two axes."""
    pair = (columns[i], columns[j])
    return Finding.of(Severity.ALARM, WORDING, "swapped_columns", columns=pair, positions=positions)


def _exchanged(x: Array, i: int, j: int) -> Array:
    """The same with two columns exchanged."""
    other = x.copy()
    other[:, [i, j]] = x[:, [j, i]]
    return other


@dataclass(frozen=True, eq=False)
class Refit:
    """How well a reading fits, with compliances that are not negative.

    Attributes:
        reading: The columns as they are read.
        k: Compliances (p,), not negative [rad/(N m)].
        chi2: Sum of the squared residuals in units of sigma; inf where compliances are open.
        dof: Degrees of freedom: coordinates less compliances.
        left_out: Number of rows that were left out as outliers.
    """

    reading: Reading
    k: Array
    chi2: float
    dof: int
    left_out: int = 0

    @classmethod
    def of(cls, study: Study, reading: Reading, less: Array | float = 0.0) -> "Refit":
        """Fit the linear model by least squares.

        Args:
            study: The model.
            reading: The measurements.
            less: Part of the displacements (m, rows) that the linear model does not know [m, rad].
        """
        from scipy.optimize import nnls

        data = reading.data
        A = data.regressor(study.model)
        dof = data.deflection.size - A.shape[-1]
        try:
            whitened = Whitened.of(A, data.noise, study.model.parameters)
        except SingularPlanError:
            return cls(reading, np.zeros(A.shape[-1]), np.inf, dof)
        linear = data.deflection - known_part(study, data) - less
        k = nnls(whitened.R, whitened.project(linear))[0] / whitened.scale
        z = whitened.in_sigma(linear - A @ k)
        return cls(reading, k, float((z**2).sum()), dof)

    def corrected(self, study: Study) -> "Refit":
        """The fit without what the load's equilibrium adds to the linear model, if that is better.

        It is a step of the nonlinear fit: the difference between equilibrium and linear model is
        that of these compliances.
        """
        if not np.isfinite(self.chi2):
            return self
        try:
            less = nonlinear_part(study, self.reading.data, self.k)
        except NoEquilibriumError:
            return self
        again = Refit.of(study, self.reading, less)
        return again if again.chi2 < self.chi2 else self

    def without_outliers(self, study: Study) -> "Refit":
        """The fit without the rows that do not belong to the others.

        The same if they are many, or most of those that are read anew: nothing would tell how.
        """
        data, anew = self.reading.data, self.reading.anew
        refit, kept = self, np.arange(len(data))
        for _ in range(OTHER.rounds):
            left = refit.reading.data
            outliers = refit._outliers(study)
            if not len(outliers):
                break
            rest = np.delete(np.arange(len(left)), outliers)
            if len(rest) < (1 - OTHER.most_outliers) * len(data):
                return self
            kept = kept[rest]
            refit = Refit.of(study, replace(self.reading, data=left[rest])).corrected(study)
        if anew is not None and 2 * anew[kept].sum() <= anew.sum():
            return self
        return replace(refit, left_out=len(data) - len(refit.reading.data))

    def _outliers(self, study: Study) -> Indices:
        """Rows that do not belong to the others."""
        data = self.reading.data
        A = data.regressor(study.model)
        whitened = Whitened.of(A, data.noise, study.model.parameters)
        residual = data.deflection - known_part(study, data) - A @ self.k
        z = whitened.in_sigma(residual)
        total = float((z**2).sum())
        return find_outliers(*whitened.deletable(z), self.dof, total=total)

    @property
    def cost(self) -> float:
        """Minus twice the log likelihood, with so much for each outlier as it must have at least.

        The costs of two readings differ by the logarithm of their likelihood ratio, twice.
        """
        return self.chi2 + OTHER.outlier * self.left_out - self.reading.density

    @property
    def size(self) -> float:
        """Residuals in units of sigma, root mean square."""
        return float(np.sqrt(self.chi2 / max(self.dof, 1)))

    @property
    def p(self) -> float:
        """Probability of so large residuals by noise alone."""
        return float(chi_square_tail(self.chi2, self.dof)) if self.dof else 1.0


@dataclass(frozen=True, eq=False)
class Explanation:
    """Measurements that do not fit as they are read, and the readings that do.

    Attributes:
        given: The fit of the columns as they are headed.
        refits: The readings that fit much better and about equally well, the likeliest first;
            empty where no reading does.
    """

    given: Refit
    refits: tuple[Refit, ...]

    @property
    def certain(self) -> bool:
        """Whether the noise explains what a reading leaves."""
        return any(refit.p > OTHER.least_p for refit in self.refits)

    @property
    def finding(self) -> Finding | None:
        """The reading as a finding, or several of them; None where no reading fits."""
        if not self.refits:
            return None
        first = self.refits[0].reading.finding
        numbers = {
            "before": self.given.size,
            "after": self.refits[0].size,
            "explained": 1 - self.refits[0].chi2 / self.given.chi2,
            "left_out": self.refits[0].left_out,
        }
        if len(self.refits) == 1:
            return Finding.of(Severity.ALARM, WORDING, first.kind, **first.data, **numbers)
        several = tuple(refit.reading.finding for refit in self.refits)
        return Finding.of(Severity.ALARM, WORDING, "several_readings", readings=several, **numbers)


def explanation(study: Study, data: Measurements, fit: Identification) -> Explanation | None:
    """Read measurements that do not fit in other ways.

    Args:
        study: The model.
        data: The measurements as the columns are headed.
        fit: Their fit.

    Returns:
        The readings that explain them; None where they fit as they are, or where there are too few
        to tell a reading that fits from one that does not.
    """
    only_signs = fit.dof < OTHER.least_freedom
    if only_signs and not (fit.unbounded < OTHER.by_far * fit.std).all():
        return None
    kept = some_rows(len(data), OTHER.enough_rows)
    if len(kept) < len(data):
        data = data[kept]
    given = Refit.of(study, Reading(Finding.of(Severity.ALARM, WORDING, "as_given"), data))
    if not OTHER.suspect < given.size < np.inf:
        return None
    given = given.corrected(study)
    if not given.size > OTHER.suspect:
        return None
    every = readings(study, data, only_signs)
    if not only_signs:
        every = chain(every, _parts(study, data, kept), _rows(study, data, kept))
    tried = [Refit.of(study, reading) for reading in every]
    return Explanation(given, _equally_good(study, tried, given.size / OTHER.better))


def _equally_good(study: Study, tried: list[Refit], most: float) -> tuple[Refit, ...]:
    """The readings whose residuals are at most so large, and about as small as the best one's."""
    better = [refit for refit in tried if refit.size <= most]
    if not better:
        return ()
    enough = sorted(refit.chi2 for refit in better)[: OTHER.most_corrected][-1]
    corrected = [refit.corrected(study) for refit in better if refit.chi2 <= enough]
    found = [
        refit if refit.p > OTHER.least_p else refit.without_outliers(study) for refit in corrected
    ]
    best = min(refit.cost for refit in found)
    equal = [refit for refit in found if refit.cost <= best + 2 * np.log(OTHER.as_likely)]
    equal = [refit for refit in equal if refit.size <= OTHER.suspect]
    return tuple(refit for refit in equal if not any(_is_simpler(other, refit) for other in equal))


def _is_simpler(other: Refit, refit: Refit) -> bool:
    """Whether another reading changes only some of the columns that a reading changes."""
    fewer = other.reading.finding
    more = refit.reading.finding
    return fewer.kind == more.kind and set(fewer.columns) < set(more.columns)


def _as_given(data: Data) -> str:
    """Columns that are not read otherwise."""
    return "the columns are as they are headed"


def _wrong_sign(data: Data) -> str:
    """Displacements of the wrong sign."""
    return "loaded and unloaded positions look swapped, or the load has the wrong sign"


def _swapped_columns(data: Data) -> str:
    """Two columns that were exchanged."""
    axes = data["positions"]
    or_else = f" (or the positions in {axes[0]} and {axes[1]})" if axes else ""
    return f"columns {' and '.join(data['columns'])}{or_else} look swapped"


def _opposite_sign(data: Data) -> str:
    """Joints, loads or rotations that were counted the other way round."""
    if len(data["columns"]) == 1:
        return f"column {data['columns'][0]} looks measured with the opposite sign"
    return f"columns {', '.join(data['columns'])} look measured with the opposite sign"


def _joint_offset(data: Data) -> str:
    """A joint that was counted from another zero."""
    degrees = data["degrees"]
    size = "small" if degrees > 0 else "large"
    return f"column {data['columns'][0]} looks {abs(degrees)} degrees too {size}"


def _marker_unit(data: Data) -> str:
    """Marker offsets in metres."""
    columns = ", ".join(data["columns"])
    return f"columns {columns} look as if they were in metres; expected millimetres"


def _part_unit(data: Data) -> str:
    """Rows, or a column, in another unit."""
    where = f"column {data['columns'][0]}" if data["columns"] else rows_in_words(data["rows"])
    meant = {"displacements": "millimetres", "forces": "newtons", "angles": "degrees"}
    return (
        f"{where}: the {data['what']} look as if they were in {data['unit']}; expected "
        f"{meant[data['what']]}, as in the rest of the sheet"
    )


def _other_rows(kind: str, expected: str) -> Callable[[Data], str]:
    """Rows that are of another pose or load, in the words of the cause that this is."""
    return lambda data: f"{cause_wording(cause_of_rows(kind, data))}; expected {expected}"


def _swapped_markers_words(data: Data) -> str:
    """Two markers that were exchanged in all rows."""
    return f"the markers {' and '.join(data['columns'])} look swapped in all rows"


def _other_axes_words(data: Data) -> str:
    """Displacements along other axes."""
    expected = ", ".join(data["expected"])
    return f"the measuring frame looks {data['turn']}: expected ({expected})"


def _several_readings(data: Data) -> str:
    """Readings that explain the measurements equally well."""
    clauses = [reading.words for reading in data["readings"]]
    short = [clause.replace(" measured with the opposite sign", " reversed") for clause in clauses]
    named = short[:1]
    for clause in short[1:]:
        if len("; or ".join([*named, clause])) <= OTHER.named:
            named.append(clause)
    left = len(short) - len(named)
    more = f"; or {left} other reading{'s' * (left > 1)}" if left else ""
    return "; or ".join(named) + more


def _with_share(clause: Callable[[Data], str]) -> Callable[[Data], str]:
    """The sentence of a reading: how much of the misfit it explains, where that is known."""

    def words(data: Data) -> str:
        if "explained" not in data:
            return clause(data)
        which = "each explains" if "readings" in data else "this explains"
        # Of many measurements a reading explains all but noise: 100 % would say too much.
        share = f"{min(100 * data['explained'], 99.99):.4g}"
        after = f"{data['after']:.3g}"
        before = f"{data['before']:.3g}"
        rows = data["left_out"]
        without = f", without {rows} outlier{'s' * (rows > 1)}" if rows else ""
        return (
            f"{clause(data)}; {which} {share} % of the misfit "
            f"(leaves {after} sigma instead of {before}{without})"
        )

    return words


_CLAUSES: Wording = {
    "as_given": _as_given,
    "wrong_sign": _wrong_sign,
    "swapped_columns": _swapped_columns,
    "opposite_sign": _opposite_sign,
    "joint_offset": _joint_offset,
    "marker_unit": _marker_unit,
    "part_unit": _part_unit,
    "unloaded_rows": _other_rows("unloaded_rows", "readings under the load that is written"),
    "other_loads": _other_rows("other_loads", "the loads that acted"),
    "shifted_rows": _other_rows("shifted_rows", "each beside its own pose"),
    "swapped_markers": _swapped_markers_words,
    "other_axes": _other_axes_words,
    "several_readings": _several_readings,
}
WORDING: Wording = {kind: _with_share(clause) for kind, clause in _CLAUSES.items()}
