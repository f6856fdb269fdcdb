"""Readings in other poses by an identified model, with 95 % bands, and how they compare; and those
of markers that some of these poses place on the tool anew.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.fit.fitted_geometry import ErrorParts, FittedGeometry, Predicted
from edtk.fit.least_squares import share_inside
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.measurements import Measurements
from edtk.measure.equilibrium import Loads
from edtk.measure.parameters import COMPONENTS
from edtk.robots.frames import MM
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd


FAR_OUTSIDE = 5.0  # half bands: an error beyond them is no matter of chance
MAJORITY = 0.5  # of the readings: if as many are far off, what they have in common is wrong
LEFT_OPEN = 1e-4  # [m]: what a calibration left open may move a marker by, before it is said
DISPLAYED = 1e-4  # [rad or m]: a limit may be exceeded by what a controller's display leaves out


# Names of some coordinates, which readings (t,) have them, and where these are among their rows.
Columns = tuple[tuple[str, ...], Mask, slice]


@dataclass(frozen=True, eq=False)
class Prediction(Presented):
    """Predicted positions or displacements with 95 % bands, and measured ones where there are any.

    There are t readings of c coordinates, such as a position of a marker, in metres and radians.

    Attributes:
        data: The poses, with what was measured there.
        what: "positions" or "displacements".
        row: Row of the file (t,) that holds each reading, counted from 0.
        markers: Name (t,) of what is read; empty where nothing has a name.
        columns: Name (c,) of each coordinate in files, with its unit, such as "x_mm" or "rx_deg".
        values: What is predicted (t, c); NaN where a reading has no such coordinate.
        half: Half the width (t, c) of the 95 % bands.
        apart: Measured less predicted (t, c); NaN where nothing was measured.
        tests: Which readings (t,) are measured and no part of any fit.
        open: How far (t,) what the calibration left open may move each, at one standard deviation
            [m].
        beyond: Rows, counted from 0, of poses beyond the joints' limits.
        radians: Whether the joint angles look like radians.
        certain: Whether the result does not say how well its parameters are known.
        other_units: What looks like another unit in loads or compliances.
    """

    data: MarkerPositions | Measurements
    what: str
    row: Indices
    markers: tuple[str, ...]
    columns: tuple[str, ...]
    values: Array
    half: Array
    apart: Array
    tests: Mask
    open: Array
    beyond: tuple[int, ...] = ()
    radians: bool = False
    certain: bool = False
    other_units: tuple[Finding, ...] = ()

    def headline(self) -> str:
        """How many readings, and how far they are off."""
        text = f"{len(self.row)} {self.what} in {len(self.data)} rows"
        if not self.tests.any():
            lengths = self.half[:, self.lengths]
            half = MM * float(np.median(lengths[np.isfinite(lengths)]))
            return f"{text}, 95 % bands of +-{half:.3g} mm"
        return (
            f"{text}, errors {self.mean_mm:.3g} mm mean, {self.rms_mm:.3g} rms, "
            f"{self.max_mm:.3g} max; {100 * self.share_inside:.0f} % inside"
        )

    @property
    def lengths(self) -> Mask:
        """Which coordinates (c,) are lengths; the others are angles."""
        return np.array([column.endswith("_mm") for column in self.columns])

    @property
    def units(self) -> Array:
        """Factors (c,) from metres and radians to those of the columns."""
        return np.where(self.lengths, MM, np.rad2deg(1.0))

    def sizes(self, values: Array, chosen: Mask) -> Array:
        """Lengths (t,) of vectors of the chosen coordinates (c,); NaN without any number."""
        parts = values[:, chosen]
        known = np.isfinite(parts).any(axis=1)
        return np.where(known, np.sqrt(np.nansum(parts**2, axis=1)), np.nan)

    @property
    def errors(self) -> Array:
        """Distances (e,) of measured from predicted positions, or displacements [m]."""
        errors = self.sizes(self.apart, self.lengths)[self.tests]
        return np.asarray(errors[np.isfinite(errors)])

    @property
    def mean_mm(self) -> float:
        """Mean distance [mm]; NaN without measured readings."""
        return MM * float(self.errors.mean()) if len(self.errors) else float("nan")

    @property
    def rms_mm(self) -> float:
        """Root mean square distance [mm]; NaN likewise."""
        errors = self.errors
        return MM * float(np.sqrt((errors**2).mean())) if len(errors) else float("nan")

    @property
    def max_mm(self) -> float:
        """Largest distance [mm]; NaN likewise."""
        return MM * float(self.errors.max()) if len(self.errors) else float("nan")

    @property
    def share_inside(self) -> float:
        """Share of measured coordinates inside their 95 % bands; NaN likewise.

        Where positions are measured with orientations, it is that of the positions.
        """
        positions = self.what == "positions"
        chosen = self.lengths if positions else np.ones(len(self.columns), dtype=bool)
        tests = np.ix_(self.tests, chosen)
        return share_inside(self.apart[tests], self.half[tests])

    @property
    def turn_errors(self) -> Array | None:
        """Angles (e,) between measured and predicted orientations [rad]; None without any."""
        if self.lengths.all() or not self.tests.any():
            return None
        return self.sizes(self.apart, ~self.lengths)[self.tests]

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
        return tuple(sorted({int(row) for row in self.row[self.open > LEFT_OPEN]}))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What makes these predictions, or the comparison, hard to believe."""
        return prediction_findings(self)

    def to_dict(self) -> dict[str, Any]:
        """Readings by row and marker, and the comparison; null without measured ones."""
        measured = len(self.errors) > 0
        sizes = {
            "mean_mm": self.mean_mm if measured else None,
            "rms_mm": self.rms_mm if measured else None,
            "max_mm": self.max_mm if measured else None,
        }
        return {
            self.what: self.readings(),
            "errors": {"count": int(self.tests.sum()), **sizes},
            **sizes,
            "share_inside": self.share_inside if self.tests.any() else None,
            **({} if self.lengths.all() else {"turn_rms_deg": self.turn_rms_deg}),
            "open_rows": [row + 1 for row in self.open_rows],
            "doubts": [one.words for one in self.findings],
        }

    def readings(self) -> list[dict[str, Any]]:
        """A table for each reading."""
        values = (self.values * self.units).tolist()
        half = (self.half * self.units).tolist()
        return [self._reading(i, values[i], half[i]) for i in range(len(self.row))]

    def _reading(self, i: int, values: list[float], half: list[float]) -> dict[str, Any]:
        """The table of one reading; an angle follows all lengths."""
        entry: dict[str, Any] = {"row": int(self.row[i]) + 1}
        if self.markers:
            entry["marker"] = self.markers[i]
        own = [j for j in range(len(self.columns)) if np.isfinite(values[j])]
        lengths = [j for j in own if self.lengths[j]]
        entry |= {self.columns[j]: values[j] for j in lengths}
        entry |= {f"band_{self.columns[j]}": half[j] for j in lengths}
        for j in own:
            if not self.lengths[j]:
                entry[self.columns[j]] = values[j]
                entry[f"band_{self.columns[j]}"] = half[j]
        if np.isfinite(self.apart[i]).any():
            chosen = self.lengths if lengths else ~self.lengths
            name, unit = ("error_mm", MM) if lengths else ("error_deg", np.rad2deg(1.0))
            entry[name] = unit * float(self.sizes(self.apart[[i]], chosen)[0])
            inside = np.abs(self.apart[i, chosen]) <= self.half[i, chosen]
            entry["inside"] = bool(inside[np.isfinite(self.apart[i, chosen])].all())
            entry["test"] = bool(self.tests[i])
        return entry

    def to_frame(self) -> "pd.DataFrame":
        """A row for each reading, as in `to_dict`."""
        import pandas as pd

        return pd.DataFrame(self.readings())


