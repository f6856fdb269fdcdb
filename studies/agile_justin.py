"""What a humanoid that gravity bends leaves of each model: data of DLR's Agile Justin.

    python studies/agile_justin.py --data measurements.csv

writes agile_justin.md beside this file. The data are public without a licence, and are not part of
this repository: 500 poses of torso and arms as they were commanded, and a marker on each hand by a
Vicon system (J. Tenhumberg and B. Baeuml, "Calibration of an elastic humanoid upper body and
efficient compensation for motion planning", Humanoids 2021; repository
dlr-alr/dlr-elastic-calibration, earlier commits). The drawing is the paper's table of modified
Denavit-Hartenberg parameters. Neither the frames of the shoulders nor masses are printed: the
former were fitted once, the latter are assumptions, so that the sizes of springs say nothing.
"""

import re
import warnings
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import edtk
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]
SIGMA_MM = 0.5
TORSO = ((0.1055, 0, 0, 0), (0, -90, 0, -90), (0, 0, 0.3, 0), (0, 0, 0.3, 0))  # d, theta, r, alpha
NAMES = ("t1", "t2", "t3", "t4", *(f"a{i}" for i in range(1, 8)))
# Of the body behind each joint, assumed [kg]; the chest carries head and other arm.
MASSES = (8, 10, 10, 42, 2.7, 2.7, 2.7, 2.7, 1.7, 1.7, 2.5)
# Place [m] and turn [deg] of the first frame of each arm before t4's, and the first column of a
# sheet that is of it.
SHOULDERS = {
    "right": ((0.283, 0.084, -0.259), (179.59, 28.85, 179.23), 3),
    "left": ((0.283, 0.085, 0.248), (179.94, 30.16, -0.39), 10),
}
MODELS: dict[str, dict[str, Any]] = {
    "base and marker": {},
    "and all geometry": {"geometry": "all"},
    "and springs of the joints": {"geometry": "all", "springs": list(NAMES)},
    "and springs across them": {"geometry": "all", "springs": "lateral"},
}
# Means that the paper prints, of both hands [mm]; its first has fewer parameters than ours.
PAPER = ("21.33", "10.5", "5.64", "3.12")
HEAD = ("fitted", "hand", "parameters", "mean, mm", "largest", "poses left out, rms", "paper, mean")


def arm(side: str) -> tuple[tuple[float, ...], ...]:
    """Rows of the table of an arm."""
    s = 1 if side == "right" else -1
    turned = -180 if side == "right" else 0
    bent = s * 90
    return (
        (0, 0, 0, 0),
        (0, 0, 0, 90),
        (s * 0.4, -90, 0, -90),
        (0, 0, 0, 90),
        (s * 0.39, turned, 0, -90),
        (0, 90, 0, bent),
        (0, -90, 0, bent),
    )


def robot(side: str) -> dict[str, Any]:
    """The keys of a robot file: torso and one arm."""
    joints = []
    for name, mass, (d, theta, r, alpha) in zip(NAMES, MASSES, TORSO + arm(side), strict=True):
        turn = Rotation.from_euler("x", alpha, degrees=True)
        place = turn.apply([r, 0.0, d])
        turn = turn * Rotation.from_euler("z", theta, degrees=True)
        if name == "a1":
            at, angles, _ = SHOULDERS[side]
            shoulder = Rotation.from_euler("xyz", angles, degrees=True)
            place, turn = np.array(at) + shoulder.apply(place), shoulder * turn
        joints.append(
            {
                "name": name,
                "origin_m": place.round(4).tolist(),
                "rpy_deg": turn.as_euler("xyz", degrees=True).round(3).tolist(),
                "axis": [0, 0, 1],
                "limits_deg": [-360, 360],
                "mass_kg": mass,
                "center_m": [0.15, 0, 0] if name in ("t2", "t3", "t4") else [0, 0, 0],
            }
        )
    return {"name": f"Agile Justin, {side} arm", "source": "printed table", "joints": joints}


def read(path: Path) -> tuple[Array, Array]:
    """Joint angles (m, 19) [rad] and positions (m, 2, 3) [m] of both markers."""
    table = pd.read_csv(path, index_col=0)
    numbers = [[re.findall(r"[-+.\deE]+", cell) for cell in row] for row in table.to_numpy()]
    q = np.array([row[0] for row in numbers], dtype=float)
    x = np.array([row[1] for row in numbers], dtype=float)
    return q, x.reshape(-1, 2, 3)


def sheet(q: Array, x: Array, side: str) -> pd.DataFrame:
    """The sheet of an arm; a passive joint keeps the chest upright."""
    first = SHOULDERS[side][2]
    turned = np.column_stack([q[:, :3], -q[:, 1] - q[:, 2], q[:, first : first + 7]])
    found = pd.DataFrame(np.rad2deg(turned), columns=[f"{name}_deg" for name in NAMES])
    found[["x_mm", "y_mm", "z_mm"]] = 1e3 * x[:, 0 if side == "right" else 1]
    return found.assign(marker="A")


def row_of(model: str, side: str, table: pd.DataFrame) -> list[Any]:
    """A row of the page: a model, fitted to an arm."""
    asked = {"geometry": [], "base": True, "tool": True} | MODELS[model]
    study = edtk.Study(
        robot=robot(side),
        measurement={"sigma_mm": SIGMA_MM},
        parameters=asked,
        marker=[{"name": "A"}],
    )
    fit = edtk.identify(study, table).fit
    off = 1e3 * np.linalg.norm(fit.residual.reshape(len(table), 3), axis=1)
    paper = PAPER[list(MODELS).index(model)]
    size = [f"{off.mean():.2f}", f"{off.max():.1f}", f"{1e3 * fit.loo_rms:.2f}"]
    return [model, side, fit.rank, *size, paper]


INTRODUCTION = """# A humanoid that gravity bends

Figures of `python studies/agile_justin.py`. DLR's Agile Justin, 500 poses of torso and arms as they
were commanded, and a marker on each hand by a Vicon system: public without a licence, and not part
of this repository (J. Tenhumberg and B. Baeuml, "Calibration of an elastic humanoid upper body and
efficient compensation for motion planning", Humanoids 2021, repository
dlr-alr/dlr-elastic-calibration). The drawing is the printed table of Denavit-Hartenberg parameters.
The frames of the shoulders are not printed, and were fitted to the poses first; so the first row
is not the paper's, which leaves them as drawn. Weights are assumptions. Each hand is calibrated
alone, as a chain of torso and one arm; the paper fits both together.

{table}

With all geometry both agree. With springs the paper leaves less. One reason is known: the weight of
the other arm, which moves from pose to pose, bends the torso, and a chain has one arm; weights that
are fitted or those of a drawing may be another. What is left is no noise of the cameras, and the
findings say so (`discrepancy`): bands of all rows count it.

No numbers of Klimchik and Pashkevich were found to compare with: of arXiv 1311.6810, 1311.6674 and
SCITEPRESS 2014/50987 only the openings were at hand, without their tables.
"""


@click.command(help=__doc__)
@click.option("--data", type=click.Path(path_type=Path, exists=True), required=True)
def main(data: Path) -> None:
    """Write the page."""
    q, x = read(data)
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for model in MODELS:
            rows += [row_of(model, side, sheet(q, x, side)) for side in SHOULDERS]
    text = INTRODUCTION.format(table=markdown_table(HEAD, rows))
    write_text(HERE / "agile_justin.md", text)
    click.echo(text)


if __name__ == "__main__":
    main()
