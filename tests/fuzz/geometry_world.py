"""The files of a world whose study calibrates geometry by absolute positions."""

import json
from pathlib import Path

import numpy as np

import edtk

STUDY = """
title = "Geometry"
robot = "robot.toml"
candidates = 200

[measurement]
sigma_mm = 0.05

[parameters]
compliance = []
geometry = "all"
base = true
tool = true

[interest]
parameters = ["geometry", "tool"]

[costs]
visit = 1.5
load_change = 30
budget = 60
unit = "min"

[[marker]]
name = "A"
position_mm = [100, 0, 50]

[[marker]]
name = "B"
position_mm = [0, 80, 20]
"""

OFFSETS_M = np.array([[0.1, 0, 0.05], [0, 0.08, 0.02]])
POSES = 10
TESTS = 3
HEADER = "q1_deg,q2_deg,q3_deg,marker,x_mm,y_mm,z_mm"


def calibrate() -> None:
    """Make a sheet of positions, a result, and poses to predict, beside the study."""
    rows = _rows(edtk.load_study("study.toml"))
    for name, chosen in (("sheet.csv", rows[: 2 * POSES]), ("tests.csv", rows[2 * POSES :])):
        Path(name).write_text("\n".join([HEADER, *chosen]) + "\n", encoding="utf-8")
    found = edtk.identify("study.toml", "sheet.csv")
    Path("result.json").write_text(json.dumps(found.to_dict(), indent=2), encoding="utf-8")


def _rows(study: edtk.Study) -> list[str]:
    """Measured positions of both markers in random poses, a line each."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (POSES + TESTS, study.robot.n))
    T = study.robot.forward(q)
    seen = (T[:, None, :3, :3] @ OFFSETS_M[:, :, None])[..., 0] + T[:, None, :3, 3]
    seen = 1e3 * seen + rng.normal(0, 0.05, seen.shape)
    return [
        ",".join([*(f"{angle:.4f}" for angle in angles), name, *(f"{x:.4f}" for x in point)])
        for angles, points in zip(np.rad2deg(q), seen, strict=True)
        for name, point in zip("AB", points, strict=True)
    ]
