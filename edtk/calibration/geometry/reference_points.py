"""Points on the base: whether they, or the frame of the instrument, moved during the day."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt, rows_in_words
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.rigid_motion import rigid_motion
from edtk.system.typing import Array, Indices, Mask

SCATTERS = 10.0  # times its usual scatter a point has moved
SAME = 1e-3  # [m] nearer than this two readings are of one point
LEAST = 1e-4  # [m] below it a motion is that of the floor


@dataclass(frozen=True, eq=False)
class References:
    """What the points on the base tell.

    Attributes:
        doubts: What moved.
        frames: For each visit the motion (v, 4, 4) that takes its positions back to where the
            frame of the instrument was at most times; the identity where it did not move.
    """

    doubts: tuple[GeometricDoubt, ...]
    frames: Array


def reference_points(points: MarkerPositions, tool: MarkerPositions) -> References:
    """Tell a point that moved from a frame that moved with all of them.

    A point moved where it is far from its median place alone; the frame of the instrument did where
    most points are, and a rigid motion brings all of them back.

    Args:
        points: Positions of the points on the base, lost ones NaN.
        tool: Those of the markers on the tool in the same visits: a beam may have been on one.
    """
    v, r = points.seen.shape
    frames = np.tile(np.eye(4), (v, 1, 1))
    if not r:
        return References((), frames)
    place = np.nanmedian(points.measured, axis=0)
    apart = np.linalg.norm(points.measured - place, axis=-1)
    usual = 1.4826 * np.nanmedian(apart, axis=0)
    moved: Mask = apart > np.maximum(SCATTERS * usual, LEAST)
    together = (moved.sum(axis=1) > points.seen.sum(axis=1) / 2) & (points.seen.sum(axis=1) > 2)
    doubts = []
    if together.any():
        for visit in np.flatnonzero(together):
            seen = points.seen[visit]
            frames[visit] = rigid_motion(points.measured[visit][seen], place[seen])
        doubts.append(_frame_moved(points, together, apart))
    for i in range(r):
        alone = np.flatnonzero(moved[:, i] & ~together)
        if len(alone):
            doubts += _moved_alone(points, tool, alone, i, apart[alone, i])
    return References(tuple(doubts), frames)


def _moved_alone(
    points: MarkerPositions, tool: MarkerPositions, visits: Indices, i: int, apart: Array
) -> list[GeometricDoubt]:
    """The doubts that name the visits in which one point is elsewhere, by where it is."""
    here = np.linalg.norm(tool.measured[visits] - points.measured[visits, i, None], axis=-1)
    on = [int(np.nanargmin(one)) if np.nanmin(one, initial=1.0) < SAME else -1 for one in here]
    found = []
    name = points.markers[i]
    for marker in sorted(set(on)):
        chosen = np.flatnonzero(np.array(on) == marker)
        rows = tuple(int(row) for row in points.row[visits[chosen], i])
        what = f"moved, by up to {1e3 * float(apart[chosen].max()):.3g} mm"
        if marker >= 0:
            what = f"is where the marker {tool.markers[marker]} on the tool is"
        text = f"{rows_in_words(rows)}: the point {name} on the base {what}; it does not count"
        found.append(GeometricDoubt(Severity.WARNING, "reference_moved", text, rows))
    return found


def _frame_moved(points: MarkerPositions, together: Mask, apart: Array) -> GeometricDoubt:
    """The doubt that names the visits in which all points moved."""
    visits = np.flatnonzero(together)
    rows = tuple(sorted({int(row) for row in points.row[visits].ravel() if row >= 0}))
    size = 1e3 * float(np.nanmax(np.nanmedian(apart[visits], axis=1)))
    return GeometricDoubt(
        Severity.WARNING,
        "frame_moved",
        f"{rows_in_words(rows)}: the frame of the instrument moved, by up to {size:.3g} mm at the "
        "base; positions there are taken back by the points on the base",
        rows,
    )
