"""Orientations in other units or conventions are named in one line, each time."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, Array, run
from scipy.spatial.transform import Rotation

from edtk.findings.turn_reading import turn_reading
from edtk.fit.marker_positions import read_positions
from edtk.study.study_geometry import StudyGeometry

FULL = STUDY.replace(
    measurement={"sigma_mm": 0.02, "rows": "pose", "sigma_deg": 0.005}, marker=[{"name": "A"}]
)
POSITION = ["Ax_mm", "Ay_mm", "Az_mm"]
VECTOR = ["Arx_deg", "Ary_deg", "Arz_deg"]
QUATERNION = ["Aqw", "Aqx", "Aqy", "Aqz"]
FORMS: dict[str, Callable[[Rotation], Array]] = {
    "": lambda turns: turns.as_rotvec(degrees=True),
    "rotation vectors in radians": lambda turns: turns.as_rotvec(),
    "rotation vectors that were multiplied by 57.3 once too often": lambda turns: np.rad2deg(
        turns.as_rotvec(degrees=True)
    ),
    "angles about fixed axes x, y, z (roll, pitch, yaw) in degrees": lambda turns: turns.as_euler(
        "xyz", degrees=True
    ),
    "angles about moving axes x, y, z in radians": lambda turns: turns.as_euler("XYZ"),
    "quaternions with the scalar last": lambda turns: turns.as_quat(),
    "those of the instrument, seen from the marker": lambda turns: turns.inv().as_rotvec(True),
}


def day(
    poses: int, seed: int, form: Callable[[Rotation], Array], path: Path, size: float = 100
) -> Path:
    """A sheet of an erring arm, of which one row has a wrong orientation."""
    rng = np.random.default_rng(seed)
    model = replace(StudyGeometry.of(FULL).model, offsets=OFFSETS[:1], start=PLACE)
    theta = rng.normal(0, 0.7, model.p) * model.scales
    q = np.round(rng.uniform(-50, 50, 6) + rng.uniform(-size, size, (poses, 6)) / 2, 3)
    seen = model.see(theta, np.deg2rad(q), derivatives=False)
    turns = Rotation.from_matrix(seen.turns[:, 0])
    turned = np.zeros((poses, 3))
    turned[poses // 2] = [0.3, 0.0, 0.9]
    noisy = Rotation.from_rotvec(turned + rng.normal(0, 1e-4, (poses, 3))) * turns
    values = form(noisy)
    header = [*NAMES, *POSITION, *(VECTOR if values.shape[1] == 3 else QUATERNION)]
    cells = np.hstack([q, 1e3 * seen.points[:, 0], values])
    np.savetxt(path, cells, delimiter=",", header=",".join(header), comments="", fmt="%.9g")
    return path


def read(path: Path, joints: float = 1.0) -> str:
    """What is said of a sheet, whose joint angles are multiplied by something."""
    data = read_positions(path, FULL.robot, {}, {"A": "pose"})
    return turn_reading(path, FULL.robot, replace(data, q=joints * data.q))


@pytest.mark.parametrize("said", FORMS)
@pytest.mark.parametrize("poses", [5, 30])
def test_each_form_is_named(said: str, poses: int, tmp_path: Path) -> None:
    """Whatever the number of poses; radians of the joints are named beside it."""
    for seed in range(3):
        path = day(poses, seed, FORMS[said], tmp_path / "day.csv")
        words = f"orientations of A are taken as {said}" if said else ""
        assert read(path) == words
        both = " and ".join(filter(None, ["joint angles are taken as radians", words]))
        assert read(path, np.pi / 180) == both


@pytest.mark.parametrize("size", [0.5, 2.0, 10.0])
def test_small_motions_are_no_radians(size: float, tmp_path: Path) -> None:
    """Poses that hardly turn the tool are read as they are."""
    for seed in range(3):
        assert read(day(12, seed, FORMS[""], tmp_path / "day.csv", size)) == ""


def test_commands_refuse_them_in_one_line(tmp_path: Path) -> None:
    """`identify` and `predict` say what is expected."""
    FULL.to_toml(tmp_path / "study.toml")
    sound = day(12, 0, FORMS[""], tmp_path / "sound.csv")
    wrong = day(12, 0, FORMS["rotation vectors in radians"], tmp_path / "day.csv")
    assert run("identify", tmp_path / "study.toml", sound, "--out", tmp_path / "out")[0] == 0
    for words in (
        ("identify", tmp_path / "study.toml", wrong),
        ("predict", tmp_path / "study.toml", tmp_path / "out/k.json", wrong),
    ):
        code, out, err = run(*words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert "the robot fits if orientations of A are taken as rotation vectors in rad" in err
        assert "expected degrees everywhere" in err
