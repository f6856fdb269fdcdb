"""Does `edtk identify` find a frame that moved, and a weight that nobody told, and only these?

    python studies/geometry_causes.py

writes geometry_causes.md beside this file. The robots are like the small one of `real_robots.md`:
what their model leaves out, gears that are not round, is a third of a millimetre, and positions are
read to a few hundredths. Poses are measured in any order, or in that of short travel, in which
errors of poses one after the other are alike.
"""

from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from measured_robots import IRB_120, robot
from numpy.typing import NDArray
from tqdm import tqdm

from edtk.design.tours import visiting_order
from edtk.findings.fit_rows import FitRows
from edtk.findings.moved_frame import moved_frame, untold_load
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.report.tables import markdown_table
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.files import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]

SOUND = 67  # sound days of each kind: 201 together
FAULTY = 40
NAMES = "ABC"
OFFSETS = np.array([[0.09, 0.01, 0.05], [-0.03, 0.07, 0.04], [0.0, -0.06, 0.1]])
READING_MM = 0.03
GEARS_MRAD = 0.5  # of each of three waves a turn, in every joint
WAVES = np.array([1, 2, 3])
STUDY = Study(
    robot=robot(IRB_120),
    measurement={"sigma_mm": READING_MM},
    parameters={"geometry": "all"},
    marker=[{"name": name} for name in NAMES],
)


def day(seed: int, fault: str, size: float, poses: int = 36, travel: bool = False) -> Array:
    """Whether a motion of the frame is named, at which pose less the true one, and a weight.

    Args:
        seed: Of the robot, the poses and the fault.
        fault: "none", "moved" [mm], "drift" over the whole day [mm], "typed" [deg], or "bent": the
            compliance of q2 and q3 times a weight at the tool [mrad/m].
        size: Its size.
        poses: Number of poses.
        travel: Whether they follow each other in the order of short travel.
    """
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(STUDY)
    model = replace(setting.model, offsets=OFFSETS, start=transform(rng.uniform(-1, 1, 3)))
    theta = rng.normal(0, 1.0, model.p) * model.scales
    q = rng.uniform(-2, 2, (poses, 6))
    if travel:
        q = q[visiting_order(q, np.full(6, 4.0))]
    gears = rng.normal(0, 1e-3 * GEARS_MRAD, (6, 3))
    phase = rng.uniform(0, 2 * np.pi, (6, 3))
    bent = q + (gears * np.sin(WAVES * q[..., None] + phase)).sum(axis=-1)
    if fault == "bent":
        down = -model.robot.frames(q, ()).linear_of_each[:, 2].T
        bent += 1e-3 * size * down * np.isin(np.arange(6), [1, 2])
    x = model.see(theta, bent, derivatives=False).points
    x = x + rng.normal(0, 1e-3 * READING_MM, x.shape)
    along = rng.normal(size=3)
    along *= 1e-3 * size / np.linalg.norm(along)
    first = int(rng.integers(poses // 4, poses - poses // 4 + 1))
    if fault == "moved":
        x[first:] += along
    if fault == "drift":
        x += np.linspace(0, 1, poses)[:, None, None] * along
    if fault == "typed":
        q[first, rng.integers(1, 5)] += np.deg2rad(size)
    row = np.arange(poses)[:, None] * np.ones(len(NAMES), dtype=int)
    data = MarkerPositions(q, np.zeros((poses, 6)), x, row, tuple(NAMES))
    fit = fit_geometry(setting.model, data, setting.noise)
    rows = FitRows.of(fit)
    found = moved_frame(rows)
    beside = 0 if found is None else found.first - first
    return np.array([found is not None, beside, untold_load(rows) is not None])


CASES = [
    ("sound, in any order", "none", 0.0, 36, False),
    ("sound, in the order of travel", "none", 0.0, 36, True),
    ("sound, 20 poses", "none", 0.0, 20, False),
    ("one pose typed wrongly by 0.3 deg", "typed", 0.3, 36, False),
    ("a drift of 0.2 mm over the day", "drift", 0.2, 36, False),
    ("moved by 0.3 mm", "moved", 0.3, 36, False),
    ("moved by 0.5 mm", "moved", 0.5, 36, False),
    ("moved by 0.5 mm, in the order of travel", "moved", 0.5, 36, True),
    ("moved by 1 mm", "moved", 1.0, 36, False),
    ("bent by a weight, 3 mrad/m", "bent", 3.0, 36, False),
    ("bent by a weight, 6 mrad/m", "bent", 6.0, 36, False),
]


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=HERE / "geometry_causes.md")
def main(out: Path) -> None:
    """Write the page."""
    lines = []
    for seed, (name, fault, size, poses, travel) in enumerate(CASES):
        runs = SOUND if fault == "none" else FAULTY
        seeds = tqdm(range(1000 * seed, 1000 * seed + runs), leave=False, mininterval=10)
        found = np.array([day(one, fault, size, poses, travel) for one in seeds])
        named = found[:, 0] > 0
        near = f"{int((np.abs(found[named, 1]) <= 1).sum())}" if fault == "moved" else ""
        bent = f"{100 * found[:, 2].mean():.0f} %"
        lines.append([name, runs, f"{100 * named.mean():.0f} %", near, bent])
    head = ["days", "number", "named as moved", "days at the right pose +-1", "as bent by a weight"]
    text = (
        "# Causes of what a geometry leaves\n\nFigures of `python studies/geometry_causes.py`: an "
        "ABB IRB 120 by its drawing, of six "
        "joints, three markers in 36 poses read to "
        f"{READING_MM} mm, gears that are not round by {GEARS_MRAD} mrad in each of three waves. "
        "The frame moves at a pose of the day's middle half. A weight bends the second and third "
        "joint; its size is their compliance times the weight.\n\n"
    )
    write_text(out, text + markdown_table(head, lines))


if __name__ == "__main__":
    main()
