"""Is the promised error what a robot is really off by, if it is not what the model takes it for?

    python studies/kept_promises.py FOLDER [--days 20] [--only "KR 270/friction"] [--exact]

Days in the lab, from the plan to the compensated robot: `edtk.plan` (12 experiments), or random
poses; a sheet of a simulated robot (`simulated_arm.py`, which shares no code with edtk);
`edtk.identify`; `edtk.compensate` in the test pose; and where the simulated robot then really is.
The robots have springs about axes that are none of their joints', links that bend, a stiffness that
varies, and friction. What else the promise counts is drawn: size and direction of the load, the
tool point, and the noise. With `--exact` the noise alone is drawn, and the study says that the rest
is as stated. Springs differ from day to day. With `--visits` springs are parameters of a study with
[parameters], read loaded minus unloaded; with `--absolute` they are, beside base and tool, and
positions are read in the frame of a tracker, in each pose without the load and with it.

FOLDER keeps plans and days, so that a run goes on where it was stopped. One table a run is printed,
and written to FOLDER/table.md; `--page` writes kept_promises.md beside this file, of the days in
FOLDER/drawn, FOLDER/exact, FOLDER/visits and FOLDER/absolute.
"""

import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
import pandas as pd
from fault_robots import robots
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import norm
from simulated_arm import (
    MOTIONS,
    Compensator,
    Mass,
    Motion,
    Point,
    SimulatedArm,
    bending,
)

import edtk
from edtk.design.candidate_source import sample_feasible
from edtk.fit.correlated_noise import whiten_columns
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    WRENCH_COLUMNS,
    pose_columns,
    pose_factors,
)
from edtk.measure.task import Task
from edtk.report.tables import markdown_table
from edtk.robots.compensator import Compensator as Drawn
from edtk.system.errors import UserError
from edtk.system.files import write_text

Array = NDArray[np.float64]
HERE = Path(__file__).parent
SEED = 2030
SIZE = 12
DAYS = 20
SPREAD = 0.2  # of the springs from day to day, relative
POSES = 20  # of tasks beside the test pose, all under its load
POSITION_COLUMNS = ("Ax_mm", "Ay_mm", "Az_mm")
AROUND = (-2.0, 2.0)  # [rad] joint 1 where positions are read
SEARCHES = 4  # for optimal plans: equally good ones differ in what they tell of friction

LATERAL = (0.1, 0.3)  # of the joint's own compliance, about each axis across it
OF_LINK = 0.2  # by which a link's end turns for a torque, of the turn of the joint at its root
SHORTEST = 0.01  # link that bends [m]
TWIST = 0.8  # torsional stiffness over flexural one, of a pipe
VARYING = 0.15
SOFTER = 2.0  # springs of the small arm, so that its load of 10 kg moves it by some millimetres

