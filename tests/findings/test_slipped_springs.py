"""Positions counted from the rigid robot tell a joint that slips, where springs alone are asked."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from small_arm import ROBOT

import edtk
from edtk.calibration.spring_calibration import SpringCalibration

POSES = 16
FORCE = [300.0, -200.0, -800.0]
K = np.array([4e-6, 8e-6, 3e-5])
STUDY = edtk.Study(
    robot=ROBOT
    | {"joints": [{**one, "mass_kg": 8, "center_m": [0.02, 0, 0.05]} for one in ROBOT["joints"]]},
    tool={"position_mm": [90, 20, 100]},
    load={"F_N": FORCE},
    joints={"unknown": ["q2", "q3", "q5"]},
    measurement={"sigma_mm": 0.02, "reference": "nominal"},
)
COLUMNS = [f"q{i}_deg" for i in range(1, 7)]


def identified(
    path: Path, joint: int, first: int, degrees: float, seed: int = 0, times: int = 1
) -> SpringCalibration:
    """What is found of a day in which a joint slips at a pose, and each is read so many times."""
    rng = np.random.default_rng(seed)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (POSES, 6)), 3))
    there = q + np.deg2rad(degrees) * np.outer(np.arange(POSES) >= first, np.eye(6)[joint])
    q, there = (np.repeat(one, times, axis=0) for one in (q, there))
    wrench = np.tile([*FORCE, 0.0, 0.0, 0.0], (len(q), 1))
    model, robot = STUDY.model, STUDY.model.robot
    moved = (robot.forward(there) - robot.forward(q))[:, :3, 3]
    seen = 1e3 * (model.regressor(there, wrench) @ K + moved) + rng.normal(0, 0.02, (len(q), 3))
    sheet = pd.DataFrame(
        np.hstack([np.rad2deg(q), seen]), columns=[*COLUMNS, "dx_mm", "dy_mm", "dz_mm"]
    )
    sheet.to_csv(path / "day.csv", index=False)
    found = edtk.identify(STUDY, path / "day.csv", linear=True)
    assert isinstance(found, SpringCalibration)
    return found


@pytest.mark.parametrize(
    ("joint", "first", "degrees"), [(0, 8, 0.3), (1, 5, 0.3), (2, 9, -0.2), (5, 8, 1.0)]
)
def test_a_joint_that_slips_is_named(
    joint: int, first: int, degrees: float, tmp_path: Path
) -> None:
    """With its first row and its size; such a sheet is bad."""
    found = identified(tmp_path, joint, first, degrees)
    cause = found.causes[0]
    assert (cause.cause, cause.joint) == ("joint_slipped", f"q{joint + 1}")
    assert cause.rows == tuple(range(first, POSES))
    assert cause.size == pytest.approx(degrees, rel=0.02)
    assert found.verdict == "bad"
    side = "further than" if degrees > 0 else "short of"
    assert f"q{joint + 1} looks slipped: from row {first + 1} on it is" in found.findings[0].words
    assert f"deg {side} what is written" in found.findings[0].words


def test_a_last_pose_that_is_off_is_no_slip(tmp_path: Path) -> None:
    """Read twice, it is two rows and one pose."""
    found = identified(tmp_path, 1, POSES - 1, 0.5, times=2)
    assert found.verdict == "bad"
    assert all(one.cause != "joint_slipped" for one in found.causes)


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_day_has_no_joint_that_slipped(seed: int, tmp_path: Path) -> None:
    """Nor one whose joint slips by less than is seen."""
    for degrees in (0.0, 2e-4):
        found = identified(tmp_path, 1, 7, degrees, seed)
        assert found.verdict == "good"
        assert not found.causes
