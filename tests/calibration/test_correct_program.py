"""Programs of an arm whose geometry errs: its markers come where the drawing has them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY, by_pose, run, truth
from scipy.spatial.transform import Rotation

import edtk
from edtk.robots.inverse import solve
from edtk.study.study_geometry import StudyGeometry


@pytest.mark.cell("`compensate` a robot program", "parameters")
def test_a_corrected_program_brings_the_markers_where_the_drawing_has_them(tmp_path: Path) -> None:
    """Joints and poses alike; a pose is at the joints that its correction as joints would have."""
    study = tmp_path / "study.toml"
    STUDY.replace(frames={"tool": {"default": {"position_mm": [0, 0, 120]}}}).to_toml(study)
    q, x = truth(40)
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q, x))
    result = tmp_path / "result.json"
    code, out, _ = run("identify", study, tmp_path / "sheet.csv", "--json")
    result.write_text(out)
    task = np.deg2rad(np.random.default_rng(8).uniform(-80, 80, (4, 6)).round(3))
    robot = edtk.load_study(study).robot.with_tool(
        np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.12], [0, 0, 0, 1]])
    )
    lines = ["def demo():"]
    for angles, T in zip(task, robot.forward(task), strict=True):
        lines.append(f"  movej([{', '.join(f'{a:.9f}' for a in angles)}])")
        pose = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec()]
        lines.append(f"  movel(p[{', '.join(f'{a:.9f}' for a in pose)}])")
    path = tmp_path / "demo.script"
    path.write_text("\n".join([*lines, "end", ""]))
    code, out, err = run("compensate", study, result, path, "--out", tmp_path / "out.script")
    assert (code, err) == (0, "")
    assert out.startswith("URScript: 8 targets corrected by up to")

    # The result itself is the same calibration as its file.
    assert edtk.compensate(study, found, tmp_path / "out.script").already

    numbers = [
        [float(one) for one in found.split(",")]
        for found in re.findall(r"\[(.*?)\]", (tmp_path / "out.script").read_text())
    ]
    joints, poses = np.array(numbers[::2]), np.array(numbers[1::2])
    T = np.tile(np.eye(4), (4, 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(poses[:, 3:]).as_matrix()
    T[:, :3, 3] = poses[:, :3]
    by_pose_, reached = solve(robot, T, joints)
    assert reached.all()
    assert np.abs(by_pose_ - joints).max() < 1e-6

    fitted = found.fit.fitted
    drawing = replace(fitted.model, parameters=(), offsets=fitted.placed)
    goal = drawing.see(np.zeros(0), task, derivatives=False).points
    asked = StudyGeometry.of(STUDY).model
    true = replace(asked, offsets=OFFSETS, start=PLACE)
    theta = np.random.default_rng(5).normal(0, 0.7, true.p) * true.scales
    before, after = (
        np.linalg.norm(true.see(theta, one, derivatives=False).points - goal, axis=-1).max(axis=-1)
        for one in (task, joints)
    )
    assert (after < 0.25 * before).all()
