"""What makes predictions of positions hard to believe."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.geometry.geometric_doubt import rows_in_words

if TYPE_CHECKING:
    from edtk.calibration.geometry.prediction import Prediction

MM = 1e3
FAR = 5.0  # half bands: an error beyond them is no matter of chance
MOST = 0.5  # of the positions: if as many are far off, what they have in common is wrong


def prediction_doubts(found: "Prediction") -> tuple[str, ...]:
    """Lines on open directions, poses beyond limits, and measured positions that are far off.

    Args:
        found: Positions, and measured ones where there are any.
    """
    lines = []
    if found.open_rows:
        moves = "moves" if len(found.open_rows) == 1 else "move"
        lines.append(
            f"{rows_in_words(found.open_rows)} {moves} along directions that the calibration left "
            "open; their bands assume errors of up to 10 mm or mrad"
        )
    if found.beyond:
        lines.append(f"{rows_in_words(found.beyond)}: beyond the joints' limits")
    return (*lines, *_far_off(found))


def _far_off(found: "Prediction") -> list[str]:
    """Errors that bands and chance do not explain, and what they may come from."""
    if not found.tests.any():
        return []
    half = np.linalg.norm(found.predicted.half[found.tests], axis=-1)
    is_far = found.errors > FAR * half
    if not is_far.any():
        return []
    if is_far.mean() > MOST:
        return [
            f"measured positions are {MM * float(np.median(found.errors)):.3g} mm off (median), "
            "far outside their bands: is the instrument where it was on the day of the "
            "calibration, are angles in degrees and positions in millimetres?"
        ]
    rows = tuple(sorted({int(row) for row in found.data.row[found.tests][is_far]}))
    largest = MM * float(found.errors[is_far].max())
    return [
        f"{rows_in_words(rows)}: up to {largest:.3g} mm off, far outside the bands: a swapped or "
        "moved marker, or a pose typed wrongly?"
    ]
