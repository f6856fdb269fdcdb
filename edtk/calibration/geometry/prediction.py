"""Positions of markers in other poses, by an identified geometry, and how they compare."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry.geometric_calibration import read_geometry
from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.findings.geometry.turn_reading import EXPECTED, turn_reading
from edtk.findings.units import like_radians
from edtk.fit.geometry.fitted_geometry import ErrorParts, FittedGeometry, Loads, Predicted
from edtk.fit.geometry.marker_positions import MarkerPositions, read_positions
from edtk.measure.parameters import COMPONENTS
from edtk.measure.pose_table import LOADED_COLUMNS, Table, path_of
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.study.study import Study
from edtk.study.study_model import marker_names
from edtk.system.errors import ArgumentError, UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3
FAR = 5.0  # half bands: an error beyond them is no matter of chance
MOST = 0.5  # of the positions: if as many are far off, what they have in common is wrong
OPEN = 1e-4  # [m]: what a calibration left open may move a marker by, before it is said
ROUNDING = 1e-4  # [rad or m]: a limit may be exceeded by what a controller's display leaves out


def prediction_findings(found: "Prediction") -> tuple[Finding, ...]:
    """What is said of open directions, poses beyond limits, and positions that are far off.

    Args:
        found: Positions, and measured ones where there are any.
    """
    said = []
    if found.open_rows:
        said.append(Finding.of(Severity.WARNING, WORDING, "open_rows", rows=found.open_rows))
    if found.beyond:
        said.append(
            Finding.of(Severity.WARNING, WORDING, "beyond_limits", rows=tuple(found.beyond))
        )
    if found.radians and not found.tests.any():
        said.append(Finding.of(Severity.WARNING, WORDING, "angle_unit"))
    return (*said, *_far_off(found))


def _far_off(found: "Prediction") -> list[Finding]:
    """Errors that bands and chance do not explain, and what they may come from."""
    if not found.tests.any():
        return []
    half = np.linalg.norm(found.predicted.half[found.tests], axis=-1)
    is_far = found.errors > FAR * half
    if not is_far.any():
        return []
    if is_far.mean() > MOST:
        return [
            Finding.of(
                Severity.WARNING, WORDING, "all_far_off", median=float(np.median(found.errors))
            )
        ]
    rows = tuple(sorted({int(row) for row in found.data.row[found.tests][is_far]}))
    return [
        Finding.of(
            Severity.WARNING,
            WORDING,
            "far_off",
            rows=rows,
            largest=float(found.errors[is_far].max()),
        )
    ]


def _open_rows(data: Data) -> str:
    """Poses for which a calibration says too little."""
    moves = "moves" if len(data["rows"]) == 1 else "move"
    return (
        f"{rows_in_words(data['rows'])} {moves} along directions that the calibration left open; "
        "their bands assume errors of up to 10 mm or mrad"
    )


WORDING: Wording = {
    "open_rows": _open_rows,
    "angle_unit": lambda _: (
        "all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"
    ),
    "beyond_limits": lambda data: f"{rows_in_words(data['rows'])}: beyond the joints' limits",
    "all_far_off": lambda data: (
        f"measured positions are {MM * data['median']:.3g} mm off (median), far outside their "
        "bands: is the instrument where it was on the day of the calibration, are angles in "
        "degrees and positions in millimetres?"
    ),
    "far_off": lambda data: (
        f"{rows_in_words(data['rows'])}: up to {MM * data['largest']:.3g} mm off, far outside the "
        "bands: a swapped or moved marker, or a pose typed wrongly?"
    ),
}


@dataclass(frozen=True, eq=False)
class Prediction(Presented):
    """Predicted positions with 95 % bands, and measured ones where there are any.

    Attributes:
        data: The poses, with what was measured there.
        predicted: Positions and bands.
        tests: Which positions (v, k) are measured and no part of any fit.
        asked: Which positions (v, k) the file asks for.
        beyond: Rows, counted from 0, of poses beyond the joints' limits.
        radians: Whether the joint angles look like radians.
    """

    data: MarkerPositions
    predicted: Predicted
    tests: Mask
    asked: Mask
    beyond: tuple[int, ...] = ()
    radians: bool = False

    def headline(self) -> str:
        """How many positions, and how far they are off."""
        text = f"{int(self.asked.sum())} positions in {len(self.data)} rows"
        if not self.tests.any():
            half = MM * float(np.median(self.predicted.half[self.asked]))
            return f"{text}, 95 % bands of +-{half:.3g} mm"
        return (
            f"{text}, errors {self.mean_mm:.3g} mm mean, {self.rms_mm:.3g} rms, "
            f"{self.max_mm:.3g} max; {100 * self.share_inside:.0f} % inside"
        )

    @property
    def errors(self) -> Array:
        """Distances (t,) of measured from predicted positions [m]."""
        apart = self.data.measured - self.predicted.points
        return np.asarray(np.linalg.norm(apart[self.tests], axis=-1))

    @property
    def mean_mm(self) -> float:
        """Mean distance [mm]; NaN without measured positions."""
        return MM * float(self.errors.mean()) if self.tests.any() else float("nan")

    @property
    def rms_mm(self) -> float:
        """Root mean square distance [mm]; NaN likewise."""
        errors = self.errors
        return MM * float(np.sqrt((errors**2).mean())) if len(errors) else float("nan")

    @property
    def max_mm(self) -> float:
        """Largest distance [mm]; NaN likewise."""
        return MM * float(self.errors.max()) if self.tests.any() else float("nan")

    @property
    def share_inside(self) -> float:
        """Share of measured coordinates inside their 95 % bands; NaN likewise."""
        if not self.tests.any():
            return float("nan")
        return float(self.predicted.inside(self.data.measured)[self.tests].mean())

    @property
    def turn_errors(self) -> Array | None:
        """Angles (t,) between measured and predicted orientations [rad]; None without any."""
        turns = self.data.turns
        if turns is None or not self.tests.any():
            return None
        apart = turns @ np.swapaxes(self.predicted.turns, -1, -2)
        # Of small angles the cosine has half the digits: the sine is that of the skew part.
        skew = 0.5 * (apart - np.swapaxes(apart, -1, -2))[self.tests]
        sine = np.sqrt((skew**2).sum(axis=(-1, -2)) / 2)
        cosine = (np.trace(apart[self.tests], axis1=-2, axis2=-1) - 1) / 2
        return np.asarray(np.arctan2(sine, cosine))

    @property
    def turn_rms_deg(self) -> float | None:
        """Their root mean square [deg]."""
        errors = self.turn_errors
        if errors is None or not np.isfinite(errors).any():
            return None
        return float(np.rad2deg(np.sqrt(np.nanmean(errors**2))))

    @property
    def open_rows(self) -> tuple[int, ...]:
        """Rows, counted from 0, that move along directions which the calibration left open."""
        far = self.predicted.open > OPEN
        return tuple(sorted({int(row) for row in self.data.row[far & self.asked] if row >= 0}))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What makes these predictions, or the comparison, hard to believe."""
        return prediction_findings(self)

    def to_dict(self) -> dict[str, Any]:
        """Positions by row and marker, and the comparison; null without measured positions."""
        measured = bool(self.tests.any())
        return {
            "positions": self._positions(),
            "errors": {
                "count": int(self.tests.sum()),
                "mean_mm": self.mean_mm if measured else None,
                "rms_mm": self.rms_mm if measured else None,
                "max_mm": self.max_mm if measured else None,
            },
            "mean_mm": self.mean_mm if measured else None,
            "rms_mm": self.rms_mm if measured else None,
            "max_mm": self.max_mm if measured else None,
            "share_inside": self.share_inside if measured else None,
            **({} if self.predicted.turn_half is None else {"turn_rms_deg": self.turn_rms_deg}),
            "open_rows": [row + 1 for row in self.open_rows],
            "doubts": [one.words for one in self.findings],
        }

    def _positions(self) -> list[dict[str, Any]]:
        """A table for each position."""
        found = []
        vectors = self._vectors()
        for visit, marker in zip(*np.nonzero(self.asked), strict=True):
            entry: dict[str, Any] = {
                "row": int(self.data.row[visit, marker]) + 1,
                "marker": self.data.markers[marker],
            }
            for axis, name in enumerate("xyz"):
                entry[f"{name}_mm"] = MM * float(self.predicted.points[visit, marker, axis])
            for axis, name in enumerate("xyz"):
                entry[f"band_{name}_mm"] = MM * float(self.predicted.half[visit, marker, axis])
            if vectors is not None and self.predicted.turn_half is not None:
                half = np.rad2deg(self.predicted.turn_half[visit, marker])
                for axis, name in enumerate("xyz"):
                    entry[f"r{name}_deg"] = float(vectors[visit, marker, axis])
                    entry[f"band_r{name}_deg"] = float(half[axis])
            if self.data.seen[visit, marker]:
                apart = self.data.measured[visit, marker] - self.predicted.points[visit, marker]
                entry["error_mm"] = MM * float(np.linalg.norm(apart))
                inside = np.abs(apart) <= self.predicted.half[visit, marker]
                entry["inside"] = bool(inside.all())
                entry["test"] = bool(self.tests[visit, marker])
            found.append(entry)
        return found

    def _vectors(self) -> Array | None:
        """Predicted orientations as rotation vectors (v, k, 3) [deg]; None where none is asked."""
        if self.predicted.turn_half is None:
            return None
        return np.asarray(np.rad2deg(rotation_vectors(self.predicted.turns)))

    def to_frame(self) -> "pd.DataFrame":
        """A row for each position, as in `to_dict`."""
        import pandas as pd

        return pd.DataFrame(self._positions())


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
    asked = (*setting.markers, *setting.references)
    data = read_positions(
        poses,
        study.robot,
        study.fixed,
        asked,
        measured=False,
        others=marker_names(study),
        turned=setting.markers if setting.full_poses else (),
    )
    if data.differs is not None:
        raise UserError(
            f"displacements; predictions are of positions: expected {', '.join(LOADED_COLUMNS)}",
            where=path_of(poses),
        )
    beyond = _beyond(study.robot, data)
    radians = like_radians(study, data.q)
    data = counting.of(setting.split(data.without_lost())[0])
    reading = turn_reading(poses, study.robot, data)
    if reading:
        raise UserError(f"the robot fits if {reading}; expected {EXPECTED}", where=path_of(poses))
    wanted: Mask = np.greater_equal(data.row, 0)
    tests = data.seen.copy()
    if tool_rows:
        last = int(data.row.max()) + 1
        if tool_rows > last:
            message = f"{path_of(poses)} has {last} rows"
            raise ArgumentError(message, argument="tool_rows", given=tool_rows)
        placing = np.logical_and(data.seen, data.row < tool_rows)
        if not placing.any():
            raise UserError(
                "no marker was measured in the rows that place the tool",
                where=path_of(poses),
            )
        predicted = tool_from_rows(fitted, data, placing, setting.loads)
        tests &= ~placing
    else:
        predicted = fitted.predict(data.q, data.wrench, setting.loads)
    return Prediction(data, predicted, tests, wanted, beyond, radians)


def _beyond(robot: Robot, data: MarkerPositions) -> tuple[int, ...]:
    """Rows, counted from 0, of poses beyond the limits of the joints."""
    lower, upper = robot.hard_limits
    over = np.maximum(lower - data.q, data.q - upper).max(axis=1) > ROUNDING
    return tuple(sorted({int(row) for row in data.row[over].ravel() if row >= 0}))


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
    slopes = moved.slopes(motion)
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
        whites = noise.white_kinds(motion.shape[1])
        kinds = [np.broadcast_to(np.diag(one[coordinates]), (s, rows, rows)) for one in whites]
        for mask in self.fitted.joint_masks(motion.shape[1]):
            J = own_motion[:, coordinates][..., mask]
            kinds.append(J @ np.swapaxes(J, 1, 2))
        for i, kind in enumerate(kinds):
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
