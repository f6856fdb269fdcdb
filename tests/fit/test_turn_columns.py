"""Sheets of full poses: position and orientation of a tool, as vectors or quaternions."""

import json
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, Array, run
from scipy.spatial.transform import Rotation

import edtk
from edtk.study.study_geometry import StudyGeometry

FULL = STUDY.replace(
    measurement={"sigma_mm": 0.02, "rows": "pose", "sigma_deg": 0.005}, marker=[{"name": "A"}]
)
POSITION = ["Ax_mm", "Ay_mm", "Az_mm"]
VECTOR = ["Arx_deg", "Ary_deg", "Arz_deg"]
QUATERNION = ["Aqw", "Aqx", "Aqy", "Aqz"]


def measured(poses: int, seed: int = 0) -> tuple[Array, Array, Rotation]:
    """Joint angles [deg], positions (m, 3) [mm] and orientations of an erring arm's tool."""
    from dataclasses import replace

    rng = np.random.default_rng(seed)
    model = StudyGeometry.of(FULL).model
    model = replace(model, offsets=OFFSETS[:1], start=PLACE)
    theta = np.random.default_rng(5).normal(0, 0.7, model.p) * model.scales
    q = np.round(rng.uniform(-100, 100, (poses, 6)), 3)
    seen = model.see(theta, np.deg2rad(q), derivatives=False)
    x = 1e3 * seen.points[:, 0] + rng.normal(0, 0.02, (poses, 3))
    noise = Rotation.from_rotvec(rng.normal(0, 0.005, (poses, 3)), degrees=True)
    return q, x, noise * Rotation.from_matrix(seen.turns[:, 0])


def sheet(path: Path, header: list[str], *columns: Array) -> Path:
    """Write columns under a header."""
    cells = np.hstack(columns)
    np.savetxt(path, cells, delimiter=",", header=",".join(header), comments="", fmt="%.9g")
    return path


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The study as a file."""
    path = tmp_path / "study.toml"
    FULL.to_toml(path)
    return path


@pytest.mark.slow
def test_vectors_and_quaternions_tell_the_same(study: Path, tmp_path: Path) -> None:
    """Thirty parameters of a 6R arm, whichever way an orientation is written."""
    q, x, turns = measured(40)
    vectors = sheet(
        tmp_path / "v.csv", [*NAMES, *POSITION, *VECTOR], q, x, turns.as_rotvec(degrees=True)
    )
    wxyz = np.roll(turns.as_quat(), 1, axis=1)
    quaternions = sheet(
        tmp_path / "q.csv", [*NAMES, *POSITION, *QUATERNION], q[:20], x[:20], wxyz[:20]
    )
    code, out, err = run("identify", study, quaternions, "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    assert "30 parameters can be told apart" in out
    assert "orientations: 0.0" in out
    result = json.loads((tmp_path / "out/k.json").read_text())
    assert (result["rank"], result["verdict"]) == (30, "good")
    assert result["turn_loo_rms_deg"] == pytest.approx(0.011, rel=0.4)
    assert "Orientations were 0.0" in (tmp_path / "out/report.html").read_text()
    header = (tmp_path / "out/residuals.csv").read_text().splitlines()[0]
    assert header.endswith("left_out_rx_deg,left_out_ry_deg,left_out_rz_deg")
    code, out, err = run("predict", study, tmp_path / "out/k.json", vectors, "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["rms_mm"] < 0.1
    assert told["turn_rms_deg"] < 0.02
    first = Rotation.from_rotvec(
        [told["positions"][0][f"r{axis}_deg"] for axis in "xyz"], degrees=True
    )
    assert (first * turns[0].inv()).magnitude() < np.deg2rad(0.03)
    plain = sheet(tmp_path / "poses.csv", NAMES, q[:3])
    assert len(edtk.predict(FULL, result, plain).to_dict()["positions"]) == 3


@pytest.mark.parametrize(
    ("header", "last", "said"),
    [
        ([*NAMES, *POSITION], None, "no orientation of A; expected Arx_deg, Ary_deg, Arz_deg"),
        ([*NAMES, *POSITION, *QUATERNION], 0.5, "row 1: a quaternion of length 1.1"),
    ],
)
def test_wrong_orientations_are_refused(
    study: Path, tmp_path: Path, header: list[str], last: float | None, said: str
) -> None:
    """A sheet without them, or with other numbers, is one line."""
    q, x, _ = measured(8)
    columns = [q, x]
    if last is not None:
        columns.append(np.tile([1.0, 0, 0, last], (8, 1)))
    code, out, err = run("identify", study, sheet(tmp_path / "day.csv", header, *columns))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err


@pytest.mark.slow
def test_rows_of_a_marker_each_may_have_orientations(tmp_path: Path) -> None:
    """In a sheet with a marker a row, orientations have no name before them."""
    q, x, turns = measured(20)
    header = [*NAMES, "x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"]
    path = sheet(tmp_path / "day.csv", header, q, x, turns.as_rotvec(degrees=True))
    found = edtk.identify(FULL, path)
    assert found.rank == 30
    text = path.read_text().splitlines()
    text[4] = ",".join([*text[4].split(",")[:-3], "", "", ""])
    path.write_text("\n".join(text))
    with pytest.raises(edtk.UserError, match="row 4: a position without an orientation"):
        edtk.identify(FULL, path)


@pytest.mark.slow
def test_orientations_written_in_another_way_are_an_alarm(tmp_path: Path) -> None:
    """Radians that are taken for degrees leave orientations that no tool has; so few poses leave
    next to nothing to tell variances from, which was a traceback.
    """
    q, x, turns = measured(7)
    path = sheet(tmp_path / "day.csv", [*NAMES, *POSITION, *VECTOR], q, x, turns.as_rotvec())
    found = edtk.identify(FULL, path, as_is=True)
    assert found.verdict == "bad"
    assert found.findings[0].kind == "rough_turns"
