"""What does it cost to take a heavy robot for six springs?

    python studies/heavy_robot.py

writes heavy_robot.md and heavy_robot.png beside this file. A KUKA KR 270 with a gravity compensator
and the weights of its links (example values), whose second and third joint also give way about the
axes across their own, is simulated by `simulated_arm.py`, which shares no code with edtk. A tracker
reads its loaded and unloaded positions. `edtk.identify` fits models that have more and more of what
the robot has, and `edtk.compensate` makes commands by each; the simulated robot says how far the
loaded tool then is from where the drawing has it, over poses and loads.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from kept_promises import arm_of
from numpy.typing import NDArray
from simulated_arm import Motion, SimulatedArm

import edtk
from edtk.design.candidate_source import sample_feasible
from edtk.measure.pose_table import WRENCH_COLUMNS, pose_columns, pose_factors
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

matplotlib.use("Agg")
Array = NDArray[np.float64]
HERE = Path(__file__).parent
SEED = 2032
VISITS = 40  # two of three loaded, by one of the loads in turn
DAYS = 2
SIGMA_MM = 0.03
HEAVY = "kuka_kr270_compensator"
K = np.array([4.0, 3.0, 4.0, 28.0, 28.0, 21.0]) * 1e-7  # [rad/(N m)]
ACROSS: tuple[tuple[int, Motion], ...] = ((1, "rx"), (1, "rz"), (2, "rx"), (2, "rz"))
LATERAL = 0.25  # of the joint's own compliance
LOADS = ((0.0, 0.0, 0.0), (0.0, 0.0, -2500.0), (900.0, 1200.0, -1500.0))
FORCES = (0.0, 1000.0, 2500.0)  # of tasks, down and a third of it aside [N]
POSES = 60  # of tasks
MAPPED = 1500.0  # force of the map [N]
JOINTS = [f"q{i}" for i in range(1, 7)]
TOOL = {"position_mm": [400, 0, -200]}
SIDEWAYS = np.array([[f"q{joint + 1}.{turn}" for joint, turn in ACROSS]]).ravel().tolist()


@dataclass(frozen=True, eq=False)
class Model:
    """What is taken for the robot.

    Attributes:
        name: For people.
        robot: Its drawing.
        springs: Unknown springs.
    """

    name: str
    robot: str
    springs: Sequence[str]

    @cached_property
    def study(self) -> edtk.Study:
        """The study, whose parameters are the springs."""
        keys: dict[str, Any] = {
            "robot": self.robot,
            "tool": TOOL,
            "load": {"list_F_N": [list(force) for force in LOADS[1:]]},
            "measurement": {"sigma_mm": SIGMA_MM},
            "marker": [{"name": "A"}],
            "parameters": {
                "springs": list(self.springs),
                "geometry": [],
                "base": False,
                "tool": False,
            },
            "workspace": {"height_min_mm": 500, "radius_min_mm": 900},
            "uncertainty": {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0},
        }
        return edtk.Study(**keys)


MODELS = (
    Model("six springs", "kuka_kr270", JOINTS),
    Model("six springs, weights and compensator", HEAVY, JOINTS),
    Model("and springs across joints 2 and 3", HEAVY, [*JOINTS, *SIDEWAYS]),
)


def truth() -> SimulatedArm:
    """The robot."""
    robot = MODELS[-1].study.robot
    sizes = [LATERAL * K[joint] for joint, _ in ACROSS]
    return arm_of(robot, np.append(K, sizes)).replace(elastic=ACROSS)


def poses(count: int, number: int) -> Array:
    """Random feasible poses (count, n)."""
    study = MODELS[0].study
    space = study.space_under(study.specification.build_load())
    return sample_feasible(space, count, (SEED, number))[:, : study.robot.n]


def table(q: Array, wrench: Array) -> pd.DataFrame:
    """Poses and wrenches in units of people."""
    robot = MODELS[0].study.robot
    cells = np.hstack([q / pose_factors(robot), wrench])
    return pd.DataFrame(cells, columns=[*pose_columns(robot), *WRENCH_COLUMNS])


def sheet(arm: SimulatedArm, number: int) -> pd.DataFrame:
    """A day's readings."""
    q = poses(VISITS, number)
    forces = np.array(LOADS)[np.arange(VISITS) % len(LOADS)]
    wrench = np.hstack([forces, np.zeros((VISITS, 3))])
    rng = np.random.default_rng((SEED, number))
    x = 1e3 * arm.points(q, [arm.at], arm.rest(q, wrench))[:, 0]
    read = x + SIGMA_MM * rng.standard_normal(x.shape)
    return table(q, wrench).assign(**{f"{a}_mm": read[:, i] for i, a in enumerate("xyz")})