HEAD = (
    "robot",
    "truth",
    "poses",
    "good / usable / bad",
    "promise, mm",
    "real, mm",
    "real / promise",
    "in band",
    "in band, other poses",
    "good, and twice off",
    "named first",
)


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot to be calibrated.

    Attributes:
        study: Its study: the drawing, the loads, the noise, the test pose, and what is true of its
            springs.
        arm: The simulated robot of the drawing, with springs in its joints alone.
        held: Share of each joint's mean load in calibration that friction holds.
        asked: The study that is asked, the same or another one of this robot.
        absolute: Whether positions are read, without the load and with it, and no displacements.
    """

    study: edtk.Study
    arm: SimulatedArm
    held: float
    asked: edtk.Study
    absolute: bool = False

    @classmethod
    def of(cls, study: edtk.Study, held: float) -> "Scene":
        """The robot of a study, whose compliances are those of [simulation]."""
        return cls(study, arm_of(study.robot, np.array(study.compliances)), held, study)

    def by_readings(self, absolute: bool) -> "Scene":
        """The same, asked as a study with [parameters]: of displacements, or of positions."""
        asked = self.study.replace(
            joints={} if absolute else {"fixed_deg": {"q1": 0}},
            parameters={
                "compliance": list(self.study.robot.joint_names),
                "geometry": [],
                "base": absolute,
                "tool": absolute,
            },
            marker=[{"name": "A"}],
            measurement={
                "sigma_mm": 1e3 * self.reading,
                "reference": "instrument" if absolute else "unloaded",
            },
        )
        return replace(self, asked=asked, absolute=absolute)

    @property
    def reading(self) -> float:
        """Standard deviation of one reading [m]; a displacement is the difference of two."""
        return float(self.study.sigma[0]) / np.sqrt(2)

    @property
    def sure(self) -> "Scene":
        """The same, asked as a study that says that loads and tool are exactly as stated."""
        return replace(self, asked=self.asked.replace(uncertainty=SURE))


def arm_of(robot: edtk.Robot, compliance: Array) -> SimulatedArm:
    """The simulated arm of a drawing, with springs (n,) of its drives, weights and compensators."""
    ties = robot.ties
    return SimulatedArm(
        coupling=None if ties is None else ties.matrix,
        offset=None if ties is None else ties.offset,
        origins=np.array([joint.origin for joint in robot.chain]),
        axes=np.array([joint.axis for joint in robot.chain]),
        slides=tuple(joint.kind == "prismatic" for joint in robot.chain),
        compliance=compliance,
        base=robot.base,
        tool=robot.tool,
        masses=tuple(Mass(link.mass, Point(j, link.center)) for j, link in enumerate(robot.links)),
        compensators=tuple(_compensator(robot, one) for one in robot.compensators),
    )


def _compensator(robot: edtk.Robot, one: Drawn) -> Compensator:
    """A compensator of a drawing; of a gas the slope is relative to the force."""
    joint = robot.body_names.index(one.joint)
    if one.medium == "gas":
        slope = one.stiffness / one.preload
        return Compensator(joint, one.before, one.behind, one.preload, slope=slope)
    return Compensator(joint, one.before, one.behind, one.preload, one.stiffness)


def scenes() -> dict[str, Scene]:
    """The two robots by name: six unknown springs, one of three loads in each experiment."""
    weight = 98.1
    small = robots()["UR10, 10 kg"]
    given = small.specification.simulation.compliance_rad_per_Nm
    springs = {name: SOFTER * k for name, k in ({"q1": 4e-5} | given).items()}
    small = small.replace(
        load={"list_F_N": [[0, 0, -weight], [weight, 0, 0], [0, weight, 0]]},
        joints={"unknown": list(springs), "fixed_deg": {"q1": 0}},
        simulation={"compliance_rad_per_Nm": springs},
    )
    large = edtk.load_study(HERE / "kr270_six_compliances.toml")
    return {"KR 270": Scene.of(large, 0.04), "UR-like arm": Scene.of(small, 0.15)}


Truth = Callable[[Scene, Array, Array, np.random.Generator], SimulatedArm]


def ideal(scene: Scene, q: Array, wrench: Array, rng: np.random.Generator) -> SimulatedArm:
    """Springs in the joints alone."""
    return scene.arm


def lateral(share: float) -> Truth:
    """Springs about both axes across those of joints 2 and 3, of such a share of their own.

    From day to day the share is half as large to one and a half times as large.
    """

    def make(scene: Scene, q: Array, wrench: Array, rng: np.random.Generator) -> SimulatedArm:
        arm = scene.arm
        turns = MOTIONS[3:]
        across = [
            (joint, turns[axis])
            for joint in (1, 2)
            for axis in range(3)
            if abs(arm.axes[joint][axis]) < 0.5
        ]
        shares = share * rng.uniform(0.5, 1.5, len(across))
        sizes = shares * [arm.compliance[joint] for joint, _ in across]
        return arm.replace(elastic=tuple(across), compliance=np.append(arm.compliance, sizes))

    return make


def links(scene: Scene, q: Array, wrench: Array, rng: np.random.Generator) -> SimulatedArm:
    """Links between joints bend and twist as pipes do."""
    arm = scene.arm
    elastic: list[tuple[int, Motion]] = []
    parts = [np.diag(arm.compliance)]
    for joint, origin in enumerate(arm.origins):
        link = origin[:3, 3]
        length = float(np.linalg.norm(link))
        if joint and length > SHORTEST:
            flexural = length / (OF_LINK * arm.compliance[joint - 1])
            # The end of a link is held by the frame of the next joint, along whose axes it moves.
            beam = bending(origin[:3, :3].T @ link, flexural, TWIST * flexural)
            elastic += [(joint, motion) for motion in MOTIONS]
            parts.append(beam)
    size = sum(len(part) for part in parts)
    C = np.zeros((size, size))
    start = 0
    for part in parts:
        end = start + len(part)
        C[start:end, start:end] = part
        start = end
    return arm.replace(elastic=tuple(elastic), compliance=C)


def varying(scene: Scene, q: Array, wrench: Array, rng: np.random.Generator) -> SimulatedArm:
    """Stiffnesses of joints vary with their angles, once in a turn."""
    phase = rng.uniform(0, 2 * np.pi, scene.arm.drives)
    return scene.arm.replace(varying=VARYING, phase=phase)


def friction(scene: Scene, q: Array, wrench: Array, rng: np.random.Generator) -> SimulatedArm:
    """Friction holds a part of each joint's mean load in the day's poses."""
    arm = scene.arm
    loads = np.abs(arm.loads(q, wrench, np.zeros((len(q), arm.size))))
    return arm.replace(friction=scene.held * loads.mean(axis=0))


TRUTHS: dict[str, Truth] = {
    "six ideal springs": ideal,
    **{f"lateral springs of {100 * share:g} %": lateral(share) for share in LATERAL},
    "links that bend": links,
    f"stiffness +-{100 * VARYING:g} % by position": varying,
    "friction takes a part": friction,
}
# Ways to choose poses: for the noise alone, at random, and counting what the model leaves out.
PLANS = ("optimal", "random", "counted")
COUNTED = {"model_error_percent": 10}
SURE = {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0}


@dataclass(frozen=True)
class Case:
    """A robot, what is true of it, the poses it is calibrated in, and the number of the day."""

    robot: str
    truth: str
    poses: str
    day: int = 0

    @property
    def name(self) -> str:
        """For people, without the day."""
        return f"{self.robot}/{self.truth}/{self.poses}"

    @property
    def key(self) -> str:
        """In the file of days."""
        return f"{self.name}/{self.day}"

    @property
    def seed(self) -> tuple[int, ...]:
        """Of the day's randomness: the same in all truths."""
        return (SEED, PLANS.index(self.poses), self.day)


