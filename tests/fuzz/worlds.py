"""Small folders of valid inputs, from which every case begins."""

import contextlib
import io
import json
import os
import tempfile
from pathlib import Path

import numpy as np

import edtk
from edtk.cli import main
from edtk.study.load_plan import load_plan
from tests.fuzz import cell_world, geometry_world

Files = dict[str, bytes]

ROBOT = """
name = "arm"
source = "made up"

[[joints]]
name = "q1"
origin_m = [0, 0, 0.5]
axis = [0, 0, 1]
limits_deg = [-170, 170]

[[joints]]
name = "q2"
origin_m = [0.1, 0, 0.3]
axis = [0, 1, 0]
limits_deg = [-120, 60]

[[joints]]
name = "q3"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 150]
"""

RAIL_ROBOT = """
name = "rail"
source = "made up"
base = { position_m = [0, 0, 0.2], rpy_deg = [0, 0, 90] }

[[joints]]
name = "rail"
kind = "prismatic"
origin_m = [0, 0, 0.5]
axis = [1, 0, 0]
limits_m = [0, 2]

[[joints]]
name = "shoulder"
origin_m = [0.1, 0, 0.3]
rpy_deg = [0, 0, 10]
axis = [0, 1, 0]
limits_rad = [-2, 1]

[[joints]]
name = "elbow"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 150]
"""

ARM = """
title = "Arm"
robot = "robot.toml"
seed = 7
sizes = [2]
candidates = 30
starts = 1
optimise = ["D"]
criteria = ["D", "rho0"]
published = ["pub.csv"]

[tool]
position_mm = [500, 0, 50]

[load]
F_N = [0, 0, -300]

[measurement]
sigma_mm = 0.1

[joints]
unknown = ["q2", "q3"]
fixed_deg = { q1 = 0 }

[test_pose]
q_deg = [0, -60, 80]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [0, 100, -200] }

[simulation]
compliance_rad_per_Nm = { q2 = 1e-6, q3 = 3e-6 }
"""

POSE = """
title = "Arm with rotations"
robot = "robot.toml"
seed = 1
sizes = [2]
candidates = 20
sampling = "sobol"
starts = 1
optimise = ["rho0"]
criteria = ["rho0", "rho_max", "A"]
published = ["pub.csv"]

[tool]
position_mm = [500, 0, 50]
rpy_deg = [0, 90, 0]

[load]
F_N = [0, 20, -300]
T_Nm = [1, 2, 3]

[measurement]
rows = "pose"
sigma_mm = 0.1
sigma_deg = 0.02

[joints]
unknown = ["q1", "q2", "q3"]

[workspace]
height_min_mm = -500
radius_min_mm = 100
tilt_max_deg = 90
plan_resolution_deg = 0.1
excluded = ["exclude.csv"]
excluded_within_deg = 2

[task]
file = "task.csv"
tool = { position_mm = [600, 0, 0], rpy_deg = [0, 0, 5] }
load = { F_N = [0, 100, -200], T_Nm = [0, 1, 0] }

[simulation]
compliance_rad_per_Nm = { q1 = 2e-6, q2 = 1e-6, q3 = 3e-6 }

[prior]
earlier_file = "earlier.json"
sigma_factor = 2
nu = 5
all = { kind = "half-normal", scale_rad_per_Nm = 1e-5 }

[prior.joints]
q2 = { kind = "log-normal", median_rad_per_Nm = 1e-6, factor = 2 }
"""

RAIL = """
title = "Rail"
robot = "robot.toml"
sizes = [2, 3]
candidates = 20
starts = 1
optimise = ["E"]

[tool]
position_mm = [500, 0, 50]

[load]
F_max_N = 300
direction = [0, 0, -1]

[measurement]
sigma_mm = 0.1

[joints]
unknown = ["shoulder", "elbow"]
fixed_mm = { rail = 100 }

[[test_pose]]
q_deg = [500, -60, 80]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [0, 100, -200] }

[[test_pose]]
q_deg = [200, -30, 100]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [50, 0, -200] }
weight = 3

[simulation]
compliance_rad_per_Nm = { shoulder = 1e-6, elbow = 3e-6 }

[prior.earlier]
mean_rad_per_Nm = { shoulder = 1e-6, elbow = 3e-6 }
covariance = [[1e-12, 0], [0, 1e-12]]
"""

PLAN = """q1_deg,q2_deg,q3_deg,repeats
0,-60,80,1
10,-30,40,2
-20,-80,110,1
"""
TASK = """q1_deg,q2_deg,q3_deg,Fx_N,Fy_N,Fz_N,Tx_Nm
0,-60,80,0,100,-200,0
15,-45,60,10,0,-100,1
"""
EXCLUDE = "q1_deg,q2_deg,q3_deg\n100,-100,-100\n"

RAIL_PLAN = """rail_mm,shoulder_deg,elbow_deg,Fx_N,Fy_N,Fz_N,repeats
100,-60,80,0,0,-300,1
100,-30,40,0,0,-300,2
100,-80,110,0,0,-150,1
"""
RAIL_TASK = """rail_mm,shoulder_deg,elbow_deg,Fz_N
500,-60,80,-200
700,-45,60,-100
"""
RAIL_EXCLUDE = "rail_mm,shoulder_deg,elbow_deg\n100,-100,-100\n"
EARLIER = '{"k": {"q1": 2e-6, "q2": 1e-6, "q3": 3e-6}, "std": [1e-6, 1e-6, 1e-6]}\n'