def in_columns(
    groups: Sequence[Columns],
) -> tuple[tuple[str, ...], Callable[[Array], Array]]:
    """Names of all coordinates that some reading has, and what puts rows (t, r) into these (t, c).

    Args:
        groups: The coordinates.
    """
    used = [group for group in groups if group[1].any()]

    def of_columns(values: Array) -> Array:
        """Values of all columns; NaN where a reading has no such coordinate."""
        parts = [np.where(own[:, None], values[:, part], np.nan) for _, own, part in used]
        return np.hstack(parts) if parts else np.zeros((len(values), 0))

    return tuple(name for names, _, _ in used for name in names), of_columns


def beyond_limits(robot: Robot, q: Array, row: Indices) -> tuple[int, ...]:
    """Rows, counted from 0, of poses beyond the limits of the joints.

    Args:
        robot: The robot.
        q: Poses (v, n) [rad or m].
        row: Rows (v, ...) that each pose is in; -1 for none.
    """
    over = robot.bounds.excess(q).max(axis=1) > DISPLAYED
    return tuple(sorted({int(one) for one in row[over].ravel() if one >= 0}))


def prediction_findings(found: "Prediction") -> tuple[Finding, ...]:
    """What is said of open directions, poses beyond limits, and positions that are far off.

    Args:
        found: Positions, and measured ones where there are any.
    """
    said = []
    if found.open_rows:
        data = {"rows": found.open_rows, "what": found.what}
        said.append(Finding.of(Severity.WARNING, WORDING, "open_rows", **data))
    if found.beyond:
        said.append(
            Finding.of(Severity.WARNING, WORDING, "beyond_limits", rows=tuple(found.beyond))
        )
    if found.radians and not found.tests.any():
        said.append(Finding.of(Severity.WARNING, WORDING, "angle_unit"))
    if found.certain:
        said.append(Finding.of(Severity.WARNING, WORDING, "certain"))
    if not found.tests.any():
        said += found.other_units
    return (*said, *_far_off(found))


