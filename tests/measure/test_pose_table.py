"""The table that files of plans and of measurements share."""

import numpy as np
import pytest

from edtk.measure.pose_table import (
    WRENCH_COLUMNS,
    PoseFileError,
    PoseTable,
    pose_columns,
    pose_factors,
)
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

MIXED = Robot(
    "mixed",
    (
        Joint("turn", transform(), np.array([0, 0, 1]), (-3, 3)),
        Joint("slide", transform(), np.array([1, 0, 0]), (0, 2), "prismatic"),
    ),
)


@pytest.fixture
def read(tmp_path):
    def from_text(text):
        path = tmp_path / "table.csv"
        path.write_text(text, encoding="utf-8")
        return PoseTable.read(path, "list")

    return from_text


def test_units(read):
    """Degrees and millimetres become radians and metres; joints left out have fixed values."""
    assert pose_columns(MIXED) == ("turn_deg", "slide_mm")
    np.testing.assert_array_equal(pose_factors(MIXED), [np.pi / 180, 1e-3])
    np.testing.assert_allclose(
        read("turn_deg,slide_mm\n180,250\n").poses(MIXED, {}), [[np.pi, 0.25]]
    )
    np.testing.assert_allclose(read("slide_mm\n250\n").poses(MIXED, {0: 1.5}), [[1.5, 0.25]])


def test_wrenches(read):
    """A column overrides its component of the default; without a default forces are required."""
    table = read("Fx_N,Tz_Nm\n1,2\n3,4\n")
    np.testing.assert_array_equal(
        table.wrenches(np.full(6, 9.0)), [[1, 9, 9, 9, 9, 2], [3, 9, 9, 9, 9, 4]]
    )
    with pytest.raises(PoseFileError, match="'Fy_N' is missing"):
        table.wrenches(None)


def test_columns_that_nobody_knows(read):
    """A column that is no joint's, no wrench's and not optional is named, with those that are."""
    table = read("turn_deg,colour\n1,2\n")
    table.with_known(MIXED, ("colour",))
    with pytest.raises(
        PoseFileError, match=f"unknown column 'colour'; expected turn_deg.*{WRENCH_COLUMNS[0]}"
    ):
        table.with_known(MIXED, ())
    with pytest.raises(PoseFileError, match="unknown column 'tur_deg', perhaps 'turn_deg'; exp"):
        read("tur_deg,colour\n1,2\n").with_known(MIXED, ("colour",))


@pytest.mark.parametrize(
    ("cell", "shown"), [("", "empty or NaN"), ("x", "'x'"), ("True", "'True'"), ("inf", "'inf'")]
)
def test_cells_that_are_no_numbers(read, cell, shown):
    """Row, column and content of the first such cell are named, whatever else the column holds."""
    with pytest.raises(PoseFileError, match=f"table.csv: row 2, column a: .*{shown}"):
        read(f"a,b\n1,0\n{cell},0\n2,0\n").numbers("a")
    with pytest.raises(PoseFileError, match=f"row 1, column a: .*{shown}"):
        read(f"a,b\n{cell},0\n").numbers("a")


def test_no_rows(read):
    """A header alone is named by what the file was to hold."""
    with pytest.raises(PoseFileError, match="the list has no rows"):
        read("a,b\n")
