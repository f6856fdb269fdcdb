"""Positions that were copied instead of measured: whole sheets, rows, and columns of a marker."""

from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import STUDY, by_pose, truth

import edtk
from edtk.system.errors import UserError


def test_a_sheet_that_was_pasted_twice_is_refused(tmp_path: Path) -> None:
    """Visits of a pose never agree to the last digit of nine coordinates; it may be insisted on."""
    q, x = truth(20)
    sheet = by_pose(tmp_path / "day.csv", np.tile(q, (2, 1)), np.tile(x, (2, 1, 1)).round(4))
    with pytest.raises(
        UserError, match="row 21 is row 1 to the last digit, in all columns, and 19"
    ):
        edtk.identify(STUDY, sheet)
    assert edtk.identify(STUDY, sheet, as_is=True).fit.data.poses == 20


def test_repeats_that_were_measured_are_not_refused(tmp_path: Path) -> None:
    """Readings of another time differ in some digit."""
    q, x = truth(20)
    again = x + np.random.default_rng(1).normal(0, 0.02, x.shape)
    sheet = by_pose(tmp_path / "day.csv", np.tile(q, (2, 1)), np.concatenate([x, again]).round(2))
    assert edtk.identify(STUDY, sheet).verdict == "good"


def test_readings_too_coarse_to_differ_are_not_refused(tmp_path: Path) -> None:
    """An instrument that shows whole millimetres repeats itself."""
    q, x = truth(20)
    sheet = by_pose(tmp_path / "day.csv", np.tile(q, (2, 1)), np.tile(x, (2, 1, 1)).round(0))
    assert edtk.identify(STUDY, sheet).fit.data.poses == 20


def test_a_marker_whose_columns_were_copied_is_named_and_does_not_count(tmp_path: Path) -> None:
    """The fit is that of the others alone."""
    q, x = truth(30)
    x[:, 2] = x[:, 1]
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", q, x))
    (said,) = [one for one in found.findings if one.kind == "equal_markers"]
    assert said.words.startswith("markers B and C are at the same place in all 30 visits")
    assert found.fit.data.markers == ("A", "B")
    assert found.verdict == "usable"