# Study, robot, plan, task and excluded poses.
WRITTEN = {
    "arm": (ARM, ROBOT, PLAN, TASK, EXCLUDE),
    "pose": (POSE, ROBOT, PLAN, TASK, EXCLUDE),
    "rail": (RAIL, RAIL_ROBOT, RAIL_PLAN, RAIL_TASK, RAIL_EXCLUDE),
    "cell": (
        cell_world.STUDY,
        cell_world.URDF,
        cell_world.PLAN,
        cell_world.TASK,
        cell_world.EXCLUDE,
    ),
}
GEOMETRY = "geometry"  # absolute positions, without a load
WORLDS = (*WRITTEN, GEOMETRY)
FIRST = "arm"
ANY = "cell"  # any robot and any task: a URDF, markers, a payload, noise
OF_TABLES = ("arm", "pose", "rail")  # robots are in TOML files there
NAMES = ("study.toml", "robot.toml", "plan.csv", "task.csv", "exclude.csv")


def world(name: str) -> Files:
    """The files of a world by their names: those written above, and those that edtk makes of them.

    The first world has a finished run in the folder `run`, and a chain.
    """
    texts = _texts(name)
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for file, text in texts.items():
                Path(file).write_text(text.lstrip(), encoding="utf-8")
            _make(name)
            found = {
                str(path): path.read_bytes()
                for path in sorted(Path().rglob("*"))
                if path.is_file() and path.suffix != ".png"
            }
        finally:
            os.chdir(here)
    return found


def _texts(name: str) -> dict[str, str]:
    """The files of a world that are written above."""
    if name == GEOMETRY:
        return {"study.toml": geometry_world.STUDY, "robot.toml": ROBOT, "plan.csv": PLAN}
    written = dict(zip(NAMES, WRITTEN[name], strict=True))
    if name == ANY:
        written["robot.urdf"] = written.pop("robot.toml")
    texts = {**written, "pub.csv": written["plan.csv"]}
    texts["earlier.json"] = EARLIER
    # One experiment that was made, so that there is another one to plan.
    texts["keep.csv"] = "\n".join(written["plan.csv"].splitlines()[:2]) + "\n"
    return texts


def _make(name: str) -> None:
    """Make the other files of a world."""
    if name == GEOMETRY:
        geometry_world.calibrate()
        return
    _calibrate()
    _edtk("relax", "study.toml", "--certificate", "certificate.json")
    if name == FIRST:
        _search()
    if name == ANY:
        _measure_positions()


def _calibrate() -> None:
    """Make a filled-in sheet and k.json."""
    _edtk("template", "study.toml", "plan.csv", "--out", "sheet.csv")
    _fill(Path("sheet.csv"))
    found = edtk.identify("study.toml", "sheet.csv")
    Path("k.json").write_text(json.dumps(found.to_dict(), indent=2), encoding="utf-8")


def _search() -> None:
    """Make a run with its checkpoint, the certificate of a plan, and a chain."""
    _edtk("run", "study.toml", "--workers", "1", "--out", "run")
    planned = sorted(Path("run/certificates").glob("optimised_*.json"))
    Path("planned.json").write_bytes(planned[0].read_bytes())
    _edtk("bayes", "study.toml", "plan.csv", "--accuracy", "0.5", "--chain", "chain.h5")


def _fill(path: Path) -> None:
    """Write the deflections of the simulated robot into an empty sheet, with some noise."""
    study = edtk.load_study("study.toml")
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    A = study.model.regressor(*_poses(study, [header, *lines]))
    true = A @ study.compliances
    # A row of the sheet is one marker of a visit, whose markers stand one after another.
    own = len(study.specification.marker) or 1
    true = true.reshape(len(lines), own, -1)[np.arange(len(lines)), np.arange(len(lines)) % own]
    sigma = 1e-4 if study.specification.noise is None else 3e-5
    noisy = true + np.random.default_rng(0).normal(0, sigma, true.shape)
    printed = noisy * np.array([1e3] * 3 + [180 / np.pi] * 3)[: true.shape[1]]
    filled = [
        ",".join([line.rstrip(","), *(f"{number:.4f}" for number in row)])
        for line, row in zip(lines, printed, strict=True)
    ]
    path.write_text("\n".join([header, *filled]) + "\n", encoding="utf-8")


def _poses(study: edtk.Study, sheet: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Joint variables and wrenches of the lines of a sheet, each as a plan of its own."""
    columns = study.robot.n + 6
    found = []
    for line in sheet[1:]:
        Path("pose.csv").write_text(
            "\n".join(",".join(row.split(",")[:columns]) for row in (sheet[0], line)) + "\n",
            encoding="utf-8",
        )
        found.append(load_plan(study, "pose.csv"))
    Path("pose.csv").unlink()
    return np.concatenate([p.q for p in found]), np.concatenate([p.wrench for p in found])


def _measure_positions() -> None:
    """Make a file of measured positions of a marker, for `edtk controller`."""
    study = edtk.load_study("study.toml")
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 0.5, (8, study.robot.n))
    where = 1e3 * study.robot.forward(q)[:, :3, 3]
    rows = np.concatenate([np.rad2deg(q), where], axis=1)
    header = "turn_deg,lift_deg,bend_deg,x_mm,y_mm,z_mm"
    text = "\n".join([header, *(",".join(f"{cell:.4f}" for cell in row) for row in rows)])
    Path("positions.csv").write_text(text + "\n", encoding="utf-8")


def _edtk(*arguments: str) -> None:
    """Run a command that has to succeed, in silence."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            main(list(arguments))
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"{arguments}: {said.getvalue()}") from end