def _far_off(found: "Prediction") -> list[Finding]:
    """Errors that bands and chance do not explain, and what they may come from."""
    errors = found.sizes(found.apart, found.lengths)
    chosen = found.tests & np.isfinite(errors)
    is_far = chosen & (errors > FAR_OUTSIDE * found.sizes(found.half, found.lengths))
    if not is_far.any():
        return []
    what = {"what": found.what}
    if is_far.sum() > MAJORITY * chosen.sum():
        median = float(np.median(errors[chosen]))
        return [Finding.of(Severity.WARNING, WORDING, "all_far_off", median=median, **what)]
    rows = tuple(sorted({int(row) for row in found.row[is_far]}))
    largest = float(errors[is_far].max())
    return [Finding.of(Severity.WARNING, WORDING, "far_off", rows=rows, largest=largest, **what)]


def _open_rows(data: Data) -> str:
    """Poses for which a calibration says too little."""
    moves = "moves" if len(data["rows"]) == 1 else "move"
    assumed = "errors of up to 10 mm or mrad"
    if data["what"] == "displacements":
        assumed = "the compliances that such joints are likely to have"
    return (
        f"{rows_in_words(data['rows'])} {moves} along directions that the calibration left open; "
        f"their bands assume {assumed}"
    )


def _all_far_off(data: Data) -> str:
    """Readings that are all wrong in the same way."""
    off = (
        f"measured {data['what']} are {MM * data['median']:.3g} mm off (median), far outside their "
        "bands: "
    )
    if data["what"] == "displacements":
        return (
            f"{off}is the load that of the file, and the tool that of the study, are angles in "
            "degrees and displacements in millimetres, and their signs right?"
        )
    return (
        f"{off}is the instrument where it was on the day of the calibration, are angles in "
        "degrees and positions in millimetres?"
    )


def _far_off_words(data: Data) -> str:
    """Single readings that are wrong."""
    what = (
        "a marker that was hit" if data["what"] == "displacements" else "a swapped or moved marker"
    )
    return (
        f"{rows_in_words(data['rows'])}: up to {MM * data['largest']:.3g} mm off, far outside the "
        f"bands: {what}, or a pose typed wrongly?"
    )


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
    slopes = moved.slopes(motion, seen.places, data.wrench)
    own = moved.own_variances(motion, seen.places, data.wrench)
    rows = moved.model.row_count
    for marker in range(len(data.markers)):
        chosen = np.flatnonzero(placing[:, marker])
        if not len(chosen):
            continue
        coordinates = slice(rows * marker, rows * (marker + 1))
        placed = _Placing(moved, _axes(tips.turns[:, marker], rows), chosen, data)
        columns[:, coordinates] = placed.less_mean(columns[:, coordinates])
        apart[:, coordinates] = placed.less_mean(apart[:, coordinates])
        placed.add_noise(motion, seen.places, coordinates, own, slopes)
    found = moved.banded(seen, ErrorParts(columns, apart, own, slopes))
    if rows > 3 and not np.isfinite(turned).all():
        return replace(found, turn_std=None, turn_half=None)
    return found


class _Placing:
    """The poses that place one marker, seen in the axes of the tool."""

    def __init__(
        self, fitted: FittedGeometry, axes: Array, chosen: Indices, data: MarkerPositions
    ) -> None:
        """Keep them.

        Args:
            fitted: The geometry, with the marker at its new place.
            axes: Axes (v, rows, rows) of the tool, in which the marker stands still.
            chosen: Visits (s,) that place it.
            data: All visits.
        """
        self.fitted = fitted
        self.axes = axes
        self.chosen = chosen
        self.pose = data.pose
        self.loaded = np.asarray(data.wrench.any(axis=1))
        self.poses, self.first, self.counts = np.unique(
            data.pose[chosen], return_index=True, return_counts=True
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
        every = noise.of_model(motion, loaded=self.loaded)[block]
        models = self._turned(every[self._firsts], weights)
        left = np.einsum("mrr->mr", every)
        own[:, coordinates] += readings + models + again[:, None] * left
        if slopes is None:
            return
        whites = noise.by_whites(places[self.chosen], motion.shape[1])
        kinds = [np.broadcast_to(one[block], (s, rows, rows)) for one in whites]
        for mask in self.fitted.joint_masks(motion.shape[1]):
            J = own_motion[:, coordinates][..., mask]
            kinds.append(J @ np.swapaxes(J, 1, 2))
        for kind in noise.white_kinds(motion.shape[1])[: noise.changes]:
            kinds.append(np.multiply.outer(self.loaded[self.chosen], np.diag(kind[coordinates])))
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


WORDING: Wording = {
    "open_rows": _open_rows,
    "angle_unit": lambda _: (
        "all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"
    ),
    "beyond_limits": lambda data: f"{rows_in_words(data['rows'])}: beyond the joints' limits",
    "certain": lambda _: (
        "the result does not say how well its compliances are known: bands are those of a reading "
        "alone"
    ),
    "all_far_off": _all_far_off,
    "far_off": _far_off_words,
}
