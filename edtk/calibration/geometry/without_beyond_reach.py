"""Positions with a coordinate that no pose can have: a decimal point lost, a number typed twice."""

from dataclasses import replace

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt, rows_in_words
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Mask

BEYOND = 3.0  # times the reach, or twice the usual distance from the middle: no marker is there


def without_beyond_reach(
    data: MarkerPositions, reach: float
) -> tuple[MarkerPositions, list[GeometricDoubt]]:
    """The positions without those that a wrong number has put where the arm cannot be.

    A position of which all three coordinates are as far is kept: it may be in another unit or
    frame, which is looked for later.

    Args:
        data: Positions of markers on the tool.
        reach: No point of the arm is farther from its base [m].
    """
    apart = np.abs(data.measured - np.median(data.measured[data.seen], axis=0))
    usual = float(np.median(apart[data.seen].max(axis=-1)))
    far = apart > BEYOND * max(reach, 2 * usual)
    typed = np.asarray(far.any(axis=-1) & ~far.all(axis=-1))
    if not typed.any():
        return data, []
    measured = np.where(typed[..., None], np.nan, data.measured)
    return replace(data, measured=measured), [_doubt(data, typed, far, reach)]


def _doubt(data: MarkerPositions, typed: Mask, far: Mask, reach: float) -> GeometricDoubt:
    """What is said of them, with the coordinate that is farthest."""
    rows = tuple(sorted({int(row) for row in data.row[typed]}))
    there = np.where(far & typed[..., None], np.abs(data.measured), 0.0)
    visit, marker, axis = np.unravel_index(int(np.argmax(there)), there.shape)
    size = 1e3 * float(data.measured[visit, marker, axis])
    alone = typed.sum() == 1
    text = (
        f"{rows_in_words(rows)}: {'xyz'[axis]} of {data.markers[marker]} is "
        f"{'' if alone else 'up to '}{size:.6g} mm, and the arm reaches {1e3 * reach:.4g} mm; "
        f"a wrong number? {'This position does' if alone else 'These positions do'} not count"
    )
    return GeometricDoubt(Severity.WARNING, "beyond_reach", text, rows)
