"""The sheet on which a plan's measurements are written down, and the order of its visits."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from edtk.cell.sight import Sight
from edtk.design.plan import Plan
from edtk.fit.sheet import DISTANCES, POSITIONS
from edtk.measure.cells import csv_text
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.sensor import Sensor
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
NEAR = 5  # neighbours of a pose that a leg may lead to, before longer legs are looked at
BEST_UP_TO = 11  # poses; dynamic programming takes time and memory in proportion to k^2 2^k
EXCHANGES_UP_TO = 300  # poses; exchanges take time in proportion to k^3
LEAST_GAIN = 1e-12  # relative: below that an exchange of legs is rounding, and might go on for ever


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


def shortest_legs(x: Array) -> Indices:
    """Find an open path through all points, from the shortest legs on.

    The shortest leg that joins the ends of two stretches of the path is laid first (the greedy
    heuristic; Bentley 1992). Legs are looked for among neighbours, then among those of the
    remaining ends, so that the time grows as k log k.

    Args:
        x: Points (k, n).

    Returns:
        Indices (k,), in the order of the path; equal points come one after another.
    """
    # Among very many equal points a search for neighbours would look at all of them.
    points, number = np.unique(x, axis=0, return_inverse=True)
    number = number.ravel()
    place = np.empty(len(points), dtype=int)
    place[_path(points)] = np.arange(len(points))
    return np.argsort(place[number], kind="stable")


def _path(x: Array) -> Indices:
    """The path through points (k, n) that are all different."""
    from scipy.spatial import cKDTree

    k = len(x)
    if k == 1:
        return np.zeros(1, dtype=int)
    legs: list[list[int]] = [[] for _ in range(k)]
    stretch = list(range(k))
    missing = k - 1
    while missing:
        ends = np.array([i for i in range(k) if len(legs[i]) < 2])
        # A pose, and perhaps the other end of its stretch, are among its own neighbours.
        distance, near = cKDTree(x[ends]).query(x[ends], min(NEAR + 2, len(ends)))
        for a, b in _by_length(ends, ends[near], distance):
            if len(legs[a]) == 2 or len(legs[b]) == 2:
                continue
            first = _root(stretch, a)
            second = _root(stretch, b)
            if first != second:
                stretch[first] = second
                legs[a].append(b)
                legs[b].append(a)
                missing -= 1
    return _walk(legs)


def _by_length(ends: Indices, near: Indices, distance: Array) -> list[list[int]]:
    """Pairs of points, each once, the nearest first."""
    pairs = np.stack([np.broadcast_to(ends[:, None], near.shape), near], axis=-1).reshape(-1, 2)
    pairs = np.sort(pairs, axis=1)
    chosen = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    # Equal distances are told apart by the numbers, so that the path is the same everywhere.
    order = np.lexsort((pairs[chosen, 1], pairs[chosen, 0], distance.ravel()[chosen]))
    return pairs[chosen[order]].tolist()


def _root(stretch: list[int], i: int) -> int:
    """The number of the stretch that a point is in; the way there is halved."""
    while stretch[i] != i:
        stretch[i] = stretch[stretch[i]]
        i = stretch[i]
    return i


def _walk(legs: list[list[int]]) -> Indices:
    """The points from one end of the path to the other."""
    before = -1
    at = next(i for i, own in enumerate(legs) if len(own) == 1)
    order = [at]
    while len(order) < len(legs):
        following = next(i for i in legs[at] if i != before)
        before = at
        at = following
        order.append(at)
    return np.array(order)


def visiting_order(
    q: Array, span: Array, best_up_to: int = BEST_UP_TO, exchanges_up_to: int = EXCHANGES_UP_TO
) -> Indices:
    """Find an open path through all poses: short, the shortest for a few poses.

    The length of a leg is the root of the sum of squares of the joints' travel, each divided by its
    range. Many poses are put in order by nearest neighbour, and legs are exchanged while that
    shortens the path (2-opt). Very many are joined from the shortest legs on.

    Args:
        q: Joint variables (k, n) [rad or m].
        span: Range (n,) of each joint [rad or m].
        best_up_to: Number of poses up to which the shortest path is found.
        exchanges_up_to: Number of poses up to which legs are exchanged.

    Returns:
        Indices (k,); the path begins at that of its ends which comes first in q.
    """
    x = q / span
    if len(x) > exchanges_up_to:
        order = shortest_legs(x)
    else:
        distance = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1))
        few = len(x) <= best_up_to
        order = _shortest(distance) if few else _exchanged(distance, _nearest(x))
    return order if order[0] <= order[-1] else order[::-1]


def _shortest(distance: Array) -> Indices:
    """The shortest open path by dynamic programming over sets of visited poses (Held, Karp 1962).

    A set is a number whose bits say which poses are in it. `cost[s, j]` is the length of the
    shortest path through the set s that ends at j, and `last[s, j]` the pose before j on it.
    """
    k = len(distance)
    everywhere = (1 << k) - 1
    cost = np.full((1 << k, k), np.inf)
    last = np.zeros((1 << k, k), dtype=int)
    cost[1 << np.arange(k), np.arange(k)] = 0.0
    for visited in range(1, 1 << k):
        for j in range(k):
            before = visited & ~(1 << j)
            if before and before != visited:
                ways = cost[before] + distance[:, j]
                last[visited, j] = ways.argmin()
                cost[visited, j] = ways[last[visited, j]]
    visited = everywhere
    j = int(cost[everywhere].argmin())
    order = []
    while visited:
        order.append(j)
        before = int(last[visited, j])
        visited &= ~(1 << j)
        j = before
    return np.array(order)


def _nearest(x: Array) -> Indices:
    """From the first pose always on to the nearest one that is left."""
    left: Mask = np.ones(len(x), dtype=bool)
    order = np.zeros(len(x), dtype=int)
    for i in range(1, len(x)):
        left[order[i - 1]] = False
        rest = np.flatnonzero(left)
        squares = ((x[rest] - x[order[i - 1]]) ** 2).sum(axis=1)
        order[i] = rest[squares.argmin()]
    return order


def _exchanged(distance: Array, order: Indices) -> Indices:
    """Reverse the stretch of the path that shortens it most, until none does.

    Reversing the positions i..j replaces the legs (i-1, i) and (j, j+1) by (i-1, j) and (i, j+1);
    at the ends of the path one of each is missing. A pose of no distance to any other stands in
    for the missing ones.
    """
    k = len(distance)
    open_ended = np.zeros((k + 1, k + 1))
    open_ended[:k, :k] = distance
    path = np.r_[k, order, k]
    least = LEAST_GAIN * (1 + distance.max())
    upper = np.triu(np.ones((k, k), dtype=bool), 1)
    while True:
        before = path[:-2]
        at = path[1:-1]
        after = path[2:]
        legs = open_ended[before, at][:, None] + open_ended[at, after]
        exchanged = open_ended[np.ix_(before, at)] + open_ended[np.ix_(at, after)]
        change = np.where(upper, exchanged - legs, 0.0)
        i, j = np.unravel_index(change.argmin(), change.shape)
        if change[i, j] >= -least:
            return path[1:-1]
        path[i + 1 : j + 2] = path[i + 1 : j + 2][::-1].copy()


def visit_order(study: Study, plan: Plan) -> Indices:
    """Indices of the plan's poses in the order in which they are visited, repeats included.

    All poses without a load come first, then those under each load. Where the study asks for more
    load changes, the visits of each load are shared out among so many rounds.
    """
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


def template(study: Study, plan: Plan, positions: bool = False, markers: int = 0) -> "pd.DataFrame":
    """Make the empty sheet of a plan: a row per repetition, in an order of little joint travel.

    Where load changes cost something, the poses of a load come one after another.
    Repetitions of a pose come one after another. Angles have the digits that a controller takes.
    Where a visit has several rows, or errors of its own, a column numbers the visits.

    Args:
        study: Says which rows are measured.
        plan: The plan that is to be measured.
        positions: Empty columns for the unloaded and the loaded position instead of the
            displacement.
        markers: Rows for so many markers in each repetition, with empty columns for their places
            on the tool; 0 for a single one at the tool point, or for the instruments of the study.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement
        file to be.
    """
    lower, upper = study.robot.limits
    plan = replace(plan, q=rounded(study.robot, plan.q))
    if study.specification.costs is None:
        path = visiting_order(plan.q, upper - lower)
        order = np.repeat(path, plan.repeats[path])
    else:
        order = visit_order(study, plan)
    sensors = study.model.sensors
    rows = len(sensors) or max(markers, 1)
    table = plan.to_frame(study.robot).drop(columns="repeats")
    table = table.iloc[np.repeat(order, rows)].reset_index(drop=True)
    if rows > 1 or study.noise is not None:
        table[VISIT_COLUMN] = np.arange(len(table)) // rows + 1
    if sensors:
        for column, values in _points(sensors, len(table) // len(sensors)).items():
            table[column] = values
    table[list(_empty_columns(study, positions, markers))] = np.nan
    if study.sight is None:
        return table
    read = _read(study.sight, sensors, plan.q[order], rows)
    return table[read].reset_index(drop=True)


def _read(sight: Sight, sensors: Sequence[Sensor], q: Array, rows: int) -> Mask:
    """Which rows of a sheet there are: those of instruments that are read, for each visit in turn.

    Args:
        sight: Which instruments are read in which poses.
        sensors: The instruments, a row each; none where the tool point alone is measured.
        q: The pose of each visit (v, n) [rad or m].
        rows: Rows of each visit.
    """
    there = sight.rows(q)
    if not sensors:
        return np.repeat(there[:, 0], rows)
    first = np.cumsum([0, *(sensor.rows for sensor in sensors[:-1])])
    return there[:, first].reshape(-1)


def _points(sensors: Sequence[Sensor], times: int) -> dict[str, Any]:
    """Columns that say which instrument each row is of, and where its point is [mm]."""
    names = {MARKER_NAME_COLUMN: [sensor.name for sensor in sensors] * times}
    offsets = np.tile([1e3 * sensor.point.offset for sensor in sensors], (times, 1))
    return names | dict(zip(MARKER_COLUMNS, offsets.T, strict=True))


def _empty_columns(study: Study, positions: bool, markers: int) -> tuple[str, ...]:
    """Columns that are to be filled in."""
    marker = MARKER_COLUMNS if markers else ()
    rows = study.model.instruments[0].rows
    changes, unloaded, loaded = DISTANCES if rows == 1 else POSITIONS
    turns = any(not sensor.lengths.any() for sensor in study.model.sensors)
    before = () if study.is_absolute else unloaded
    position = (*before, *loaded) if positions else changes
    turned = ROTATION_COLUMNS if rows == 6 else (TURN_COLUMN,) * turns
    return (*marker, *position, *turned)


def write_template(table: "pd.DataFrame", path: Path | str) -> None:
    """Write a sheet (CSV) to a file, whole or not at all, or to standard output (`-`)."""
    write_text(path, csv_text(table))
