"""Positions with a coordinate that no pose can have."""

import numpy as np
import pytest

from edtk.findings.sound_rows import without_beyond_reach
from edtk.fit.marker_positions import MarkerPositions

REACH = 1.5  # m


def positions() -> MarkerPositions:
    """Two markers in ten visits, somewhere within reach of an arm far from the instrument."""
    middle = np.array([40.0, -3.0, 0.5])
    x = middle + np.random.default_rng(0).uniform(-1, 1, (10, 2, 3))
    row = np.arange(20).reshape(10, 2)
    return MarkerPositions(np.zeros((10, 6)), np.zeros((10, 6)), x, row, ("A", "B"))


def test_sound_positions_are_left_alone() -> None:
    """Nothing is said of positions within reach, wherever the instrument stands."""
    data = positions()
    kept, doubts = without_beyond_reach(data, REACH)
    assert kept is data
    assert doubts == []


@pytest.mark.parametrize("value", [554.3682e3, -15.38e3, 1e200])
def test_a_wrong_number_is_named_with_its_row(value: float) -> None:
    """One coordinate out of all reach is named, and its position alone does not count."""
    data = positions()
    data.measured[3, 1, 2] = value
    kept, (doubt,) = without_beyond_reach(data, REACH)
    assert np.flatnonzero(~kept.seen).tolist() == [7]
    assert doubt.rows == (7,)
    assert doubt.words.startswith(
        f"row 8: z of B is {1e3 * value:.6g} mm, and the arm reaches 1500"
    )


def test_a_position_in_another_unit_is_kept() -> None:
    """All three coordinates are out of reach in micrometres: that is another fault."""
    data = positions()
    data.measured[3] *= 1e3
    kept, doubts = without_beyond_reach(data, REACH)
    assert kept.seen.all()
    assert doubts == []
