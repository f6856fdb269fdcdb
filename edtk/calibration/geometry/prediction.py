"""Positions of markers in other poses, by an identified geometry, and how they compare."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry.prediction_doubts import prediction_doubts
from edtk.calibration.geometry.read_geometry import read_geometry
from edtk.calibration.geometry.tool_from_rows import tool_from_rows
from edtk.calibration.geometry.turn_reading import EXPECTED, turn_reading
from edtk.inference.geometry.fitted_geometry import Predicted
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.read_positions import read_positions
from edtk.model.geometry.rotation import rotation_vectors
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.study.study_model import marker_names
from edtk.system.errors import ArgumentError, UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Mask
from edtk.tables.pose_table import Table, path_of

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3
OPEN = 1e-4  # [m]: what a calibration left open may move a marker by, before it is said
ROUNDING = 1e-4  # [rad or m]: a limit may be exceeded by what a controller's display leaves out


@dataclass(frozen=True, eq=False)
class Prediction(Presented):
    """Predicted positions with 95 % bands, and measured ones where there are any.

    Attributes:
        data: The poses, with what was measured there.
        predicted: Positions and bands.
        tests: Which positions (v, k) are measured and no part of any fit.
        asked: Which positions (v, k) the file asks for.
        beyond: Rows, counted from 0, of poses beyond the joints' limits.
    """

    data: MarkerPositions
    predicted: Predicted
    tests: Mask
    asked: Mask
    beyond: tuple[int, ...] = ()

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
    def doubts(self) -> tuple[str, ...]:
        """What makes these predictions, or the comparison, hard to believe: a line each."""
        return prediction_doubts(self)

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
            "doubts": list(self.doubts),
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
    beyond = _beyond(study.robot, data)
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
    return Prediction(data, predicted, tests, wanted, beyond)


def _beyond(robot: Robot, data: MarkerPositions) -> tuple[int, ...]:
    """Rows, counted from 0, of poses beyond the limits of the joints."""
    lower, upper = robot.hard_limits
    over = np.maximum(lower - data.q, data.q - upper).max(axis=1) > ROUNDING
    return tuple(sorted({int(row) for row in data.row[over].ravel() if row >= 0}))
