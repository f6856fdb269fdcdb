"""The sheet on which a plan's measurements are written down, and the order of its visits."""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from edtk.calibration.timetable import day_of, has_day
from edtk.design.plan import Plan
from edtk.design.tours import visiting_order
from edtk.fit.sheet import form_of, read_by
from edtk.measure.cells import csv_text
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    TURN_COLUMN,
    UNLOADED_COLUMNS,
    VISIT_COLUMN,
    coordinate_names,
    rounded,
)
from edtk.study.plan_study import day_costs
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.files import BYTE_ORDER_MARKS, write_text
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

LONGEST_HEADER = 10_000  # characters; any file may be asked about, such as a chain without lines


def measured_names(model: ElastostaticModel) -> tuple[str, ...]:
    """Names (rows,) of what an experiment measures, such as "x", or "forearm x" and "wire".

    Args:
        model: The model, whose instruments are measured one after another.
    """
    instruments = model.instruments
    if len(instruments) == 1:
        return coordinate_names(instruments[0].rows)
    return tuple(
        sensor.name if sensor.rows == 1 else f"{sensor.name} {coordinate}"
        for sensor in instruments
        for coordinate in coordinate_names(sensor.rows)
    )


def require_empty(path: Path) -> None:
    """Check that an existing file is a sheet that has not been filled in.

    Raises:
        UserError: The file is no sheet, or has measurements in it; it is not to be overwritten.
    """
    if not path.exists() or not path.stat().st_size:
        return
    filled = is_filled(path)
    if filled is None:
        raise UserError("exists and is not an empty sheet; expected another file", where=path)
    if filled:
        message = "has measurements in it; expected another file for the empty sheet"
        raise UserError(message, where=path)


# A sheet has at least one of these; a plan has none.
OF_A_SHEET = {
    *DEFLECTION_COLUMNS,
    *LOADED_COLUMNS,
    *UNLOADED_COLUMNS,
    *ROTATION_COLUMNS,
    DISTANCE_COLUMN,
}
# The number of a visit is written beforehand, and markers where the study names them.
BEFOREHAND = {VISIT_COLUMN, MARKER_NAME_COLUMN, *MARKER_COLUMNS}


