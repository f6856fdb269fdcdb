"""A small erring arm, its study, and sheets of positions of it as people bring them."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from numpy.typing import NDArray
from small_arm import ROBOT

from edtk.cli import main
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

Array = NDArray[np.float64]

OFFSETS = np.array([[0.09, 0.01, 0.05], [-0.03, 0.07, 0.04], [0.0, -0.06, 0.1]])
PLACE = transform((1.5, -0.7, 0.2), (0.2, 0.1, 1.0))
STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.02},
    parameters={"compliance": [], "geometry": "all", "base": True, "tool": True},
    marker=[{"name": name} for name in "ABC"],
)
TEST_POSE = {
    "q_deg": [10, 20, -30, 40, 50, 60],
    "load": {"F_N": [0, 0, 0]},
    "tool": {"position_mm": [0, 0, 100]},
}
NAMES = [f"q{i}_deg" for i in range(1, 7)]


def truth(poses: int, seed: int = 0) -> tuple[Array, Array]:
    """Joint angles (m, 6) [deg], and positions (m, 3, 3) [mm], of an erring arm."""
    rng = np.random.default_rng(seed)
    model = StudyGeometry.of(STUDY).model
    model = replace(model, offsets=OFFSETS, start=PLACE)
    theta = np.random.default_rng(5).normal(0, 0.7, model.p) * model.scales
    q = np.round(rng.uniform(-100, 100, (poses, 6)), 3)
    x = model.see(theta, np.deg2rad(q), derivatives=False).points
    return q, 1e3 * x + rng.normal(0, 0.02, x.shape)


def by_pose(path: Path, q: Array, x: Array) -> Path:
    """Write a sheet with a pose a row."""
    header = [*NAMES, *(f"{m}{axis}_mm" for m in "ABC" for axis in "xyz")]
    lines = [*header], *([*a, *np.ravel(p)] for a, p in zip(q, x, strict=True))
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(lines)
    return path


def by_marker(path: Path, q: Array, x: Array) -> Path:
    """Write a sheet with a marker a row."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*NAMES, "marker", "x_mm", "y_mm", "z_mm"])
        for angles, points in zip(q, x, strict=True):
            writer.writerows([*angles, m, *p] for m, p in zip("ABC", points, strict=True))
    return path


def run(*words: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    done = CliRunner().invoke(main, [*map(str, words)])
    return done.exit_code, done.stdout, done.stderr