def loaded(force: float, count: int) -> Array:
    """Wrenches (count, 6) of a task: so much down, and a third of it aside."""
    return np.tile([0.0, force / 3, -force, 0.0, 0.0, 0.0], (count, 1))


def distance(arm: SimulatedArm, command: Array, goal: Array, wrench: Array) -> Array:
    """How far (m,) the loaded tool is from where the drawing has it [mm]."""
    there = arm.points(command, [arm.at], arm.rest(command, wrench))
    return 1e3 * np.linalg.norm((there - arm.points(goal, [arm.at]))[:, 0], axis=-1)


@dataclass(frozen=True, eq=False)
class Errors:
    """What commands leave in some poses.

    Attributes:
        q: The poses that have a command (m, n).
        real: What they are off by (m,) [mm].
        promised: What they were said to be off by (m,), root mean squares [mm].
        without: What they are off by without any compensation (m,) [mm].
    """

    q: Array
    real: Array
    promised: Array
    without: Array


def compensated(model: Model, found: object, arm: SimulatedArm, q: Array, wrench: Array) -> Errors:
    """Command some poses by a model, and look where the robot is."""
    commands = edtk.compensate(model.study, found, table(q, wrench))
    rows = commands.rows
    return Errors(
        q[rows],
        distance(arm, commands.command, q[rows], wrench[rows]),
        1e3 * np.asarray(commands.remaining),
        distance(arm, q[rows], q[rows], wrench[rows]),
    )


