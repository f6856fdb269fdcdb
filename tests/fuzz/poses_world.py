"""The files of a world whose study calibrates geometry and springs by full poses."""

import json
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import edtk
from edtk.study.study_geometry import StudyGeometry
from tests.fuzz.arm_worlds import ROBOT

STUDY = """
title = "Full poses"
robot = "robot.toml"
seed = 5
candidates = 150

[tool]
position_mm = [200, 0, 50]

[load]
F_N = [0, 0, -300]

[measurement]
rows = "pose"
sigma_mm = 0.05
sigma_deg = 0.01

[parameters]
compliance = ["q2", "q3"]
geometry = ["zeros", "lengths"]
base = true
tool = true

[interest]
parameters = ["geometry", "compliance"]

[costs]
visit = 2
loaded_visit = 3
load_change = 20
budget = 60
unit = "min"

[[marker]]
name = "A"
position_mm = [100, 0, 50]

[[test_pose]]
q_deg = [0, -60, 80]
tool = { position_mm = [250, 0, 0] }
load = { F_N = [0, 100, -200] }

[[test_pose]]
q_deg = [20, -30, 60]
tool = { position_mm = [250, 0, 0] }
load = { F_N = [0, 0, -300] }
weight = 2
"""

PLAN = """q1_deg,q2_deg,q3_deg,Fz_N,repeats
0,-60,80,0,1
10,-30,40,-300,2
-20,-80,110,-300,1
60,-40,20,0,1
-90,20,-50,-300,1
120,-100,130,0,2
"""

FILES = {"study.toml": STUDY, "robot.toml": ROBOT, "plan.csv": PLAN}
POSES = 12
TESTS = 3
WEIGHT_N = 300.0
SIGMA_M, SIGMA_RAD = 5e-5, np.deg2rad(0.01)
ANGLES = "q1_deg,q2_deg,q3_deg"
SHEET = f"{ANGLES},Fz_N,marker,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg"
WIDE = f"{ANGLES},Fz_N,Ax_mm,Ay_mm,Az_mm,Aqw,Aqx,Aqy,Aqz"


def calibrate() -> None:
    """Make a sheet of poses, a result, and poses to predict, beside the study.

    The sheet has a marker a row and rotation vectors, the poses to predict quaternions.
    """
    q, force, points, turns = _measured(edtk.load_study("study.toml"))
    angles = np.column_stack([np.rad2deg(q), force])
    places = 1e3 * points
    vectors = np.rad2deg(turns.as_rotvec())
    quaternions = turns.as_quat(scalar_first=True)
    rows = zip(angles, places, vectors, strict=True)
    sheet = [f"{_cells(angle)},A,{_cells(place, turn)}" for angle, place, turn in rows]
    _write("sheet.csv", SHEET, sheet[:POSES])
    wide = [_cells(*row) for row in zip(angles, places, quaternions, strict=True)]
    _write("tests.csv", WIDE, wide[POSES:])
    _write("poses.csv", f"{ANGLES},Fz_N", [_cells(row) for row in angles[POSES:]])
    found = edtk.identify("study.toml", "sheet.csv")
    Path("result.json").write_text(json.dumps(found.to_dict(), indent=2), encoding="utf-8")


def _measured(study: edtk.Study) -> tuple[np.ndarray, np.ndarray, np.ndarray, Rotation]:
    """Random poses, every other one loaded, and what the instrument sees of an erring robot."""
    setting = StudyGeometry.of(study)
    model = setting.model
    rng = np.random.default_rng(0)
    errors = np.abs(rng.normal(size=model.p))  # springs are not negative
    q = np.round(rng.uniform(-1, 1, (POSES + TESTS, study.robot.n)), 4)
    wrench = np.zeros((len(q), 6))
    wrench[1::2, 2] = -WEIGHT_N
    loads = setting.loads
    assert loads is not None
    seen = model.see(errors * model.scales, q, loads(q, wrench), False)
    points = seen.points[:, 0] + rng.normal(0, SIGMA_M, (len(q), 3))
    noise = Rotation.from_rotvec(rng.normal(0, SIGMA_RAD, (len(q), 3)))
    return q, wrench[:, 2], points, noise * Rotation.from_matrix(seen.turns[:, 0])


def _cells(*parts: np.ndarray) -> str:
    return ",".join(f"{number:.6f}" for part in parts for number in part)


def _write(name: str, header: str, lines: list[str]) -> None:
    Path(name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
