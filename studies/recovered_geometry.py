"""Are known geometric errors recovered to their stated covariance? 500 simulations of each arm.

    python studies/recovered_geometry.py

writes recovered_geometry.md beside this file. Each simulated arm has errors of half a millimetre
and half a milliradian in all its parameters, stands anywhere in a room, and is measured in random
poses: positions of two markers, or position and orientation of one. Of every fit the error of what
it predicts in poses of their own is compared with its stated covariance, and the stated covariance
with the sample covariance of all fits.
"""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import click
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.measured_model import MeasuredModel, Seen
from edtk.measure.parameters import all_parameters
from edtk.measure.position_noise import PositionNoise
from edtk.report.tables import markdown_table
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation, rotation_vectors, transform
from edtk.system.files import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]

SEED = 2026
RUNS = 500
POSES = 30
SIGMA_MM = 0.05
SIGMA_MRAD = 0.1
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
Rows = Literal["position", "pose"]
MEASURED: list[tuple[str, int, Rows]] = [
    ("6R", 2, "position"),
    ("SCARA", 2, "position"),
    ("7R", 2, "position"),
    ("6R", 1, "pose"),
    ("7R", 1, "pose"),
]


def arm(origins: list[tuple[float, float, float]], axes: str, slides: str) -> Robot:
    """A chain along parallel frames."""
    joints = []
    for i, (origin, axis) in enumerate(zip(origins, axes, strict=True), start=1):
        slide = str(i) in slides
        limits = (-0.2, 0.2) if slide else (-2.2, 2.2)
        kind = "prismatic" if slide else "revolute"
        joints.append(Joint(f"q{i}", transform(origin), AXES[axis], limits, kind))
    return Robot("arm", tuple(joints))


def measured(
    q: Array, exact: Seen, names: tuple[str, ...], rows: Rows, rng: np.random.Generator
) -> MarkerPositions:
    """What the instrument reads in poses q, with its noise."""
    x = exact.points + rng.normal(0, 1e-3 * SIGMA_MM, exact.points.shape)
    turns = None
    if rows == "pose":
        turns = rotation(rng.normal(0, 1e-3 * SIGMA_MRAD, x.shape)) @ exact.turns
    row = np.zeros(x.shape[:2], dtype=int)
    return MarkerPositions(q, np.zeros((len(q), 6)), x, row, names, turns)


def simulate(robot: Robot, markers: int, rows: Rows, runs: int) -> tuple[int, float, float, float]:
    """Rank, mean chi-square a coordinate, its standard deviation, and the ratio of covariances."""
    rng = np.random.default_rng(SEED)
    names = tuple("ABC"[:markers])
    every = all_parameters(robot, names, pose=rows == "pose")
    asked = MeasuredModel(robot, np.zeros((markers, 3)), names, every, rows=rows)
    q = rng.uniform(*robot.limits, (POSES, robot.n))
    there = rng.uniform(*robot.limits, (4, robot.n))
    place = transform(rng.uniform(-2, 2, 3), rng.uniform(-1, 1, 3))
    true = replace(asked, offsets=OFFSETS[:markers], start=place)
    theta = rng.normal(0, SIZE, true.p) * true.scales
    exact = true.see(theta, q, derivatives=False)
    goal = true.see(theta, there, derivatives=False)
    turn = SIGMA_MRAD if rows == "pose" else None
    stated = PositionNoise(SIGMA_MM, np.zeros(robot.n), turn=turn)
    squares = []
    errors = []
    covariances = []
    rank = 0
    for _ in tqdm(range(runs), leave=False, mininterval=10):
        fit = fit_geometry(asked, measured(q, exact, names, rows, rng), stated)
        rank = fit.rank
        seen = fit.fitted.model.see(fit.fitted.theta, there)
        assert seen.jacobian is not None
        J = 1e3 * (seen.jacobian * fit.fitted.model.scales).reshape(-1, rank)
        C = J @ fit.fitted.covariance @ J.T
        error = seen.points - goal.points
        if rows == "pose":
            turned = rotation_vectors(seen.turns @ np.swapaxes(goal.turns, -1, -2))
            error = np.concatenate([error, turned], axis=-1)
        error = 1e3 * error.reshape(-1)
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
    lines = []
    for name, markers, rows in MEASURED:
        rank, square, std, ratio = simulate(arm(*ARMS[name]), markers, rows, runs)
        of = f"{rows}s of {markers}"
        lines.append([name, of, rank, f"{square:.3f}", f"{std:.3f}", f"{ratio:.3f}"])
    head = ["arm", "measured", "rank", "chi-square", "its error", "sample over stated variance"]
    text = (
        "# Known geometry, recovered\n\nFigures of `python studies/recovered_geometry.py`: "
        f"{runs} simulated calibrations of each arm in {POSES} random poses with white noise of "
        f"{SIGMA_MM} mm and, of full poses, {SIGMA_MRAD} mrad; all parameters off by {SIZE} mm and "
        "mrad. Chi-square is that of predicted positions, or poses, in four other poses, over its "
        "degrees of freedom; the last column compares their sample variance with the stated one. "
        "Both are one where the stated covariance is right.\n\n"
    )
    write_text(out, text + markdown_table(head, lines))


if __name__ == "__main__":
    main()