def rms(errors: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


@dataclass(frozen=True, eq=False)
class Cost:
    """What a model costs.

    Attributes:
        model: It.
        k: Its compliances of joints 2 and 3 on the first day [rad/(N m)].
        verdicts: What `identify` said of each day.
        real: Root mean square errors (f,) of the tasks by their forces, over poses and days [mm].
        promised: Those that were promised (f,) [mm].
        map: Errors under the force of the map on the first day.
    """

    model: Model
    k: tuple[float, float]
    verdicts: list[str]
    real: Array
    promised: Array
    map: Errors


def cost(model: Model, arm: SimulatedArm, sheets: Sequence[pd.DataFrame]) -> Cost:
    """Calibrate on some days, and compensate by each."""
    goals = poses(POSES, DAYS)
    found = [edtk.identify(model.study, one) for one in sheets]
    errors = [
        [compensated(model, one, arm, goals, loaded(force, POSES)) for force in FORCES]
        for one in found
    ]
    k = found[0].to_dict()["k"]
    grid = mapped_poses()
    return Cost(
        model,
        (k["q2"], k["q3"]),
        [one.verdict for one in found],
        np.sqrt([np.mean([rms(day[i].real) ** 2 for day in errors]) for i in range(len(FORCES))]),
        np.sqrt(
            [np.mean([rms(day[i].promised) ** 2 for day in errors]) for i in range(len(FORCES))]
        ),
        compensated(model, found[0], arm, grid, loaded(MAPPED, len(grid))),
    )


def mapped_poses() -> Array:
    """Poses of a grid over joints 2 and 3, with the tool turned aside, within the workspace."""
    study = MODELS[0].study
    two, three = np.deg2rad(np.meshgrid(np.arange(-135, -4, 6), np.arange(-60, 141, 8)))
    q = np.zeros((two.size, 6))
    q[:, 1] = two.ravel()
    q[:, 2] = three.ravel()
    q[:, 3:5] = np.deg2rad([60, 50])
    space = study.space_under(study.specification.build_load())
    choice = np.zeros((len(q), space.load.limits.shape[1]))  # of the first load: none counts here
    return q[space.at(np.hstack([q, choice])).feasible]


def without(arm: SimulatedArm) -> Array:
    """Errors (f,) without compensation [mm]."""
    goals = poses(POSES, DAYS)
    return np.array([rms(distance(arm, goals, goals, loaded(f, POSES))) for f in FORCES])


def draw(costs: Sequence[Cost], bare: Array, path: Path) -> None:
    """Maps of the errors over poses, and their sizes over loads."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(costs) + 1, figsize=(15, 4.2), layout="constrained")
    largest = max(np.quantile(one.map.real, 0.98) for one in costs)
    least = max(min(one.map.real.min() for one in costs), 1e-3)
    scale = matplotlib.colors.LogNorm(least, largest)
    arm = truth()
    for ax, one in zip(axes, costs, strict=False):
        tip = arm.points(one.map.q, [arm.at])[:, 0]
        dots = ax.scatter(tip[:, 0], tip[:, 2], c=one.map.real, norm=scale, s=14)
        ax.set(title=one.model.name, xlabel="reach of the tool, m", ylabel="height, m")
        ax.title.set_fontsize(10)
        ax.set_aspect("equal")
    figure.colorbar(dots, ax=axes[: len(costs)], label=f"error under {MAPPED:g} N, mm", shrink=0.8)
    ax = axes[-1]
    ax.semilogy(FORCES, bare, "k:", label="without compensation")
    for one in costs:
        (line,) = ax.semilogy(FORCES, one.real, "o-", label=one.model.name)
        ax.semilogy(FORCES, one.promised, "--", color=line.get_color())
    ax.set(title="real (solid) and promised (dashed)", xlabel="load, N", ylabel="error, mm")
    ax.title.set_fontsize(10)
    ax.legend(fontsize=7)
    figure.savefig(path, dpi=90)
    plt.close(figure)


HEAD = (
    "what it is taken for",
    "k2, 1e-7 rad/(N m)",
    "k3, 1e-7 rad/(N m)",
    "verdicts",
    *(f"{force:g} N, mm" for force in FORCES),
    "promised, mm",
)


def page(costs: Sequence[Cost], bare: Array) -> str:
    """The page, as Markdown."""
    rows: list[list[object]] = [
        ["no compensation", "", "", "", *(f"{one:.2f}" for one in bare), ""]
    ]
    for one in costs:
        counted = pd.Series(one.verdicts).value_counts()
        rows.append(
            [
                one.model.name,
                *(f"{1e7 * k:.2f}" for k in one.k),
                ", ".join(f"{count} {verdict}" for verdict, count in counted.items()),
                *(f"{error:.3f}" for error in one.real),
                f"{one.promised[-1]:.3f}",
            ]
        )
    return (
        "# What six springs cost on a heavy robot\n\n"
        "Written by `python studies/heavy_robot.py`.\n\n"
        "A KUKA KR 270 with a gravity compensator of 12 kN m across joint 2 and the weights of "
        "its links (example values: the built-in `kuka_kr270_compensator`), whose joints 2 and 3 "
        f"give way about the axes across their own too, {100 * LATERAL:g} % as softly as about "
        "these, is simulated by a code that shares nothing with edtk. A tracker reads the loaded "
        "and unloaded "
        f"positions of {VISITS} random visits with {SIGMA_MM:g} mm of noise per coordinate. Models "
        "that have more and more of what the robot has are fitted to the same sheets, "
        f"{DAYS} days of them; each makes commands for {POSES} other poses, under forces "
        "down and aside. The table has how far the loaded tool then is from where the drawing has "
        "it, root mean squares over poses and days, and what was promised of it under the largest "
        f"force. True are k2 = {1e7 * K[1]:g} and k3 = {1e7 * K[2]:g}.\n\n"
        f"{markdown_table(HEAD, rows)}\n\n"
        "![Errors over poses and loads](heavy_robot.png)\n"
    )


def main() -> None:
    """Write the page and its picture."""
    arm = truth()
    sheets = [sheet(arm, number) for number in range(DAYS)]
    costs = [cost(model, arm, sheets) for model in MODELS]
    bare = without(arm)
    draw(costs, bare, HERE / "heavy_robot.png")
    write_text(HERE / "heavy_robot.md", page(costs, bare))


if __name__ == "__main__":
    main()