def sheet(
    scene: Scene, plan: edtk.Plan, truth: Truth, exact: bool, rng: np.random.Generator
) -> tuple[pd.DataFrame, SimulatedArm]:
    """The sheet that is filled in on a day, and the robot that it was filled in with."""
    study = scene.study
    q = np.repeat(plan.q, plan.repeats, axis=0)
    written = np.repeat(plan.wrench, plan.repeats, axis=0)
    soft = scene.arm.compliance * np.exp(SPREAD * rng.standard_normal(scene.arm.size))
    arm = truth(replace(scene, arm=scene.arm.replace(compliance=soft)), q, written, rng)
    given = study.specification.uncertainty
    drawn = 0.0 if exact else 1.0
    turn = Rotation.from_rotvec(
        drawn * np.deg2rad(given.load_direction_deg) * rng.standard_normal(3)
    )
    size = 1 + drawn * given.load_percent / 100 * rng.standard_normal()
    acts = size * np.hstack([turn.apply(written[:, :3]), turn.apply(written[:, 3:])])
    tool = arm.tool.copy()
    tool[:3, 3] += tool[:3, :3] @ (drawn * 1e-3 * given.tool_mm * rng.standard_normal(3))
    seen = arm.replace(tool=tool)
    columns = DEFLECTION_COLUMNS
    if scene.absolute:
        columns = POSITION_COLUMNS
        q, written, acts = (np.repeat(one, 2, axis=0) for one in (q, written, acts))
        written[::2] = acts[::2] = 0.0
        # Positions in several directions from the base tell where it stands.
        q[:, 0] = np.repeat(rng.uniform(*AROUND, len(q) // 2), 2)
        d = seen.points(q, [seen.at], seen.rest(q, acts))[:, 0]
        d = d + scene.reading * rng.standard_normal(d.shape)
    else:
        d = moved(seen, q, acts) + study.sigma[:3] * rng.standard_normal((len(q), 3))
    names = [*pose_columns(study.robot), *WRENCH_COLUMNS, *columns]
    cells = np.hstack([q / pose_factors(study.robot), written, 1e3 * d])
    return pd.DataFrame(cells, columns=names), arm


def moved(arm: SimulatedArm, q: Array, wrench: Array) -> Array:
    """By how much wrenches (m, 6) move the tool point (m, 3) of an arm at rest [m]."""
    at = [arm.at]
    still = arm.points(q, at, arm.rest(q, np.zeros(6)))
    return (arm.points(q, at, arm.rest(q, wrench)) - still)[:, 0]


def task_of(scene: Scene) -> Task:
    """The test pose."""
    task = scene.study.task
    assert task is not None
    return task


def tasks(scene: Scene) -> tuple[Array, Array]:
    """The test pose and further poses (t, n), and the test pose's wrench for all (t, 6)."""
    task = task_of(scene)
    others = sample_feasible(scene.study.space, POSES, (SEED, 1))[:, : scene.study.robot.n]
    q = np.vstack([task.q.reshape(1, -1), others])
    return q, np.tile(task.wrench.reshape(1, -1), (len(q), 1))


def one_day(scene: Scene, plan: edtk.Plan, case: Case, exact: bool) -> dict[str, object]:
    """Calibrate, compensate, and look where the robot is."""
    rng = np.random.default_rng(case.seed)
    study = scene.asked
    table, arm = sheet(scene, plan, TRUTHS[case.truth], exact, rng)
    start = time.process_time()
    try:
        found = edtk.identify(study, table)
    except UserError as error:
        return {"verdict": "bad", "refused": str(error)}
    q, wrench = tasks(scene)
    arm = arm.replace(tool=task_of(scene).model.robot.tool)
    goals = pd.DataFrame(
        np.hstack([q / pose_factors(study.robot), wrench]),
        columns=[*pose_columns(study.robot), *WRENCH_COLUMNS],
    )
    commands = edtk.compensate(study, found, goals)
    seconds = time.process_time() - start
    rows = commands.rows
    there = arm.points(commands.command, [arm.at], arm.rest(commands.command, wrench[rows]))
    # Commands are for where the robot of the drawing fits the positions best.
    frame = found.fit.fitted.model.start if scene.absolute else np.eye(4)
    goal = arm.points(q[rows], [arm.at]) @ frame[:3, :3].T + frame[:3, 3]
    error = np.linalg.norm((there - goal)[:, 0], axis=-1)
    inside = within(error, commands.band)
    remaining = commands.remaining
    assert rows[0] == 0
    return {
        "verdict": found.verdict,
        "promise_mm": 1e3 * remaining[0],
        "real_mm": 1e3 * error[0],
        "inside": float(inside[0]),
        "inside_others": float(inside[1:].mean()),
        "real_others_mm": float(1e3 * np.sqrt(np.mean(error[1:] ** 2))),
        "promise_others_mm": float(1e3 * np.sqrt(np.mean(remaining[1:] ** 2))),
        "findings": [one.kind for one in found.findings],
        "causes": [f"{one.cause} {one.joint}".strip() for one in getattr(found, "causes", ())],
        "seconds": round(seconds, 3),
    }


def stands_out(scene: Scene, plan: edtk.Plan) -> float:
    """Standard deviations by which friction stands out in the sheet of a plan.

    Of what friction does to the readings, ``d`` in units of their noise, springs and what else the
    study doubts take up a part; the length of the rest is the distance of two normal densities, one
    of which has friction. Who knew both would take one for the other with the chance Phi(-d/2).
    """
    rng = np.random.default_rng((SEED, 3))
    table, arm = sheet(scene, plan, friction, True, rng)
    fitted = edtk.identify(scene.asked, table).fitted
    data, found = fitted.data, fitted.model_error
    there, free = (moved(one, data.q, data.wrench) for one in (arm, arm.replace(friction=None)))
    columns = [fitted.A, found.shown.known, (there - free)[..., None]]
    X = whiten_columns(np.concatenate(columns, axis=-1), data.noise).reshape(3 * len(data), -1)
    own, doubted = fitted.A.shape[-1], found.shown.known.shape[-1]
    doubts = np.eye(doubted, own + doubted + 1, own)
    X = np.vstack([X, doubts])
    size = np.linalg.norm(X, axis=0)
    R = np.linalg.qr(X[:, size > 0] / size[size > 0], mode="r")
    return float(abs(R[-1, -1]) * size[-1])


def told_apart(robot: str, scene: Scene, folder: Path) -> str:
    """How far friction stands out in sheets of the optimal plans, in words."""
    cases = [Case(robot, "friction takes a part", "optimal", day) for day in range(SEARCHES)]
    plans = [plan_of(scene, case, folder / "drawn") for case in cases]
    told, sure = (sorted(stands_out(one, plan) for plan in plans) for one in (scene, scene.sure))
    shares = sorted(100 * norm.cdf(-np.array(told) / 2))
    return APART.format(robot=robot, told=told, sure=sure, shares=shares)


def within(errors: Array, band: Array | None) -> Array:
    """Whether errors (t,) are within bands (t, 2); NaN where no band is told."""
    if band is None:
        return np.full(len(errors), np.nan)
    return ((band[:, 0] <= errors) & (errors <= band[:, 1])).astype(float)


def plan_of(scene: Scene, case: Case, folder: Path) -> edtk.Plan:
    """The plan of a day: one of some that a search finds, which are kept, or random poses."""
    study = scene.study
    if case.poses == "random":
        u = sample_feasible(study.space, SIZE, (SEED, 2, case.day))
        n = study.robot.n
        wrench = np.asarray(study.space.load.wrench(u[:, n:]))
        return edtk.Plan(u[:, :n], wrench, np.ones(SIZE, dtype=int))
    counts = case.poses == "counted"
    asked = study.replace(noise=COUNTED) if counts else scene.asked
    search = 0 if counts else case.day % SEARCHES
    path = folder / f"{case.robot} {case.poses} {search}.csv"
    if not path.exists():
        edtk.plan(asked, size=SIZE, seed=SEED + search, out=path)
    return edtk.Plan.from_frame(pd.read_csv(path), study.robot)


def read_days(path: Path) -> dict[str, dict[str, object]]:
    """Days that were simulated before, by key."""
    if not path.exists():
        return {}
    lines = path.read_text().splitlines()
    return {day["key"]: day for day in map(json.loads, lines)}


def rows_of(days: dict[str, dict[str, object]], cases: Sequence[Case]) -> Iterator[list[object]]:
    """Rows of the table, one a case."""
    for name in dict.fromkeys(case.name for case in cases):
        some = pd.DataFrame([days[c.key] for c in cases if c.name == name and c.key in days])
        if not len(some):
            continue
        counts = [int((some.verdict == one).sum()) for one in ("good", "usable", "bad")]
        told = some.dropna(subset=["real_mm"]) if "real_mm" in some else some.iloc[:0]
        verdicts = " / ".join(map(str, counts))
        if not len(told):
            yield [*name.split("/"), verdicts, *[""] * 7]
            continue
        ratio = (told.real_mm / told.promise_mm).median()
        bad = ((told.verdict == "good") & (told.real_mm > 2 * told.promise_mm)).sum()
        yield [
            *name.split("/"),
            verdicts,
            f"{told.promise_mm.median():.3f}",
            f"{told.real_mm.median():.3f}",
            f"{ratio:.2f}",
            *(share(told[one]) for one in ("inside", "inside_others")),
            int(bad),
            named(some),
        ]


def named(some: pd.DataFrame) -> str:
    """The cause that is named first most often, and how often."""
    if "causes" not in some:
        return ""
    first = [causes[0].split()[0] for causes in some.causes if isinstance(causes, list) and causes]
    counts = pd.Series(first, dtype=object).value_counts()
    return f"{counts.index[0]} {counts.iloc[0]}" if len(counts) else "-"


def share(told: pd.Series) -> str:
    """The mean of shares [%]; a dash where no band is told."""
    mean = told.mean()
    return "-" if np.isnan(mean) else f"{100 * mean:.0f} %"


def all_cases(days: int, only: Sequence[str], plans: Sequence[str] = PLANS) -> list[Case]:
    """The cases whose name contains one of some words, or all."""
    every = [
        Case(robot, truth, poses, day)
        for robot in scenes()
        for truth in TRUTHS
        for poses in plans
        for day in range(days)
    ]
    return [case for case in every if not only or any(word in case.name for word in only)]


@dataclass(frozen=True)
class Way:
    """How days are simulated, and what is asked.

    Attributes:
        exact: Whether the noise alone is drawn, as the study then says.
        visits: Whether springs are parameters of a study with [parameters].
        absolute: Whether positions are read then, and no displacements.
    """

    exact: bool = False
    visits: bool = False
    absolute: bool = False

    def asks(self, scene: Scene) -> Scene:
        """A scene whose study knows this."""
        scene = scene.by_readings(self.absolute) if self.visits or self.absolute else scene
        return scene.sure if self.exact or self.absolute else scene

    @property
    def plans(self) -> Sequence[str]:
        """Ways to choose poses that are simulated."""
        return ("random",) if self.absolute else PLANS

    @property
    def words(self) -> str:
        """For people."""
        if self.absolute:
            return (
                "Studies with `[parameters]` of springs, base and tool, by positions without the "
                "load and with it"
            )
        if self.visits:
            return "Studies with `[parameters]`, whose circumstances are exact, as they say"
        if self.exact:
            return "Load, direction and tool are exact, as the study says: the noise alone is drawn"
        return (
            "Size and direction of the load and the tool point are drawn as the study doubts them"
        )


WAYS = {
    "drawn": Way(),
    "exact": Way(exact=True),
    "visits": Way(exact=True, visits=True),
    "absolute": Way(exact=True, absolute=True),
}


def table(folder: Path, cases: Sequence[Case], way: Way) -> str:
    """Simulate the days that are missing, and put all of them into a table."""
    folder.mkdir(parents=True, exist_ok=True)
    store = folder / "days.jsonl"
    found = read_days(store)
    every = {name: way.asks(scene) for name, scene in scenes().items()}
    with store.open("a") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for case in cases:
            if case.key not in found:
                scene = every[case.robot]
                day = one_day(scene, plan_of(scene, case, folder), case, way.exact)
                found[case.key] = {"key": case.key, **day}
                file.write(json.dumps(found[case.key]) + "\n")
                file.flush()
    rows = markdown_table(HEAD, list(rows_of(found, cases)))
    (folder / "table.md").write_text(rows + "\n")
    return rows


def page(folder: Path) -> str:
    """Tables of the days that are there as a page, as Markdown."""
    apart = "\n".join(told_apart(name, scene, folder) for name, scene in scenes().items())
    parts = []
    fewest = DAYS
    for name, way in WAYS.items():
        found = read_days(folder / name / "days.jsonl")
        if found:
            most = 1 + max(int(key.rsplit("/", 1)[1]) for key in found)
            rows = markdown_table(HEAD, list(rows_of(found, all_cases(most, (), way.plans))))
            each = pd.Series([key.rsplit("/", 1)[0] for key in found]).value_counts()
            few = "" if each.min() == each.max() else f"{each.min()} to "
            days = f"{few}{each.max()} days of each"
            parts.append(f"## {way.words} ({days})\n\n{rows}")
            fewest = min(fewest, int(each.min()))
    numbers = {"size": SIZE, "poses": POSES, "searches": SEARCHES, "fewest": fewest}
    head = INTRODUCTION.format(apart=apart, share=100 / fewest, **numbers)
    return "\n\n".join([head, *parts]) + "\n"


INTRODUCTION = """# Promises, kept and broken

Written by `python studies/kept_promises.py FOLDER --page` of days in FOLDER/drawn, FOLDER/exact,
FOLDER/visits and FOLDER/absolute.

A robot is calibrated with a model of six springs, and is not six springs: joints 2 and 3 give way
about the axes across their own too, by a share of their own compliance; links bend and twist;
stiffnesses vary with the angle; friction holds a part of the load. Each row has simulated days,
from a plan of {size} experiments, or as many random poses, to the robot that is compensated in
the test pose. *Optimal* plans are for the noise alone, of {searches} searches in turn; *counted*
ones count what springs leave out, `model_error_percent = 10` in `[noise]`; studies with
`[parameters]` are asked for the same counted poses. The simulated robot shares no code with edtk.

- *promise*: the error that `edtk compensate` expects in the test pose, a root mean square (median
  of the days);
- *real*: how far the simulated robot is off there (median);
- *in band*: share of days on which that is inside the 95 % band of `edtk compensate`, and the same
  in {poses} other poses;
- *good, and twice off*: days with the verdict "good" on which the robot is off by more than twice
  the promise;
- *named first*: the cause that `edtk identify` names first on most days, and on how many.

Where the noise alone is drawn, the study says so, and doubts neither load nor tool. One that doubts
the size of its load by 1 % and its direction by 1 degree promises 0.02 mm for that alone, of the
KR 270 in its test pose; ideal springs under a load that happens to be exact are 0.003 mm off. One
promise cannot be right for both.
Of few days a share is rough; one day in {fewest} is {share:.0f} %.

An optimal plan loads every joint as much as it can, under which friction looks like a stiffer
joint. Plans that are as good as each other differ in what they tell of it:

{apart}

The promise is the median over what the sheet leaves possible: about what friction leaves on days
whose sheets tell it, and what ideal springs leave on others. So most days of such plans are
"usable", and say that friction is not told. Of friction it is known before that it holds back, in
all joints about alike, and that it never holds more than the load: a joint whose load in the task
is a tenth of that in calibration may lose most of it. Links that bend are springs at their ends
and in their middle, as beams are; without those of the middle, their sheets look like friction.
Springs across the joints are left to the task as they are: where they are all that is missing,
poses near the optimum, whose springs take them up for the task, may leave less.

A normal error along one direction is more than twice its root mean square on 5 % of days, so that
of twenty "good" days of an honest promise one may be off by more than twice."""

APART = (
    "- {robot}: it stands out by {told[0]:.1f} to {told[3]:.1f} standard deviations ({sure[0]:.1f} "
    "to {sure[3]:.1f} where load\n  and tool are known), springs and doubts fitted. Who knew the "
    "friction would still take a robot\n  with it for one without on {shares[0]:.2g} to "
    "{shares[3]:.2g} % of days."
)


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--days", default=DAYS, help="Days of each case.")
@click.option("--only", multiple=True, help="Part of the names of cases to look at; repeat it.")
@click.option("--exact", is_flag=True, help="Draw the noise alone, and say so.")
@click.option("--visits", is_flag=True, help="Ask studies with [parameters].")
@click.option("--absolute", is_flag=True, help="Ask them for base and tool, too, by positions.")
@click.option("--page", "whole", is_flag=True, help="Write kept_promises.md, of days at hand.")
def main(
    folder: Path,
    days: int,
    only: Sequence[str],
    exact: bool,
    visits: bool,
    absolute: bool,
    whole: bool,
) -> None:
    """Simulate what is missing, and print the table."""
    os.nice(10)
    if whole:
        write_text(HERE / "kept_promises.md", page(folder))
        return
    way = Way(exact, visits, absolute)
    click.echo(table(folder, all_cases(days, only, way.plans), way))


if __name__ == "__main__":
    main()
