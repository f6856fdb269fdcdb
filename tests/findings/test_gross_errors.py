"""Visits that are far off: found among sound ones, and named by what explains them."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import STUDY, Array, by_pose, run, truth

import edtk
from edtk.findings.gross_errors import gross_errors, gross_findings
from edtk.findings.sound_rows import rigid_tool
from edtk.fit.marker_positions import MarkerPositions

Edit = Callable[[Array, Array], None]
TURN = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])


def positions(spoil: Edit, poses: int = 30) -> MarkerPositions:
    """Positions of the erring arm, spoilt."""
    q, x = truth(poses)
    spoil(q, x)
    rows = np.repeat(np.arange(poses)[:, None], 3, axis=1)
    return MarkerPositions(np.deg2rad(q), np.zeros((poses, 6)), x / 1e3, rows, tuple("ABC"))


def metres(q: Array, x: Array) -> None:
    x[5:8] /= 1e3


def radians(q: Array, x: Array) -> None:
    q[5:7] = np.deg2rad(q[5:7])


def typed(q: Array, x: Array) -> None:
    q[9, 1] += 25.0


def sign(q: Array, x: Array) -> None:
    x[11, :, 1] *= -1


def shifted(q: Array, x: Array) -> None:
    x[11:] = x[10:-1].copy()


def moved(q: Array, x: Array) -> None:
    x[20:] = x[20:] @ TURN.T + [30.0, 0, 0]


def half_swapped(q: Array, x: Array) -> None:
    x[15:] = x[15:][:, [1, 0, 2]]


def slipped(q: Array, x: Array) -> None:
    x[18:, 2] += (x[18:, 0] - x[18:, 1]) * 0.05


def coordinate_lost(q: Array, x: Array) -> None:
    x[4, 1, 2] = 0.0


@pytest.mark.parametrize(
    ("spoil", "rows", "kind", "said"),
    [
        (metres, range(5, 8), "unit", "rows 6 to 8: positions .*, as if in metres"),
        (radians, range(5, 7), "radians", "rows 6, 7: .* as if angles were in radians"),
        (typed, [9], "typed", r"row 10: .* as if q2 were typed wrongly, by 2[45]\.?\d* deg"),
        (sign, [11], "coordinates", "row 12: .* as if the sign of y turned"),
        (shifted, range(11, 30), "shifted", "rows 12 to 30: .* of the pose before"),
        (moved, range(20, 30), "frame_moved", "rows 21 to 30: .* frame .* had moved"),
        (half_swapped, range(15, 30), "swapped", "rows 16 to 30: markers A and B are swapped"),
        (slipped, range(18, 30), "apart", "rows 19 to 30: marker C is up to"),
        (coordinate_lost, [4], "apart", "row 5: marker B is up to"),
    ],
)
def test_what_explains_a_visit_is_named(spoil: Edit, rows: list[int], kind: str, said: str) -> None:
    """Each fault is one doubt, with all its rows and no others."""
    data = positions(spoil)
    doubts = gross_findings(data, gross_errors(STUDY.robot, data, rigid_tool(data)))
    assert [doubt.kind for doubt in doubts] == [kind]
    assert doubts[0].rows == tuple(rows)
    assert re.search(said, doubts[0].words)


def test_sound_visits_are_left_alone() -> None:
    """An erring robot with noise alone has no doubtful visits."""
    data = positions(lambda q, x: None)
    assert gross_errors(STUDY.robot, data, rigid_tool(data)).visits == []


def test_a_marker_that_stands_still_is_on_the_base(tmp_path: Path) -> None:
    """A point of the base among those of the tool is told by its place, and does not count."""
    q, x = truth(25)
    rest = np.array([700.0, -600, 30]) + np.random.default_rng(1).normal(0, 0.01, (25, 3))
    x[:, 1] = rest
    found = edtk.identify(STUDY, by_pose(tmp_path / "sheet.csv", q, x))
    assert found.fit.data.markers == ("A", "C")
    assert [doubt.kind for doubt in found.findings] == ["standing"]
    assert found.loo_rms_mm < 0.1
    tests = edtk.predict(STUDY, found, tmp_path / "sheet.csv")
    assert tests.data.markers == ("A", "C")


def test_exchanged_columns_are_refused(tmp_path: Path) -> None:
    """Joints in each other's columns end in one line that names them."""
    q, x = truth(8)
    q[:, [1, 2]] = q[:, [2, 1]]
    study = tmp_path / "study.toml"
    STUDY.to_toml(study)
    code, out, err = run("identify", study, by_pose(tmp_path / "sheet.csv", q, x))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "the positions fit if the columns of q2 and q3 are exchanged" in err


