"""A scale of the instrument, by which all lengths come out longer together, and what is assumed."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from gantry import ROBOT
from geometry_sheets import OFFSETS, PLACE, STUDY, by_pose

import edtk
from edtk.robots.robot_file import robot_to_dict
from edtk.study.study_geometry import StudyGeometry

# Where the markers are on the tool was measured to five micrometres: lengths of 0.2 m.
KNOWN = STUDY.replace(
    marker=[
        {"name": name, "position_mm": (1e3 * place).tolist()}
        for name, place in zip("ABC", OFFSETS, strict=True)
    ],
    prior={"parameters": {"tool": {"std_mm": 0.005}}},
)


def identified(
    path: Path, seed: int, scale: float, study: edtk.Study = STUDY, built_mm: float = 0.05
) -> edtk.GeometricCalibration:
    """A day of an arm that is built to tenths of a millimetre, by an instrument of some scale."""
    rng = np.random.default_rng(seed)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, built_mm, model.p) * model.scales
    if study is KNOWN:
        theta *= np.where([one.place == "tool" for one in model.parameters], 0.1, 3.0)
    q = rng.uniform(-1.7, 1.7, (40, 6))
    x = model.see(theta, q, derivatives=False).points + rng.normal(0, 2e-5, (40, 3, 3))
    return edtk.identify(study, by_pose(path / "day.csv", np.rad2deg(q), 1e3 * scale * x))


@pytest.mark.parametrize(("seed", "size"), [(0, 2e-3), (1, -2e-3)])
def test_a_scale_is_named_with_its_size(seed: int, size: float, tmp_path: Path) -> None:
    """All lengths share it, and errors of a drawing share nothing."""
    found = identified(tmp_path, seed, 1 + size)
    (said,) = [doubt.words for doubt in found.findings if doubt.kind == "scale"]
    assert ("longer" if size > 0 else "shorter") in said
    told, std = said.split("together, by ")[1].split(" um/m")[0].split(" +- ")
    assert abs(float(told) - 1e6 * abs(size)) < 3 * float(std)
    assert found.verdict == "usable"


def test_none_is_named_where_lengths_err_alone(tmp_path: Path) -> None:
    """Then the scale is said to be assumed, with what it would cost."""
    found = identified(tmp_path, 0, 1.0)
    assert not [doubt for doubt in found.findings if doubt.kind == "scale"]
    (said,) = found.assumed
    assert "for each 100 um/m" in said
    assert f"assumed: {said}" in found.summary()
    assert found.to_dict()["assumed"] == [said]


@pytest.mark.parametrize("mass", [0.0, 50.0])
def test_weights_of_links_are_said_to_be_assumed(mass: float, tmp_path: Path) -> None:
    """They bend an arm of known springs in each absolute position."""
    content = robot_to_dict(STUDY.robot)
    for joint in content["joints"] if mass else ():
        joint |= {"mass_kg": mass, "center_m": [0.1, 0, 0]}
    known = {"known_rad_per_Nm": {"q2": {"value": 1e-9, "std": 1e-10}}}
    study = STUDY.replace(robot=content, joints=known, load={"F_N": [0, 0, -9]})
    said = identified(tmp_path, 0, 1.0, study).assumed
    assert any("links weigh what the robot's file says" in line for line in said) == bool(mass)


@pytest.mark.parametrize("size", [0.0, 3e-4])
def test_known_lengths_tell_a_scale_that_errors_of_the_drawing_hide(
    size: float, tmp_path: Path
) -> None:
    """They do not grow with it, whatever the arm's own lengths are."""
    found = identified(tmp_path, 0, 1 + size, KNOWN)
    said = [one for one in found.findings if one.kind == "scale"]
    assert bool(said) == bool(size)
    (line,) = found.assumed
    told, std = line.split("together, by ")[2].split(" um/m")[0].split(" +- ")
    sign = 1 if "longer than known" in line else -1
    assert abs(sign * float(told) - 1e6 * size) < 3 * float(std)
    assert float(std) < 40
    assert found.verdict == ("usable" if size else "good")


@pytest.mark.parametrize(("seed", "built_mm"), [(0, 3.0), (1, 30.0)])
def test_none_is_named_where_the_robot_is_another_one(
    seed: int, built_mm: float, tmp_path: Path
) -> None:
    """Lengths that are millimetres or centimetres off are those of its links, of either sign."""
    found = identified(tmp_path, seed, 1.0, built_mm=built_mm)
    assert "scale" not in [one.kind for one in found.findings]


@pytest.mark.parametrize("size", [0.0, 5e-4])
def test_strokes_of_a_slide_tell_a_scale(size: float) -> None:
    """No fitted length takes up what they are longer by."""
    study = edtk.Study(
        robot=tomllib.loads(ROBOT),
        measurement={"sigma_mm": 0.02},
        parameters={"compliance": [], "geometry": "all", "base": True, "tool": True},
        marker=[{"name": name} for name in "ABC"],
    )
    rng = np.random.default_rng(2)
    model = replace(StudyGeometry.of(study).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 0.3, model.p) * model.scales
    q = rng.uniform(*model.robot.limits, (30, 4)) * 0.7
    x = (1 + size) * model.see(theta, q, derivatives=False).points + rng.normal(0, 2e-5, (30, 3, 3))
    shown = q * [1e3, *3 * [180 / np.pi]]
    names = ["slide_mm", "shoulder_deg", "elbow_deg", "wrist_deg"]
    names += [f"{marker}{axis}_mm" for marker in "ABC" for axis in "xyz"]
    found = edtk.identify(
        study, pd.DataFrame(np.hstack([shown, 1e3 * x.reshape(30, 9)]), columns=names)
    )
    said = [one.data["size"] for one in found.findings if one.kind == "scale"]
    assert said == ([pytest.approx(size, abs=5e-5)] if size else [])
    assert found.verdict == ("usable" if size else "good")
