"""Is rho0 of a planned calibration of geometry and springs the error that it leaves?

    python studies/planned_geometry.py

writes planned_geometry.md beside this file. A KUKA KR 270 with three markers, of which geometry,
base, tool and three springs are unknown, shall be accurate in two tasks. `edtk.plan` chooses the
visits, `edtk.template` makes their sheet, which is filled in by simulations of a robot with known
errors. `edtk.identify` calibrates each, and `edtk.predict` says where the markers are in the tasks.
What it is off there is compared with rho0 of the plan and with the covariance of each fit, and rho0
of the plan with that of random visits.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

import edtk
from edtk.measure.equilibrium import resting_load
from edtk.measure.measured_model import MeasuredModel
from edtk.report.tables import markdown_table
from edtk.study.study_geometry import StudyGeometry
from edtk.system.files import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]

SEED = 2026
SIZE = 16
RUNS = 60
RANDOM = 200
SIGMA_MM = 0.05
ERRORS = 0.5  # in millimetres and milliradians
SPRINGS = 2.0  # [1e-6 rad/(N m)]
LOAD = {"F_N": [0, 0, -2500]}
TASK_LOAD = {"F_N": [0, 0, -1000]}
FORCES = ["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]
POSITION = ["x_mm", "y_mm", "z_mm"]
TOOL = {"position_mm": [0, 0, 100]}
STUDY = edtk.Study(
    robot="kuka_kr270",
    measurement={"sigma_mm": SIGMA_MM},
    parameters={"geometry": "all", "compliance": ["q2", "q3", "q4"]},
    load=LOAD,
    marker=[
        {"name": "A", "position_mm": [90, 10, 50]},
        {"name": "B", "position_mm": [-30, 70, 40]},
        {"name": "C", "position_mm": [0, -60, 100]},
    ],
    test_pose=[
        {"q_deg": [0, -60, 90, 0, 30, 0], "tool": TOOL, "load": TASK_LOAD},
        {"q_deg": [30, -80, 100, 10, 50, 20], "tool": TOOL, "load": TASK_LOAD},
    ],
)
JOINTS = [f"q{i}_deg" for i in range(1, 7)]


def truth(rng: np.random.Generator) -> tuple[MeasuredModel, Array]:
    """A robot with errors in all that is unknown, and their values (p,) in SI units."""
    model = StudyGeometry.of(STUDY).model
    sizes = np.array([SPRINGS if one.place == "compliance" else ERRORS for one in model.parameters])
    theta = rng.normal(0, sizes) * model.scales
    springs = np.array([one.place == "compliance" for one in model.parameters])
    return model, np.where(springs, np.abs(theta), theta)


def positions(model: MeasuredModel, theta: Array, q: Array, wrench: Array) -> Array:
    """Where the markers are (m, k, 3) [mm], loads at rest."""
    loads = StudyGeometry.of(STUDY).loads
    torque = resting_load(model.bending(theta), q, wrench, loads)
    return 1e3 * model.see(theta, q, torque, derivatives=False).points


def fill(sheet: Path, rng: np.random.Generator, found: tuple[MeasuredModel, Array]) -> None:
    """Write simulated positions into an empty sheet."""
    import pandas as pd

    table = pd.read_csv(sheet)
    visits = table.groupby("visit").first()
    x = positions(*found, np.deg2rad(visits[JOINTS].to_numpy()), visits[FORCES].to_numpy(float))
    table[POSITION] = (x + rng.normal(0, SIGMA_MM, x.shape)).reshape(-1, 3)
    table.to_csv(sheet, index=False)


def one_day(plan: edtk.Plan, seed: int, folder: Path) -> tuple[float, float, int, float]:
    """Squared error in the tasks [mm^2], chi-square, degrees of freedom, rho0 of the fit [mm]."""
    rng = np.random.default_rng((SEED, seed))
    robot = truth(rng)
    sheet = folder / f"day{seed}.csv"
    edtk.template(STUDY, plan, out=sheet)
    fill(sheet, rng, robot)
    found = edtk.identify(STUDY, sheet)
    q = np.deg2rad([pose.q_deg for pose in STUDY.specification.test_poses])
    wrench = np.tile([*TASK_LOAD["F_N"], 0.0, 0.0, 0.0], (len(q), 1)).astype(float)
    tasks = edtk.Plan(q, wrench, np.ones(len(q), dtype=int)).to_frame(STUDY.robot)
    tasks.drop(columns="repeats").to_csv(folder / "tasks.csv", index=False)
    predicted = edtk.predict(STUDY, found, folder / "tasks.csv").predicted
    error = (1e3 * predicted.points - positions(*robot, q, wrench)).reshape(-1)
    rows = found.fit.fitted.columns(q, wrench, found.setting.loads).reshape(len(error), -1)
    # Positions of three markers of one tool are nearly dependent: whitened as far as they are not.
    U, s, _ = np.linalg.svd(rows @ np.linalg.cholesky(found.fit.fitted.covariance))
    rank = int((s > 1e-6 * s[0]).sum())
    z = (U.T @ error)[:rank] / s[:rank]
    assert found.rho0_mm is not None
    return float(3 * np.mean(error**2)), float(z @ z), rank, found.rho0_mm


def random_rho0(rng: np.random.Generator) -> float:
    """rho0 [mm] of as many random visits, of which half are loaded."""
    q = rng.uniform(*STUDY.robot.limits, (SIZE, STUDY.robot.n))
    wrench = np.zeros((SIZE, 6))
    wrench[::2, 2] = LOAD["F_N"][2]
    found = edtk.evaluate(STUDY, edtk.Plan(q, wrench, np.ones(SIZE, dtype=int)))
    rho0 = found.to_dict()["rho0_mm"]
    return np.inf if rho0 is None else float(rho0)


@click.command()
@click.option("--runs", type=click.IntRange(2), default=RUNS, help="Simulated days.")
@click.option("--out", type=click.Path(path_type=Path), default=HERE / "planned_geometry.md")
def main(runs: int, out: Path) -> None:
    """Plan, simulate, identify, predict, and write the table."""
    plan = edtk.plan(STUDY, SIZE, "rho0")
    with TemporaryDirectory() as folder:
        days = [one_day(plan.whole, i, Path(folder)) for i in tqdm(range(runs), unit="day")]
    squares, chi, rank, own = (np.array(column, dtype=float) for column in zip(*days, strict=True))
    rng = np.random.default_rng(SEED)
    chance = np.array([random_rho0(rng) for _ in range(RANDOM)])
    loaded = int(plan.whole.repeats[plan.whole.wrench.any(axis=1)].sum())
    rho0 = 1e3 * plan.value
    rows = [
        ["visits, of which loaded", f"{plan.whole.experiments}, {loaded}"],
        ["efficiency of the plan, by the bound over all poses", f"{100 * plan.efficiency:.1f} %"],
        ["rho0 of the plan", f"{rho0:.4f} mm"],
        [f"root mean square error in the tasks, {runs} days", f"{np.sqrt(squares.mean()):.4f} mm"],
        ["their ratio", f"{np.sqrt(squares.mean()) / rho0:.3f}"],
        ["standard error of the ratio", f"{_spread(squares) / rho0:.3f}"],
        ["mean rho0 that `edtk identify` states", f"{own.mean():.4f} mm"],
        ["chi-square of the errors per degree of freedom", f"{chi.sum() / rank.sum():.3f}"],
        ["its standard error", f"{np.sqrt(2 / rank.sum()):.3f}"],
        [f"rho0 of random visits, median of {RANDOM}", f"{np.median(chance):.4f} mm"],
        ["the best of them", f"{chance.min():.4f} mm"],
    ]
    write_text(out, f"{HEAD}\n{markdown_table(['', 'value'], rows)}")


def _spread(squares: Array) -> float:
    """Standard error of the root of a mean of squares (n,)."""
    return float(squares.std(ddof=1) / np.sqrt(len(squares)) / 2 / np.sqrt(squares.mean()))


HEAD = f"""# A planned calibration of geometry and springs, from end to end

KUKA KR 270, three markers, geometry, base, tool and three springs unknown, noise of {SIGMA_MM} mm,
two tasks under 1000 N. `edtk.plan`, `edtk.template`, simulated positions, `edtk.identify`,
`edtk.predict`. Written by `planned_geometry.py` beside this file.
"""


if __name__ == "__main__":
    main()