def test_a_turned_joint_is_found_beside_wrong_rows(tmp_path: Path) -> None:
    """A few wrong poses do not hide that a joint counts the other way."""
    q, x = truth(30)
    q[:, 1] *= -1
    q[4, 0] += 90
    x[8] = 0.5 * x[8]
    found = edtk.identify(STUDY, by_pose(tmp_path / "sheet.csv", q, x))
    assert found.counting.words == "q2 counts the other way"
    assert found.loo_rms_mm < 0.1
    assert {4, 8} <= {row for doubt in found.findings for row in doubt.rows}


def test_few_visits_tell_a_wrong_one() -> None:
    """Ten visits are enough: nine of them agree, and show which joint was typed wrongly."""
    data = positions(typed, poses=10)
    found = gross_errors(STUDY.robot, data, rigid_tool(data))
    assert [one.visit for one in found.wrong] == [9]
    assert "typed wrongly" in found.wrong[0].words


def test_the_fewest_exchanges_explain_a_swap_on_an_even_triangle() -> None:
    """Where all sides are alike, any order of three explains two that are swapped."""
    rng = np.random.default_rng(0)
    tool = np.array([[0.0, 0, 0], [20, 0, 0], [10, 17.3, 0]]) / 1e3
    turns = np.linalg.qr(rng.standard_normal((12, 3, 3)))[0]
    x = tool @ np.swapaxes(turns, 1, 2) + rng.uniform(-1, 1, (12, 1, 3))
    x = x + rng.normal(0, 2e-5, x.shape)
    x[:, 2] += 2e-3 * turns[:, :, 0]  # sides of 20.0, 20.9 and 19.1 mm
    x[3] = x[3][[1, 0, 2]]
    rows = np.repeat(np.arange(12)[:, None], 3, axis=1)
    data = MarkerPositions(np.zeros((12, 6)), np.zeros((12, 6)), x, rows, tuple("ABC"))
    assert rigid_tool(data).swapped == ((3, ("A", "B")),)


def test_a_frame_that_moved_far_is_named_and_not_the_robot(tmp_path: Path) -> None:
    """A motion too small for a gross error and too large for any fit is what is said."""
    q, x = truth(24)
    q[:, 1] += 5.0  # the drawing alone is far off, the fit is not
    x[10:] += [25.0, 0, 0]
    found = edtk.identify(STUDY, by_pose(tmp_path / "sheet.csv", q, x))
    assert found.verdict == "bad"
    named = [doubt for doubt in found.findings if doubt.kind == "frame_moved"]
    assert named
    assert named[0].rows == (10,)


@pytest.mark.parametrize(("row", "turned"), [(5, [2, 4]), (9, [1])])
def test_turned_joints_are_found_beside_a_false_coordinate(
    tmp_path: Path, row: int, turned: list[int]
) -> None:
    """Distances between markers show a false coordinate before anything of the robot is known."""
    q, x = truth(12)
    q[:, turned] *= -1
    x[row, 1, 2] *= -1
    found = edtk.identify(STUDY, by_pose(tmp_path / "sheet.csv", q, x))
    names = ", ".join(f"q{j + 1}" for j in turned)
    assert found.counting.words.startswith(f"{names} count")
    assert found.loo_rms_mm < 0.1
    assert (row,) in [one.rows for one in found.findings if one.kind == "apart"]
