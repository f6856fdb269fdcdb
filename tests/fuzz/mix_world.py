"""The files of a world whose study mixes positions, a pose and distances."""

from pathlib import Path

import numpy as np

import edtk

STUDY = """
title = "Mix"
robot = "robot.toml"
seed = 3
sizes = [2]
candidates = 20
starts = 1
optimise = ["A"]
criteria = ["A", "rho0"]

[tool]
position_mm = [500, 0, 50]

[load]
F_N = [0, 50, -300]

[[marker]]
name = "tip"
position_mm = [0, 0, 20]

[[marker]]
name = "plate"
position_mm = [50, 100, 0]
rows = "pose"

[[distance]]
name = "wire"
anchor_mm = [1500, 400, 200]
marker = "tip"
sigma_mm = 0.01

[[distance]]
anchor_mm = [0, -2000, 800]
joint = "q2"
position_mm = [600, 0, 0]

[measurement]
sigma_mm = 0.05
sigma_deg = 0.01

[joints]
unknown = ["q1", "q2", "q3"]

[test_pose]
q_deg = [0, -60, 80]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [0, 100, -200] }

[simulation]
compliance_rad_per_Nm = { q1 = 2e-6, q2 = 1e-6, q3 = 3e-6 }
"""

TURNS = (" rx", " ry", " rz")  # what names of rows of an orientation end with
IN_MM, IN_DEG = 1e3, 180 / np.pi
SIGMA_MM, SIGMA_DEG = 0.05, 0.01
OWN_SIGMA_MM = {"wire": 0.01}


def fill(path: Path) -> None:
    """Write what the instruments read of the simulated robot into an empty sheet, with noise.

    A visit has a row for each row of the model, in its order.
    """
    study = edtk.load_study("study.toml")
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    names = [sensor.name for sensor in study.model.sensors]
    rng = np.random.default_rng(0)
    filled = []
    for first in range(0, len(lines), len(names)):
        visit = lines[first : first + len(names)]
        true = _changes(study, header, visit[0])
        for name, line, change in zip(names, visit, true, strict=True):
            noise = rng.normal()
            if name.endswith(TURNS):
                filled.append(f"{line}{IN_DEG * change + SIGMA_DEG * noise:.4f}")
            else:
                noise *= OWN_SIGMA_MM.get(name, SIGMA_MM)
                filled.append(f"{line[:-1]}{IN_MM * change + noise:.4f},")
    path.write_text("\n".join([header, *filled]) + "\n", encoding="utf-8")


def _changes(study: edtk.Study, header: str, line: str) -> np.ndarray:
    """What each row of a visit would read without noise [m, rad]."""
    plan = Path("visit.csv")
    pose = [",".join(one.split(",")[: study.robot.n + 6]) for one in (header, line)]
    plan.write_text("\n".join(pose) + "\n", encoding="utf-8")
    found = study.load_plan(plan)
    plan.unlink()
    return study.model.regressor(found.q, found.wrench)[0] @ study.compliances
