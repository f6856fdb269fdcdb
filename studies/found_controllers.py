"""How often are signs, zeros and coupling of a controller found from measured positions?

    python studies/found_controllers.py

writes found_controllers.md beside this file: simulated calibrations of a heavy arm with an offset
elbow and of a light one with three parallel axes, with random signs, zeros and couplings.
"""

from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from edtk import Robot, load_robot
from edtk.fit.controller.find_controller import find_controller
from edtk.fit.controller.fits import Positions
from edtk.fit.controller.ways_to_count import Counted, WayToCount, same_arms, ways_to_count
from edtk.report.tables import markdown_table
from edtk.robots.robot_file import robot_from_dict
from edtk.system.files import write_text
from edtk.system.typing import Array

HERE = Path(__file__).parent
POSES = (5, 8, 12)
TRIALS = 10
NOISE = 5e-5  # [m]
PART = 0.7  # of the joints' ranges, from which poses are drawn
MARKERS = np.array([[0.15, 0.05, 0.2], [-0.1, 0.12, 0.15], [0.02, -0.14, 0.18]])
ZERO_WITHIN = 0.1  # [deg], or
STDS = 5.0  # standard deviations
UR10_ORIGINS = (
    (0, 0, 0.1273),
    (0, 0.220941, 0),
    (0, -0.1719, 0.612),
    (0, 0, 0.5723),
    (0, 0.1149, 0),
    (0, 0, 0.1157),
)
UR10_AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 0, 1), (0, 1, 0))

TEXT = """\
# How a controller counts, found from measured positions

`python studies/found_controllers.py` has written this. Signs, zeros (anywhere in a turn) and coupling are random; poses
are drawn from {part:g} % of the joints' ranges; the tracker's noise is {noise} mm for each coordinate, its
place and those of the markers are unknown. Right: signs, coupling and all zeros that can be told (within {within} deg or
{stds:g} standard deviations) are those of the simulated controller, or make the same arm. Ways to count that make the
same arm: {same}.

{table}

A real robot: a FANUC R-2000iC/165F whose positions others have published (hany606/Introduction-to-Manipulators-
FoR_Fall20IU on GitHub; 16 poses, means of ten repetitions, three markers), with the nominal chain. The best way to count
leaves 0.267 mm (root mean square), the second best 25.7 mm. Joint 3 does not follow joint 2 in these data; joint 1 stands
still in them, so that neither its sign nor the zero of joint 2 is told.
"""  # noqa: E501


@dataclass(frozen=True, eq=False)
class Truth:
    """How the simulated controller counts."""

    way: WayToCount
    zero: Array  # (n,) [rad]


def ur10() -> Robot:
    """An arm like a UR10."""
    joints = [
        {"name": f"q{i + 1}", "origin_m": origin, "axis": axis, "limits_deg": [-360, 360]}
        for i, (origin, axis) in enumerate(zip(UR10_ORIGINS, UR10_AXES, strict=True))
    ]
    return robot_from_dict({"name": "UR10-like", "source": "data sheet", "joints": joints})


def truth_of(robot: Robot, rng: np.random.Generator) -> Truth:
    """Random signs and zeros, and each coupling or none with equal chances."""
    everything = ways_to_count(robot, (), list(range(robot.n)))
    couplings = list(dict.fromkeys(way.follows for way in everything))
    sign = rng.choice([1.0, -1.0], robot.n)
    follows = couplings[rng.integers(len(couplings))]
    return Truth(WayToCount(sign, follows), rng.uniform(-np.pi, np.pi, robot.n))


def measured(
    robot: Robot, truth: Truth, poses: int, markers: int, rng: np.random.Generator
) -> Positions:
    """Simulated positions in a random frame."""
    lower, upper = robot.limits
    middle = (lower + upper) / 2
    q = middle + PART * (upper - lower) * rng.uniform(-0.5, 0.5, (poses, robot.n))
    shown = np.linalg.solve(truth.way.counting, q.T).T + truth.zero
    T = robot.forward(q)
    points = T[:, None, :3, :3] @ MARKERS[:markers, :, None]
    points = points[..., 0] + T[:, None, :3, 3]
    turn = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    seen = points @ turn.T + rng.normal(0, 2, 3) + NOISE * rng.standard_normal(points.shape)
    names = [f"m{k}" for k in range(markers)] * poses
    return Positions.of_rows(np.repeat(shown, markers, axis=0), seen.reshape(-1, 3), names)


def is_right(found: Counted, std: Array, truth: Truth, told: list[int]) -> bool:
    """Whether signs, coupling and the zeros that are told are those of the truth (std [deg])."""
    if (found.way.sign != truth.way.sign).any() or found.way.follows != truth.way.follows:
        return False
    off = (found.zero - np.rad2deg(truth.zero))[told]
    within = np.maximum(ZERO_WITHIN, STDS * std[told])
    return bool((np.abs((off + 180) % 360 - 180) <= within).all())


def run(robot: Robot, poses: int, markers: int, trials: int, seed: int) -> list[object]:
    """A row of the table."""
    rng = np.random.default_rng([seed, poses, markers])
    arm = robot.with_tool(np.eye(4))
    right = clear = clear_and_wrong = 0
    second = []
    for _ in tqdm(range(trials), desc=f"{robot.name}, {poses} poses", leave=False):
        truth = truth_of(arm, rng)
        found = find_controller(robot, measured(arm, truth, poses, markers, rng))
        told = [j for j, name in enumerate(robot.joint_names) if name not in found.untold]
        good = any(is_right(one, found.zero_std, truth, told) for one in (found.best, *found.same))
        right += good
        clear += found.clear
        clear_and_wrong += found.clear and not good
        second.append(1e3 * found.second.rms if found.second is not None else np.nan)
    counts = [f"{count} of {trials}" for count in (right, clear, clear_and_wrong)]
    return [robot.name, poses, markers, *counts, f"{min(second):.2g}"]


@click.command()
@click.option("--trials", default=TRIALS, show_default=True, help="Calibrations of each case.")
@click.option("--out", default=HERE / "found_controllers.md", type=Path, show_default=True)
def main(trials: int, out: Path) -> None:
    """Count, and write the table."""
    robots = [load_robot("kuka_kr270"), ur10()]
    rows = [run(robot, poses, 1, trials, 1) for robot in robots for poses in POSES]
    rows += [run(robot, POSES[0], 3, trials, 2) for robot in robots]
    header = [
        "robot",
        "poses",
        "markers",
        "right",
        "said to be clear",
        "clear and wrong",
        "least rms of a second best [mm]",
    ]
    noise = f"{1e3 * NOISE:g}"
    same = "; ".join(f"{robot.name} {len(same_arms(robot))}" for robot in robots)
    text = TEXT.format(
        noise=noise,
        part=100 * PART,
        within=ZERO_WITHIN,
        stds=STDS,
        same=same,
        table=markdown_table(header, rows),
    )
    write_text(out, text)
    click.echo(text)


if __name__ == "__main__":
    main()
