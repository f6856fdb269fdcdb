"""Positions of markers in other poses, by an identified geometry, and how they compare."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.geometry.geometric_calibration import read_geometry
from edtk.calibration.prediction import Prediction, beyond_limits
from edtk.findings.geometry.turn_reading import EXPECTED, turn_reading
from edtk.findings.units import like_radians
from edtk.fit.geometry.fitted_geometry import ErrorParts, FittedGeometry, Loads, Predicted
from edtk.fit.geometry.marker_positions import MarkerPositions, read_positions
from edtk.fit.sheet import VECTOR
from edtk.measure.equilibrium import why_no_rest
from edtk.measure.parameters import COMPONENTS
from edtk.measure.pose_table import (
    CHANGE_COLUMN,
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOADED_COLUMNS,
    ROTATION_COLUMNS,
    Table,
    path_of,
)
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.study.study_model import marker_names
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices, Mask

MM = 1e3


def predict_positions(
    study: Study,
    geometry: Mapping[str, Any],
    where: Path | str,
    poses: Table,
    tool_rows: int = 0,
) -> Prediction:
    """Predict the positions of markers in the poses of a file.

    Args:
        study: The study of the calibration.
        geometry: The table `geometry` of its result.
        where: The result, for messages.
        poses: The file, or a data frame that holds what it would.
        tool_rows: Rows at its beginning that place the markers on the tool.

    Raises:
        UserError: The file cannot be read, or the result is of another study.
    """
    setting, fitted, counting = read_geometry(study, geometry, where)
    kinds = {name: setting.kinds[name] for name in (*setting.markers, *setting.references)}
    data = read_positions(
        poses,
        study.robot,
        study.fixed,
        kinds,
        measured=False,
        others=marker_names(study),
        reference=setting.reference,
    )
    data = setting.as_positions(data)
    beyond = beyond_limits(study.robot, data.q, data.row)
    radians = like_radians(study, data.q)
    data = counting.of(setting.split(data.without_lost())[0])
    _require_sound(setting, fitted, data, poses)
    tests = data.seen.copy()
    if tool_rows:
        placing = _placing(fitted, data, tool_rows, path_of(poses))
        predicted = tool_from_rows(fitted, data, placing, setting.loads)
        tests &= ~placing & ~data.is_difference[:, None]
    else:
        predicted = fitted.predict(data.q, data.wrench, setting.loads, data.is_difference)
    # Orientations are predicted though the file has none, but not of a tool that points placed.
    rows = fitted.model.present.sum(axis=1)
    rows = rows if predicted.turn_half is not None else np.minimum(rows, 3)
    return _prediction(data, rows, predicted, tests, beyond, radians)


def _require_sound(
    setting: StudyGeometry, fitted: FittedGeometry, data: MarkerPositions, poses: Table
) -> None:
    """Check that orientations are read as they are written, and that the arm rests in each pose."""
    robot = setting.study.robot
    on_tool = data.absolute.of_markers(np.arange(len(setting.on_tool)))
    reading = turn_reading(poses, robot, on_tool)
    if reading:
        raise UserError(f"the robot fits if {reading}; expected {EXPECTED}", where=path_of(poses))
    snaps = np.flatnonzero(fitted.snaps(data.q, data.wrench, setting.loads))
    if len(snaps):
        first = int(snaps[0])
        raise UserError(
            why_no_rest(robot, data.q[first], fitted.compliances),
            where=path_of(poses),
            key=f"row {int(data.row[first].max()) + 1}",
        )


def _placing(
    fitted: FittedGeometry, data: MarkerPositions, tool_rows: int, where: Path | str
) -> Mask:
    """The readings (m, k) of the first rows, which place the markers on the tool."""
    last = int(data.row.max()) + 1
    if tool_rows > last:
        message = f"{where} has {last} rows"
        raise ArgumentError(message, argument="tool_rows", given=tool_rows)
    placing = np.logical_and(data.seen, data.row < tool_rows)
    # Neither a distance nor a change under a load says where a marker is.
    placing &= ~fitted.model.is_distance & ~data.is_difference[:, None]
    if not placing.any():
        raise UserError("no marker was measured in the rows that place the tool", where=where)
    return np.asarray(placing)


def _prediction(
    data: MarkerPositions,
    rows: Indices,
    predicted: Predicted,
    tests: Mask,
    beyond: tuple[int, ...],
    radians: bool,
) -> Prediction:
    """What the file asks for, one reading after another, each of so many rows (k,)."""
    visit, marker = np.nonzero(data.row >= 0)
    chosen = (visit, marker)
    turns = predicted.turns[chosen]
    turned = np.zeros((len(visit), 3))
    turned_half = np.zeros((len(visit), 3))
    if predicted.turn_half is not None:
        given = np.full_like(turns, np.nan) if data.turns is None else data.turns[chosen]
        seen: Mask = np.all(np.isfinite(given), axis=(-1, -2))
        turned = np.where(seen[:, None, None], given, turns) @ np.swapaxes(turns, -1, -2)
        turned = np.where(seen[:, None], rotation_vectors(turned), np.nan)
        turned_half = predicted.turn_half[chosen]
    every = (
        np.hstack([predicted.points[chosen], rotation_vectors(turns)]),
        np.hstack([predicted.half[chosen], turned_half]),
        np.hstack([data.measured[chosen] - predicted.points[chosen], turned]),
    )
    columns, of_columns = _columns(rows[marker], data.is_difference[visit])
    values, half, apart = (of_columns(one) for one in every)
    return Prediction(
        data=data,
        what="positions",
        row=data.row[chosen],
        markers=tuple(data.markers[i] for i in marker),
        columns=columns,
        values=values,
        half=half,
        apart=apart,
        tests=tests[chosen],
        open=predicted.open[chosen],
        beyond=beyond,
        radians=radians,
    )


def _columns(rows: Indices, differs: Mask) -> tuple[tuple[str, ...], Callable[[Array], Array]]:
    """Names of the coordinates of all readings, and what puts their rows (t, 6) into these.

    Args:
        rows: How many rows each reading (t,) has: one of a distance, three, or six of a pose.
        differs: Which readings (t,) are differences of two.
    """
    lengths, turns, alone = slice(0, 3), slice(3, 6), slice(0, 1)
    groups: tuple[tuple[tuple[str, ...], Mask, slice], ...] = (
        (LOADED_COLUMNS, (rows > 1) & ~differs, lengths),
        (DEFLECTION_COLUMNS, (rows > 1) & differs, lengths),
        ((DISTANCE_COLUMN,), (rows == 1) & ~differs, alone),
        ((CHANGE_COLUMN,), (rows == 1) & differs, alone),
        (VECTOR, (rows == 6) & ~differs, turns),
        (ROTATION_COLUMNS, (rows == 6) & differs, turns),
    )
    used = [group for group in groups if group[1].any()]

    def of_columns(values: Array) -> Array:
        """Values of all columns; NaN where a reading has no such coordinate."""
        parts = [np.where(own[:, None], values[:, part], np.nan) for _, own, part in used]
        return np.hstack(parts) if parts else np.zeros((len(values), 0))

    return tuple(name for names, _, _ in used for name in names), of_columns


def tool_from_rows(
    fitted: FittedGeometry, data: MarkerPositions, placing: Mask, loads: Loads | None
) -> Predicted:
    """Predict positions of markers whose places on the tool are those of some poses.

    A marker's place is the mean over the s poses that place it, of what brings prediction and
    position together, in the tool's frame; where orientations are measured, its orientation there
    is the mean likewise. With the orientation R of the tool and errors e of a prediction and a
    reading, the marker is then off by

        e(q) - R(q) mean_i(R_i' e_i).

    So what errs alike in all poses, as the place of the old marker on the tool does, is of no
    account, and the columns of the parameters are ``J(q) - R(q) mean_i(R_i' J_i)``. Readings err
    anew each time; what the model leaves out errs alike in all visits of one pose.

    Args:
        fitted: The geometry.
        data: The poses.
        placing: Which positions (v, k) place the markers.
        loads: What loads the joints.

    Returns:
        The positions with their bands. Those of orientations are None where poses that place a
        marker have none.
    """
    tips = fitted.predict(data.q, data.wrench, loads)
    moved, turned = _moved(fitted, data, placing, tips)
    seen, motion, columns, apart = moved.moves(data.q, data.wrench, loads)
    seen = replace(seen, turns=tips.turns @ turned)
    slopes = moved.slopes(motion, seen.places)
    own = moved.own_variances(motion, seen.places)
    rows = moved.model.row_count
    for marker in range(len(data.markers)):
        chosen = np.flatnonzero(placing[:, marker])
        if not len(chosen):
            continue
        coordinates = slice(rows * marker, rows * (marker + 1))
        placed = _Placing(moved, _axes(tips.turns[:, marker], rows), chosen, data.pose)
        columns[:, coordinates] = placed.less_mean(columns[:, coordinates])
        apart[:, coordinates] = placed.less_mean(apart[:, coordinates])
        placed.add_noise(motion, seen.places, coordinates, own, slopes)
    found = moved.banded(seen, ErrorParts(columns, apart, own, slopes))
    if rows > 3 and not np.isfinite(turned).all():
        return replace(found, turn_std=None, turn_half=None)
    return found


class _Placing:
    """The poses that place one marker, seen in the axes of the tool."""

    def __init__(self, fitted: FittedGeometry, axes: Array, chosen: Indices, pose: Indices) -> None:
        """Keep them.

        Args:
            fitted: The geometry, with the marker at its new place.
            axes: Axes (v, rows, rows) of the tool, in which the marker stands still.
            chosen: Visits (s,) that place it.
            pose: Poses (v,) of all visits.
        """
        self.fitted = fitted
        self.axes = axes
        self.chosen = chosen
        self.pose = pose
        self.poses, self.first, self.counts = np.unique(
            pose[chosen], return_index=True, return_counts=True
        )

    def less_mean(self, columns: Array) -> Array:
        """Columns (v, rows, p) less the mean of those of the poses, turned with the tool."""
        local = np.swapaxes(self.axes[self.chosen], 1, 2) @ columns[self.chosen]
        return columns - self.axes @ local.mean(axis=0)

    def add_noise(
        self,
        motion: Array,
        places: Array,
        coordinates: slice,
        own: Array,
        slopes: Array | None,
    ) -> None:
        """Add the errors of the poses to variances (v, r) and their slopes (v, r, c), in place."""
        noise = self.fitted.noise
        s = len(self.chosen)
        rows = coordinates.stop - coordinates.start
        own_motion = motion[self.chosen]
        block = (slice(None), coordinates, coordinates)
        read = noise.of_reading(own_motion, places[self.chosen])
        readings = self._turned(read[block], np.full(s, 1 / s**2))
        # A pose that is visited again errs by what the model leaves out as it did.
        again = np.zeros(len(self.pose))
        for pose, count in zip(self.poses, self.counts, strict=True):
            again[self.pose == pose] = -2 * count / s
        weights = (self.counts / s) ** 2
        models = self._turned(noise.of_model(own_motion[self.first])[block], weights)
        left = np.einsum("mrr->mr", noise.of_model(motion)[block])
        own[:, coordinates] += readings + models + again[:, None] * left
        if slopes is None:
            return
        whites = noise.by_whites(places[self.chosen], motion.shape[1])
        kinds = [np.broadcast_to(one[block], (s, rows, rows)) for one in whites]
        for mask in self.fitted.joint_masks(motion.shape[1]):
            J = own_motion[:, coordinates][..., mask]
            kinds.append(J @ np.swapaxes(J, 1, 2))
        for i, kind in enumerate(kinds):
            if noise.unknown and i < len(whites):  # readings, which err anew
                slopes[:, coordinates, i] += self._turned(kind, np.full(s, 1 / s**2))
                continue
            there = self._turned(kind[self.first], weights)
            slopes[:, coordinates, i] += again[:, None] * slopes[:, coordinates, i] + there

    def _turned(self, covariances: Array, weights: Array) -> Array:
        """Variances (v, rows) of a sum over poses of errors that turn with the tool."""
        axes = self.axes[self.chosen if len(weights) == len(self.chosen) else self._firsts]
        local = np.swapaxes(axes, 1, 2) @ covariances @ axes
        total = np.einsum("s,sij->ij", weights, local)
        return np.einsum("vri,ij,vrj->vr", self.axes, total, self.axes)

    @property
    def _firsts(self) -> Indices:
        """The first visit of each pose."""
        return self.chosen[self.first]


def _moved(
    fitted: FittedGeometry, data: MarkerPositions, placing: Mask, tips: Predicted
) -> tuple[FittedGeometry, Array]:
    """The geometry with the markers at their new places, and how each is turned (k, 3, 3) there."""
    model = fitted.model
    offsets = model.offsets.copy()
    turned = np.tile(np.eye(3), (len(data.markers), 1, 1))
    for marker, name in enumerate(data.markers):
        chosen = np.flatnonzero(placing[:, marker])
        if not len(chosen):
            continue
        turns = tips.turns[chosen, marker]
        apart = data.measured[chosen, marker] - tips.points[chosen, marker]
        local = np.einsum("sji,sj->si", turns, apart).mean(axis=0)
        offsets[marker] += rotation(_own_turn(fitted, name)) @ local
        if data.turns is not None:
            total = (np.swapaxes(turns, 1, 2) @ data.turns[chosen, marker]).sum(axis=0)
            turned[marker] = _nearest(total)
    return replace(fitted, model=replace(model, offsets=offsets)), turned


def _own_turn(fitted: FittedGeometry, marker: str) -> Array:
    """The rotation vector (3,) of a marker on the tool [rad]."""
    found = np.zeros(3)
    for one, value in zip(fitted.model.parameters, fitted.theta, strict=True):
        component = COMPONENTS.index(one.component) if one.place == "tool" else -1
        if one.of == marker and component >= 3:
            found[component - 3] = value
    return found


def _nearest(total: Array) -> Array:
    """The rotation nearest to a sum of rotations; NaN where these are."""
    if not np.isfinite(total).all():
        return np.full((3, 3), np.nan)
    U, _, Vt = np.linalg.svd(total)
    return np.asarray((U * np.array([1.0, 1.0, np.linalg.det(U @ Vt)])) @ Vt)


def _axes(turns: Array, rows: int) -> Array:
    """Orientations (v, 3, 3) for three rows, or for six: those of positions, then of turns."""
    if rows == 3:
        return turns
    both = np.zeros((len(turns), 6, 6))
    both[:, :3, :3] = turns
    both[:, 3:, 3:] = turns
    return both
