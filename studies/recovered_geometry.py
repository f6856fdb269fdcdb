"""Are known geometric errors recovered to their stated covariance? 500 simulations of each arm.

    python studies/recovered_geometry.py

writes recovered_geometry.md beside this file. Each simulated arm has errors of half a millimetre
and half a milliradian in all its parameters, stands anywhere in a room, and is measured in random
poses. Of every fit the error of predicted positions in poses of their own is compared with its
stated covariance, and the stated covariance with the sample covariance of all fits.
"""

from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from edtk.inference.geometry.fit_geometry import fit_geometry
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.all_parameters import all_parameters
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.joint import Joint
from edtk.model.robot import Robot
from edtk.model.transform import transform
from edtk.report.markdown_table import markdown_table
from edtk.system.atomic_file import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]

SEED = 2026
RUNS = 500
POSES = 30
MARKERS = 2
SIGMA_MM = 0.05
SIZE = 0.5  # of the errors, in millimetres and milliradians
ARMS = {
    "6R": (
        [(0, 0, 0.29), (0, 0, 0), (0, 0, 0.27), (0, 0, 0.07), (0.302, 0, 0), (0, 0, 0)],
        "zyyxyx",
        "",
    ),
    "SCARA": ([(0, 0, 0.3), (0.3, 0, 0), (0.25, 0, 0), (0, 0, 0)], "zzzz", "3"),
    "7R": (
        [
            (0, 0, 0.34),
            (0, 0, 0),
            (0, 0, 0.4),
            (0, 0, 0),
            (0, 0, 0.4),
            (0, 0, 0),
            (0, 0, 0.126),
        ],
        "zyzyzyz",
        "",
    ),
}
OFFSETS = np.array([[0.08, 0.01, 0.05], [-0.03, 0.07, 0.04], [0.0, -0.06, 0.09]])
AXES = dict(zip("xyz", np.eye(3), strict=True))


def arm(origins: list[tuple[float, float, float]], axes: str, slides: str) -> Robot:
    """A chain along parallel frames."""
    joints = []
    for i, (origin, axis) in enumerate(zip(origins, axes, strict=True), start=1):
        slide = str(i) in slides
        limits = (-0.2, 0.2) if slide else (-2.2, 2.2)
        kind = "prismatic" if slide else "revolute"
        joints.append(Joint(f"q{i}", transform(origin), AXES[axis], limits, kind))
    return Robot("arm", tuple(joints))


def simulate(robot: Robot, markers: int, runs: int) -> tuple[int, float, float, float]:
    """Rank, mean chi-square a coordinate, its standard deviation, and the ratio of covariances."""
    rng = np.random.default_rng(SEED)
    names = tuple("ABC"[:markers])
    asked = GeometricModel(robot, np.zeros((markers, 3)), names, all_parameters(robot, names))
    q = rng.uniform(*robot.limits, (POSES, robot.n))
    there = rng.uniform(*robot.limits, (4, robot.n))
    place = transform(rng.uniform(-2, 2, 3), rng.uniform(-1, 1, 3))
    true = replace(asked, offsets=OFFSETS[:markers], start=place)
    theta = rng.normal(0, SIZE, true.p) * true.scales
    exact = true.see(theta, q, derivatives=False).points
    goal = true.see(theta, there, derivatives=False).points
    nothing = np.zeros((POSES, 6))
    row = np.zeros((POSES, markers), dtype=int)
    stated = PositionNoise(SIGMA_MM, np.zeros(robot.n))
    squares = []
    errors = []
    covariances = []
    rank = 0
    for _ in tqdm(range(runs), leave=False, mininterval=10):
        x = exact + rng.normal(0, 1e-3 * SIGMA_MM, exact.shape)
        fit = fit_geometry(asked, MarkerPositions(q, nothing, x, row, names), stated)
        rank = fit.rank
        seen = fit.fitted.model.see(fit.fitted.theta, there)
        assert seen.jacobian is not None
        J = 1e3 * (seen.jacobian * fit.fitted.model.scales).reshape(-1, rank)
        C = J @ fit.fitted.covariance @ J.T
        error = 1e3 * (seen.points - goal).reshape(-1)
        # Positions in few poses may move in fewer ways than they have coordinates.
        values, vectors = np.linalg.eigh(C)
        kept = values > 1e-9 * values.max()
        own = (vectors[:, kept].T @ error) ** 2 / values[kept]
        squares.append(own.mean())
        errors.append(error)
        covariances.append(np.diag(C))
    ratio = np.mean(np.var(errors, axis=0)) / np.mean(covariances)
    return rank, float(np.mean(squares)), float(np.std(squares) / np.sqrt(runs)), float(ratio)


@click.command()
@click.option("--runs", default=RUNS, help="Simulations of each arm.")
@click.option("--out", type=click.Path(path_type=Path), default=HERE / "recovered_geometry.md")
def main(runs: int, out: Path) -> None:
    """Write the page."""
    rows = []
    for name, (origins, axes, slides) in ARMS.items():
        rank, square, std, ratio = simulate(arm(origins, axes, slides), MARKERS, runs)
        rows.append([name, MARKERS, rank, f"{square:.3f}", f"{std:.3f}", f"{ratio:.3f}"])
    head = ["arm", "markers", "rank", "chi-square", "its error", "sample over stated variance"]
    text = (
        "# Known geometry, recovered\n\nFigures of `python studies/recovered_geometry.py`: "
        f"{runs} simulated calibrations of each arm in {POSES} random poses with white noise of "
        f"{SIGMA_MM} mm, all parameters off by {SIZE} mm and mrad. Chi-square is that of predicted "
        "positions in four other poses, over its degrees of freedom; the last column compares "
        "their sample variance with the stated one. Both are one where the stated covariance is "
        "right.\n\n"
    )
    write_text(out, text + markdown_table(head, rows))


if __name__ == "__main__":
    main()
