"""`edtk controller`: what is printed, and what is refused."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import edtk
from edtk.cli import main
from edtk.robots.robot_file import robot_from_dict, robot_to_dict
from edtk.study.study_toml import toml_text

JOINTS = (
    ([0, 0, 0.4], [0, 0, 1]),
    ([0.1, 0, 0], [0, 1, 0]),
    ([0, 0, 0.7], [0, 1, 0]),
)
ROBOT = {
    "name": "arm",
    "source": "made up",
    "joints": [
        {"name": f"q{i + 1}", "origin_m": origin, "axis": axis, "limits_deg": [-170, 170]}
        for i, (origin, axis) in enumerate(JOINTS)
    ],
}
TABLE = {"sign": {"q3": -1}, "zero_deg": {"q2": -90}}


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A robot's file, and positions of two markers."""
    robot = robot_from_dict(ROBOT | {"controller": TABLE})
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (6, 3))
    shown = np.rad2deg(robot.shown(q)).round(4)
    T = robot.forward(robot.of_shown(np.deg2rad(shown)))
    lines = ["q1_deg,q2_deg,q3_deg,x_mm,y_mm,z_mm,marker"]
    for name, offset in (("A", [0.1, 0.2, 0.6]), ("B", [-0.1, 0, 0.7])):
        points = 1e3 * (T[:, :3, :3] @ offset + T[:, :3, 3])
        lines += [
            ",".join(map(str, (*c, *p.round(3), name))) for c, p in zip(shown, points, strict=True)
        ]
    (tmp_path / "arm.toml").write_text(toml_text(robot_to_dict(robot_from_dict(ROBOT))))
    (tmp_path / "positions.csv").write_text("\n".join(lines))
    return tmp_path / "arm.toml", tmp_path / "positions.csv"


def run(*words: object) -> tuple[int, str, str]:
    """Exit code and output of the program."""
    result = CliRunner().invoke(main, ["controller", *map(str, words)])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.slow
def test_a_table_to_paste(files: tuple[Path, Path]) -> None:
    """The text ends with a table that a study takes; JSON is that of the call."""
    code, shown, error = run(*files)
    assert (code, error) == (0, "")
    assert "the answer is clear" in shown
    assert shown.rstrip().endswith("[controller]\nsign = { q3 = -1 }\nzero_deg = { q2 = -90.0 }")
    out = files[0].parent / "controller.toml"
    code, shown, _ = run(*files, "--json", "--out", out)
    assert code == 0
    assert json.loads(shown)["controller"] == TABLE
    assert tomllib.loads(out.read_text()) == {"controller": TABLE}
    assert edtk.new(files[0], out.parent / "study.toml", controller=out).robot.controller


@pytest.mark.slow
def test_a_false_coordinate_is_named_and_left_out(files: tuple[Path, Path]) -> None:
    """One coordinate of one of three markers has the other sign: its row is named, and all fits."""
    robot, positions = files
    rows = pd.read_csv(positions)
    between = rows[rows.marker == "A"].assign(marker="C")
    places = ["x_mm", "y_mm", "z_mm"]
    between[places] = (between[places] + rows[rows.marker == "B"][places].values) / 2
    rows = pd.concat([rows, between], ignore_index=True)
    rows.loc[8, "x_mm"] *= -1
    rows.to_csv(positions, index=False)
    code, shown, error = run(robot, positions)
    assert code == 0
    assert "the answer is clear" in shown
    assert error.startswith(f"edtk: {positions}: row 9: marker B is up to")
    assert error.count("\n") == 1


@pytest.mark.slow
def test_the_sheet_of_a_calibration_is_taken(files: tuple[Path, Path]) -> None:
    """A row a pose, with columns for each marker and those of loads, gives the same table as a row
    a marker. Empty cells and zeros are positions that nobody measured.
    """
    robot, positions = files
    long = pd.read_csv(positions)
    joints = ["q1_deg", "q2_deg", "q3_deg"]
    wide = long.pivot_table(index=joints, columns="marker", values=["x_mm", "y_mm", "z_mm"])
    wide.columns = [f"{marker}{column}" for column, marker in wide.columns]
    wide = wide.reset_index()
    wide.insert(0, "pose", range(1, len(wide) + 1))
    wide["Fz_N"] = 0.0
    wide["visit"] = 1
    lost = wide.iloc[:2].copy()
    lost[["q1_deg", "q2_deg"]] += 7.0
    lost.iloc[0, 4:10] = np.nan
    lost.iloc[1, 4:10] = 0.0
    _, expected, _ = run(robot, positions)
    pd.concat([wide, lost]).to_csv(positions, index=False)
    assert run(robot, positions) == (0, expected, "")


def test_a_sheet_without_positions(files: tuple[Path, Path]) -> None:
    """Nothing but lost beams is one line."""
    robot, positions = files
    sheet = pd.read_csv(positions)
    sheet[["x_mm", "y_mm", "z_mm"]] = 0.0
    sheet.to_csv(positions, index=False)
    code, shown, error = run(robot, positions)
    assert (code, shown) == (2, "")
    assert "positions.csv: no position of a marker is filled in, or all are zero" in error


def test_a_sheet_of_displacements(files: tuple[Path, Path]) -> None:
    """How far loads move the arm says nothing of how joints are counted."""
    robot, positions = files
    sheet = pd.read_csv(positions)
    sheet.columns = sheet.columns.str.replace(r"^([xyz]_mm)", r"d\1", regex=True)
    sheet[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]] = [0, 0, -100, 0, 0, 0]
    sheet.to_csv(positions, index=False)
    code, shown, error = run(robot, positions)
    assert (code, shown) == (2, "")
    assert "positions.csv: has displacements alone; expected positions, x_mm y_mm z_mm" in error


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("x_mm", "x_m", "unknown column 'x_m', perhaps 'x_mm'; expected q1_deg"),
        (",z_mm", ",Fx_N", "column 'z_mm' is missing; expected x_mm, y_mm, z_mm"),
        ("q1_deg", "q4_deg", "unknown column 'q4_deg'"),
    ],
)
def test_what_is_wrong_with_the_file(
    files: tuple[Path, Path], old: str, new: str, message: str
) -> None:
    """One line that names the column, and exit code 2."""
    robot, positions = files
    positions.write_text(positions.read_text().replace(old, new, 1))
    code, shown, error = run(robot, positions)
    assert (code, shown) == (2, "")
    assert message in error
    assert error.count("\n") == 1


def test_too_few_rows_are_refused(files: tuple[Path, Path]) -> None:
    """The message counts what there is and what is looked for."""
    robot, positions = files
    positions.write_text("\n".join(positions.read_text().splitlines()[:3]))
    code, _, error = run(robot, positions)
    assert code == 2
    assert "positions.csv: 6 coordinates are too few for the instrument" in error


@pytest.mark.slow
def test_metres_are_suspected(files: tuple[Path, Path]) -> None:
    """Positions that no way to count explains are said to be far off."""
    robot, positions = files
    lines = positions.read_text().splitlines()
    rng = np.random.default_rng(1)
    changed = [
        ",".join([*line.split(",")[:3], *rng.uniform(0, 900, 3).round(1).astype(str), "A"])
        for line in lines[1:]
    ]
    positions.write_text("\n".join([lines[0], *changed]))
    code, _, error = run(robot, positions)
    assert code == 0
    assert "is it this robot, are positions in millimetres" in error
