"""Findings weigh visits of a pose by rows that err independently, as the fit does."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY

from edtk.findings.fit_rows import FitRows
from edtk.findings.like_poses import LikePoses
from edtk.findings.moved_frame import _Sums, moved_frame
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.position_noise import PositionNoise
from edtk.study.study_geometry import StudyGeometry

POSES = 20
DRAWING = 5e-4  # [m]
READING = 2e-5


@cache
def rows_of(seed: int, moved: float = 0.0, most: int = 1) -> FitRows:
    """A day on which all poses are visited without a load, and then with one that bends nothing.

    Args:
        seed: Of the day.
        moved: How far the frame has moved in the second round [m].
        most: Readings of a marker in a visit.
    """
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(STUDY)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    q = np.tile(rng.uniform(-1, 1, (POSES, 6)), (2, 1))
    x = model.see(np.zeros(model.p), q, derivatives=False).points
    x = x + np.tile(rng.normal(0, DRAWING, (POSES, 3, 3)), (2, 1, 1))
    x = x + rng.normal(0, READING, x.shape)
    x[POSES:] += moved * np.array([0.6, -0.64, 0.48])
    wrench = np.zeros((2 * POSES, 6))
    wrench[POSES:, 2] = -100.0
    row = np.arange(2 * POSES)[:, None] * np.ones(3, dtype=int)
    often = rng.integers(1, most + 1, x.shape[:2])
    data = MarkerPositions(q, wrench, x, row, tuple("ABC"), readings=often)
    noise = PositionNoise(1e3 * READING, np.zeros(6))
    return FitRows.of(fit_geometry(setting.model, data, noise))


def test_running_sums_are_those_of_each_motion() -> None:
    """Of visits of a pose between them, one or both, whatever their readings are worth."""
    rows = rows_of(0, most=4)
    by = rows.weighed(rows.noise)
    sums = _Sums.of(rows, by, rows.frame)
    m = len(rows.residual)
    for s, t in ((2, m), (POSES, m), (POSES + 7, m), (3, 9), (5, POSES + 8), (11, m - 2)):
        there = (np.arange(m) >= s) & (np.arange(m) < t)
        expected = rows.explained(rows.frame * there[:, None, None], by)
        fall, _, _ = sums.best([(s, t)])
        assert fall == pytest.approx(expected.fall, rel=1e-6)
        assert sums.motion(s, t) == pytest.approx(expected.values, rel=1e-5, abs=1e-8)


def test_a_frame_that_moved_less_than_the_drawing_errs_is_named() -> None:
    """Differences of two visits tell it, though each alone errs by five times as much."""
    found = moved_frame(rows_of(1, moved=1e-4))
    assert found is not None
    assert (found.first, found.end) == (POSES, 2 * POSES)
    assert found.shift == pytest.approx(1e-4, rel=0.3)
    assert float(LikePoses.of(rows_of(1, moved=1e-4)).likelier([found])[0]) > np.log(300)


@pytest.mark.parametrize("seed", range(2, 5))
def test_sound_days_of_pairs_are_not_doubted(seed: int) -> None:
    """What a pose errs by in both its visits is no motion."""
    assert moved_frame(rows_of(seed)) is None
