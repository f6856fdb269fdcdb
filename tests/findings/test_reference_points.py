"""Points on the base beside full poses: a frame that moved is taken back with its orientation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, PLACE, TEST_POSE
from scipy.spatial.transform import Rotation
from small_arm import ROBOT

import edtk
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

BASE = {"P": [900.0, 100.0, 0.0], "Q": [1500.0, 800.0, 10.0], "R": [700.0, -600.0, 30.0]}
STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.02, "rows": "pose", "sigma_deg": 0.005},
    parameters={"geometry": "all"},
    marker=[
        {"name": "A", "position_mm": [90, 10, 50]},
        *({"name": name, "joint": "base"} for name in BASE),
    ],
    test_pose=TEST_POSE,
)
MOVED = transform((2.0, 1.0, 0.0), (0.0, 0.0, 0.02))  # [mm], [rad]
LATE = slice(18, 24)  # visits after somebody kicked the tripod, until it was put back


def test_orientations_are_taken_back_too(tmp_path: Path) -> None:
    """The empty sheet has rows for all points; filled in, the motion is named and does no harm."""
    model = replace(StudyGeometry.of(STUDY).model, start=PLACE)
    rng = np.random.default_rng(0)
    theta = rng.normal(0, 0.7, model.p) * model.scales
    q = rng.uniform(-1.7, 1.7, (30, 6))
    nothing = np.zeros((30, 6))
    table = edtk.template(STUDY, edtk.Plan(q, nothing, np.ones(30, dtype=int)))
    assert len(table) == 30 * 4
    first = table.iloc[::4]
    seen = model.see(theta, np.deg2rad(first[NAMES].to_numpy()), derivatives=False)
    x = np.concatenate([1e3 * seen.points, np.tile([*BASE.values()], (30, 1, 1))], axis=1)
    turns = seen.turns[:, 0].copy()
    x[LATE] = x[LATE] @ MOVED[:3, :3].T + MOVED[:3, 3]
    turns[LATE] = MOVED[:3, :3] @ turns[LATE]
    x += rng.normal(0, 0.003, x.shape)
    table[["x_mm", "y_mm", "z_mm"]] = x.reshape(-1, 3)
    vectors = Rotation.from_matrix(turns).as_rotvec(degrees=True)
    table.loc[::4, ["rx_deg", "ry_deg", "rz_deg"]] = vectors + rng.normal(0, 0.002, vectors.shape)
    table.to_csv(tmp_path / "day.csv", index=False)
    found = edtk.identify(STUDY, tmp_path / "day.csv")
    assert [doubt.kind for doubt in found.findings] == ["frame_moved"]
    assert found.findings[0].rows[0] == 4 * LATE.start + 1
    told = found.to_dict()
    assert told["rank"] == 30
    assert told["loo_rms_mm"] < 0.02
    assert told["turn_loo_rms_deg"] < 0.008


def test_points_on_the_base_have_no_orientation() -> None:
    """The study says so in words, and one that asks for it is refused in one line."""
    assert "3 positions, 1 pose" in repr(STUDY) + STUDY.summary()
    with pytest.raises(edtk.UserError, match=r"marker.1.rows: points on the base have positions"):
        STUDY.replace(marker=[{"name": "A"}, {"name": "P", "joint": "base", "rows": "pose"}])
