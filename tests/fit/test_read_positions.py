"""Dialects of sheets of positions: what is read, passed over with a note, and refused."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import STUDY, by_marker, by_pose, run, truth

import edtk
from edtk.fit.marker_positions import read_positions


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The study as a file."""
    path = tmp_path / "study.toml"
    STUDY.to_toml(path)
    return path


@pytest.mark.slow
def test_what_nothing_is_known_of_is_passed_over_with_a_note(study: Path, tmp_path: Path) -> None:
    """Points and times of the instrument's own, and empty cells, leave the estimate as it is."""
    q, x = truth(20)
    plain = edtk.identify(study, by_pose(tmp_path / "plain.csv", q, x))
    text = (tmp_path / "plain.csv").read_text().splitlines()
    more = [f"{line},12:0{i % 10},1,2,3" for i, line in enumerate(text[1:])]
    head = f"{text[0]},time,Dx_mm,Dy_mm,Dz_mm"
    sheet = tmp_path / "more.csv"
    sheet.write_text("\n".join([head, *more]))
    code, out, err = run("identify", study, sheet, "--json")
    assert code == 0
    assert err.count("\n") == 1
    assert "positions of D not used, as the study has no such marker; a [[marker]] with name" in err
    assert "column time not used" in err
    assert json.loads(out)["loo_rms_mm"] == plain.loo_rms_mm
    x[[3, 8], 1] = np.nan
    by_pose(sheet, q, x)
    sheet.write_text(sheet.read_text().replace("nan", ""))
    blank = edtk.identify(study, sheet)
    assert [doubt.words for doubt in blank.findings] == ["rows 4, 9: no position of B"]
    assert blank.fit.data.count == 58
    sheet.write_text(sheet.read_text().replace(",,,", f",{x[0, 0, 0]},,", 1))
    assert "row 4, column By_mm" in run("identify", study, sheet)[2]


@pytest.mark.slow
def test_rows_of_other_markers_are_passed_over(study: Path, tmp_path: Path) -> None:
    """A sheet with a marker a row may have some that the study lacks, but not these alone."""
    q, x = truth(20)
    sheet = by_marker(tmp_path / "sheet.csv", q, x)
    lines = sheet.read_text().splitlines()
    lines.insert(2, lines[1].replace(",A,", ",D,"))
    sheet.write_text("\n".join(lines))
    with pytest.warns(UserWarning, match="positions of D not used"):
        found = edtk.identify(study, sheet)
    assert found.fit.data.row[0].tolist() == [0, 2, 3]
    sheet.write_text("\n".join(line.replace(",A,", ",D,") for line in lines[:2]))
    code, _, err = run("identify", study, sheet)
    assert (code, "no marker 'D' in the study; expected one of A, B, C" in err) == (2, True)
    wide = by_pose(tmp_path / "wide.csv", q, x)
    wide.write_text(wide.read_text().translate(str.maketrans("ABC", "DEF")))
    code, _, err = run("identify", study, wide)
    assert (code, "positions of D, E, F, and the study's markers are A, B, C" in err) == (2, True)


@pytest.mark.parametrize("column", ["Fz", "q1_dge", "sigma_mm"])
def test_columns_that_may_matter_are_refused(study: Path, tmp_path: Path, column: str) -> None:
    """What may be a load, a misspelt joint or a size of errors is no column to pass over."""
    q, x = truth(8)
    sheet = by_pose(tmp_path / "sheet.csv", q, x)
    text = sheet.read_text()
    head, _, rest = text.partition("\n")
    if column.startswith("q"):
        sheet.write_text(head.replace("q1_deg", column) + "\n" + rest)
    else:
        sheet.write_text("\n".join([f"{head},{column}", *(f"{r},1" for r in rest.split())]))
    code, out, err = run("identify", study, sheet)
    assert (code, out) == (2, "")
    assert f"unknown column '{column}'" in err


def distances(**columns: list[float | None]) -> pd.DataFrame:
    """Two visits of the wire in two poses, the second under a load."""
    q = {f"q{i}_deg": [10.0 * i, 20.0 + i] for i in range(1, 7)}
    return pd.DataFrame({**q, "Fz_N": [0.0, -2500.0], "marker": ["wire", "wire"], **columns})


def test_absolute_distances_count_beside_those_before_and_after_a_load() -> None:
    """Each row is read by the columns that it fills in."""
    robot = edtk.load_robot("kuka_kr270")
    sheet = distances(distance_mm=[2500.0, None], before_mm=[None, 1800.0], after_mm=[None, 1801.5])
    data = read_positions(sheet, robot, {}, {"wire": "distance"})
    assert data.is_difference.tolist() == [False, True]
    np.testing.assert_allclose(data.measured[:, 0, 0], [2.5, 1.5e-3], rtol=1e-12)


def test_two_distances_in_one_row_are_refused() -> None:
    """Which of them counts nobody knows."""
    robot = edtk.load_robot("kuka_kr270")
    sheet = distances(
        distance_mm=[2500.0, 1801.0], before_mm=[None, 1800.0], after_mm=[None, 1801.5]
    )
    with pytest.raises(edtk.UserError, match="row 2: two readings, columns 'after_mm' and 'dist"):
        read_positions(sheet, robot, {}, {"wire": "distance"})


def test_a_length_that_changes_too_much_is_said_with_its_columns() -> None:
    """Those that were read, and by how much."""
    robot = edtk.load_robot("kuka_kr270")
    sheet = distances(distance_mm=[2500.0, None], before_mm=[None, 1800.0], after_mm=[None, 2801.5])
    said = r"row 2, columns before_mm, after_mm.* moved by 1002 mm under load"
    with pytest.raises(edtk.UserError, match=said):
        read_positions(sheet, robot, {}, {"wire": "distance"})
