"""Positions of markers that other poses have placed on the tool anew."""

from dataclasses import replace

import numpy as np

from edtk.fit.circumstances import Loads
from edtk.fit.fitted_geometry import ErrorParts, FittedGeometry, Predicted
from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.parameters import COMPONENTS
from edtk.robots.rotations import rotation
from edtk.system.typing import Array, Indices, Mask


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