def is_filled(path: Path) -> bool | None:
    """Tell whether anything was written on a sheet, whatever separates its columns.

    Args:
        path: Any file.

    Returns:
        None for a file that is no sheet, as no device and no pipe is.
    """
    if not path.is_file():
        return None
    with path.open("rb") as raw:
        encoding = BYTE_ORDER_MARKS.get(raw.read(2), "utf-8-sig")
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        header = _header(file)
        separator = max(",;\t", key=header.count)
        columns = [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
        if not set(columns) & OF_A_SHEET:
            return None
        written = BEFOREHAND if MARKER_NAME_COLUMN in columns else {VISIT_COLUMN}
        to_fill_in = {*SHEET_COLUMNS, DISTANCE_COLUMN} - written
        places = [i for i, name in enumerate(columns) if name in to_fill_in]
        lines = (line for line in file if not line.startswith("#"))
        try:
            return _has_content(csv.reader(lines, delimiter=separator), places)
        except csv.Error:  # a cell of more than a hundred thousand characters: no empty sheet
            return True


def _header(file: TextIO) -> str:
    """The first line with content, as far as a header may reach: the file may have no lines."""
    while line := file.readline(LONGEST_HEADER):
        if line.strip() and not line.startswith("#"):
            return line
    return ""


def _has_content(rows: Iterable[list[str]], places: list[int]) -> bool:
    """Whether a cell in one of these places is not blank."""
    return any(row[i].strip() for row in rows for i in places if i < len(row))


def visit_order(study: Study, plan: Plan) -> Indices:
    """Indices of the plan's poses in the order in which they are visited, repeats included.

    All poses without a load come first, then those under each load. Where the study asks for more
    load changes, the visits of each load are shared out among so many rounds. Where it says how
    long things take, or what stands around the robot, the order is that of `day_of`.
    """
    if has_day(study):
        return day_of(study, plan).order
    lower, upper = study.robot.limits
    span = upper - lower
    loads = np.unique(plan.wrench, axis=0)
    loads = loads[np.argsort(loads.any(axis=1), kind="stable")]
    costs = day_costs(study)
    parts = len(loads)
    if costs is not None:
        # Where experiments are pairs, the day begins without a load.
        before = costs.paired and bool(loads.any(axis=1).all())
        parts = costs.changes_of(loads) + 1 - before
    rounds: list[list[Indices]] = []
    for i, load in enumerate(loads):
        own = np.flatnonzero((plan.wrench == load).all(axis=1))
        path = own[visiting_order(plan.q[own], span)]
        visits = np.repeat(path, plan.repeats[path])
        # Load i is on in every len(loads)-th of so many stretches of the day.
        stretches = len(range(i, parts, len(loads)))
        rounds.append(np.array_split(visits, stretches))
    taken = [rounds[i % len(loads)][i // len(loads)] for i in range(parts)]
    return np.concatenate(taken)


@dataclass(frozen=True)
class SheetColumns:
    """What an empty sheet has beside poses and loads, by the instruments of a study.

    Attributes:
        rows: Rows of each visit.
        written: Columns that are filled in beforehand, with a value for each of these rows.
        empty: Columns that are to be filled in.
        read: Which of the rows (v, rows) there are in visits of poses (v, n); None where all are.
        numbered: Whether a column numbers the visits.
    """

    rows: int
    written: Mapping[str, Sequence[Any]]
    empty: tuple[str, ...]
    read: Callable[[Array], Mask] | None
    numbered: bool

    @classmethod
    def of_displacements(
        cls, study: Study, positions: bool = False, markers: int = 0
    ) -> "SheetColumns":
        """Those of displacements under a load.

        Visits are numbered where they have several rows, or errors of their own.

        Args:
            study: Says which rows are measured.
            positions: Empty columns for the unloaded and the loaded position instead of the
                displacement.
            markers: Rows for so many markers in each repetition, with empty columns for their
                places on the tool; 0 for a single one at the tool point, or for the instruments of
                the study.
        """
        sensors = study.model.sensors
        rows = len(sensors) or max(markers, 1)
        written: dict[str, Sequence[Any]] = {}
        if sensors:
            offsets = 1e3 * np.array([sensor.point.offset for sensor in sensors])
            written[MARKER_NAME_COLUMN] = [sensor.name for sensor in sensors]
            written |= dict(zip(MARKER_COLUMNS, offsets.T.tolist(), strict=True))
        sight = study.sight
        first = np.cumsum([0, *(sensor.rows for sensor in sensors[:-1])]) if sensors else [0] * rows
        return cls(
            rows,
            written,
            _to_fill_in(study, positions, markers),
            None if sight is None else lambda q: sight.rows(q)[:, first],
            rows > 1 or study.noise is not None,
        )


def template(study: Study, plan: Plan, columns: SheetColumns) -> "pd.DataFrame":
    """Make the empty sheet of a plan: a row for each instrument of each visit.

    Visits come in an order of little joint travel; where load changes cost something, or loads
    stay on, those under one load come one after another. Angles have the digits that a controller
    takes; `edtk identify` reads the sheet when it is filled in.

    Args:
        study: The study.
        plan: The plan that is to be measured.
        columns: What the sheet has beside poses and loads.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement
        file to be.
    """
    plan = replace(plan, q=rounded(study.robot, plan.q))
    order = sheet_order(study, plan)
    table = plan.to_frame(study.robot).drop(columns="repeats")
    table = table.iloc[np.repeat(order, columns.rows)].reset_index(drop=True)
    if columns.numbered:
        table[VISIT_COLUMN] = np.arange(len(table)) // columns.rows + 1
    for name, values in columns.written.items():
        table[name] = list(values) * len(order)
    table[list(columns.empty)] = np.nan
    if columns.read is None:
        return table
    return table[columns.read(plan.q[order]).reshape(-1)].reset_index(drop=True)


def sheet_order(study: Study, plan: Plan) -> Indices:
    """Indices of the plan's poses in the order of its sheet, repeats included.

    Where displacements are measured, loads come and go in each experiment: they make no order as
    long as that costs nothing.
    """
    costs = study.specification.costs
    if study.kind.keeps_loads or costs is not None or study.cell is not None:
        return visit_order(study, plan)
    lower, upper = study.robot.limits
    path = visiting_order(plan.q, upper - lower)
    return np.repeat(path, plan.repeats[path])


def _to_fill_in(study: Study, positions: bool, markers: int) -> tuple[str, ...]:
    """Columns that are to be filled in."""
    marker = MARKER_COLUMNS if markers else ()
    kinds = read_by(study.model.instruments)
    form = next(form_of(kind) for kind in kinds if kind != "rotation")
    before = () if study.is_absolute else form.unloaded
    position = (*before, *form.loaded) if positions else form.change
    turned = ROTATION_COLUMNS if "pose" in kinds else (TURN_COLUMN,) * ("rotation" in kinds)
    return (*marker, *position, *turned)


def write_template(table: "pd.DataFrame", path: Path | str) -> None:
    """Write a sheet (CSV) to a file, whole or not at all, or to standard output (`-`)."""
    write_text(path, csv_text(table))
