"""A joint whose zero changes in the course of a day is named, with the row and by how much."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY, by_pose

import edtk
from edtk.findings.finding import Finding, Severity
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

POSES = 30
GEARS = 5e-5  # [rad] of each joint in each pose


def said_of(path: Path, joint: int, first: int, degrees: float, seed: int = 0) -> list[Finding]:
    """What is said of a day in which a joint slips at a pose."""
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(STUDY)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    q = rng.uniform(-1.7, 1.7, (POSES, 6))
    slip = np.deg2rad(degrees) * (np.arange(POSES) >= first)
    there = q + slip[:, None] * np.eye(6)[joint] + rng.normal(0, GEARS, q.shape)
    x = model.see(theta, there, derivatives=False).points + rng.normal(0, 2e-5, (POSES, 3, 3))
    sheet = by_pose(path / "day.csv", np.rad2deg(q), 1e3 * x)
    return list(edtk.identify(STUDY, sheet).findings)


@pytest.mark.parametrize(("joint", "first", "degrees"), [(1, 11, 0.1), (3, 17, -0.3)])
def test_a_joint_that_slips_is_named(
    joint: int, first: int, degrees: float, tmp_path: Path
) -> None:
    """With its row and its size, as an alarm: the fit is of neither part of the day."""
    said = said_of(tmp_path, joint, first, degrees)
    (slipped,) = (one for one in said if one.kind == "joint_slipped")
    assert slipped.severity is Severity.ALARM
    assert slipped.rows == (first,)
    assert slipped.data["joint"] == f"q{joint + 1}"
    assert slipped.data["size"] == pytest.approx(degrees, rel=0.1)
    assert not {"frame_moved", "drift", "growth"} & {one.kind for one in said}
    assert f"row {first + 1}: from here on joint q{joint + 1} is" in slipped.words


def test_what_looks_the_same_is_said(tmp_path: Path) -> None:
    """Of the first joint a base that turned, of the last one a tool."""
    for joint, other in ((0, "a base or a frame that turned"), (5, "a tool that turned")):
        said = said_of(tmp_path, joint, 15, 0.3)
        (slipped,) = (one for one in said if one.kind == "joint_slipped")
        assert f"; {other} about its axis looks the same" in slipped.words


def test_a_sound_day_has_no_joint_that_slipped(tmp_path: Path) -> None:
    """Nor one whose joint slips by less than its gears err."""
    for degrees in (0.0, 5e-4):
        said = said_of(tmp_path, 2, 14, degrees, 0)
        assert "joint_slipped" not in {one.kind for one in said}


def test_a_joint_that_slips_by_far_is_named_for_the_rows_that_do_not_count(tmp_path: Path) -> None:
    """By 6 deg: no pose of its own explains these rows, and one joint explains all of them."""
    said = said_of(tmp_path, 1, 20, 6.0)
    (slipped,) = (one for one in said if one.kind == "joint_slipped")
    assert slipped.severity is Severity.ALARM
    assert slipped.rows == tuple(range(20, POSES))
    assert "as if the zero of q2 had slipped by" in slipped.words


TURNS = {"axis": [0, 0, 1], "limits_deg": [-130, 130]}
SCARA = Study(
    robot={
        "name": "a SCARA",
        "source": "tests",
        "joints": [
            TURNS | {"name": "q1", "origin_m": [0, 0, 0.4]},
            TURNS | {"name": "q2", "origin_m": [0.45, 0, 0.05]},
            {
                "name": "q3",
                "kind": "prismatic",
                "axis": [0, 0, 1],
                "origin_m": [0.35, 0, 0.1],
                "limits_m": [-0.35, 0.05],
            },
            TURNS | {"name": "q4", "origin_m": [0, 0, -0.1]},
        ],
    },
    parameters={"geometry": "all", "base": True, "tool": True},
    measurement={"sigma_mm": 0.02},
    marker=[
        {"name": "A", "position_mm": [160, 20, -60]},
        {"name": "B", "position_mm": [30, 80, -70]},
        {"name": "C", "position_mm": [80, -50, -30]},
    ],
)


def test_a_slip_so_large_that_arcs_are_no_tangents_is_named(tmp_path: Path) -> None:
    """By 3 deg at a lever of 0.4 m; chords are shorter than arcs, which looks like a scale."""
    rng = np.random.default_rng(6)
    model = StudyGeometry.of(SCARA).model
    low, high = SCARA.robot.limits
    q = rng.uniform(low, high, (36, 4))
    slip = np.deg2rad(3.0) * (np.arange(36) >= 18)
    theta = rng.normal(0, 0.3, model.p) * model.scales
    x = model.see(theta, q + slip[:, None] * np.eye(4)[1], derivatives=False).points
    x = 1e3 * x + rng.normal(0, 0.02, x.shape)
    units = np.array([*np.rad2deg([1.0, 1.0]), 1e3, np.rad2deg(1.0)])
    names = [f"{marker}{axis}_mm" for marker in model.markers for axis in "xyz"]
    columns = ["q1_deg", "q2_deg", "q3_mm", "q4_deg", *names]
    sheet = pd.DataFrame(np.hstack([units * q, x.reshape(36, -1)]), columns=columns)
    sheet.to_csv(tmp_path / "day.csv", index=False)
    found = edtk.identify(SCARA, tmp_path / "day.csv")
    (slipped,) = (one for one in found.findings if one.kind == "joint_slipped")
    assert (slipped.rows, slipped.data["joint"]) == ((18,), "q2")
    assert slipped.data["size"] == pytest.approx(3.0, rel=0.01)
    assert found.verdict == "bad"
