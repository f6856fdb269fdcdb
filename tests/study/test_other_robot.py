"""Another robot than the paper's: a gantry arm with a prismatic joint, measured in all six rows."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from edtk.errors import UserError
from edtk.study import load_study

ROBOT = """
name = "gantry arm"
source = "made up for this test"
[[joints]]
name = "slide"
kind = "prismatic"
origin_m = [0, 0, 1.0]
axis = [0, 1, 0]
limits_m = [-1.0, 1.0]
[[joints]]
name = "shoulder"
origin_m = [0.2, 0, 0]
axis = [0, 0, 1]
limits_deg = [-150, 150]
[[joints]]
name = "elbow"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 120]
[[joints]]
name = "wrist"
origin_m = [0.6, 0, 0]
rpy_deg = [0, 30, 0]
axis = [1, 0, 0]
limits_deg = [-180, 180]
"""
STUDY = """
title = "Gantry arm"
robot = "gantry.toml"
seed = 3
sizes = [3]
candidates = 300
starts = 1
optimise = ["rho0", "G"]
criteria = ["A", "G", "rho0"]
[tool]
position_mm = [100, 50, -200]
[load]
F_N = [100, -200, -300]
T_Nm = [10, 0, 5]
[measurement]
rows = "pose"
sigma_mm = 0.05
sigma_deg = 0.01
[joints]
unknown = ["shoulder", "elbow", "wrist"]
fixed_mm = { slide = 250 }
[workspace]
height_min_mm = 300
[test_pose]
q_deg = [-100, 20, 30, 40]
tool = { position_mm = [150, 0, 0] }
load = { F_N = [0, 100, -50], T_Nm = [0, 0, 10] }
[simulation]
compliance_rad_per_Nm = { shoulder = 1e-6, elbow = 2e-6, wrist = 5e-6 }
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "gantry.toml").write_text(ROBOT)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


def test_the_whole_way_from_study_to_posterior(study: Path) -> None:
    """`run`, `evaluate` and `bayes` serve a robot file with a prismatic joint, millimetres in its plans."""
    out = study.parent / "out"
    subprocess.run([sys.executable, "-m", "edtk", "run", study, "--out", out], check=True, capture_output=True)
    plan = out / "plans/optimised_rho0_m3.csv"
    table = pd.read_csv(plan)
    assert list(table)[:4] == ["slide_mm", "shoulder_deg", "elbow_deg", "wrist_deg"]
    assert (table["slide_mm"] == 250).all()
    results = pd.read_csv(out / "results.csv").set_index("plan")
    command = [sys.executable, "-m", "edtk", "evaluate", study, plan, "--json"]
    answer = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert answer["parameters"] == ["k_shoulder", "k_elbow", "k_wrist"]
    assert answer["criteria"]["rho0"] == pytest.approx(results.loc["optimised_rho0_m3", "rho0"], rel=1e-6)
    assert results["rho0"].idxmin() == "optimised_rho0_m3"
    command = [sys.executable, "-m", "edtk", "bayes", study, plan, "--json"]
    rows = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert all(abs(row["ratio"] - 1) < 4 * row["ratio_error"] for row in rows)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "fixed_mm = { slide = 250 }",
            "fixed_deg = { slide = 2 }",
            ("joints.fixed_deg.slide", "prismatic", "fixed_mm"),
        ),
        ("slide = 250", "slide = 2500", ("joints.fixed_mm.slide", "outside the joint's limits")),
        ("sigma_deg = 0.01", "", ("measurement.sigma_deg", "rotations")),
    ],
)
def test_units_that_do_not_fit_the_joint_are_refused(study: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    """A prismatic joint is fixed in millimetres, within its limits; measured rotations need their own sigma."""
    study.write_text(STUDY.replace(old, new))
    with pytest.raises(UserError) as caught:
        load_study(study)
    for word in ("study.toml", *words):
        assert word in str(caught.value)
