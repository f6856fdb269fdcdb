"""From the sheet of a plan to the program of the robot that drives through it, row by row."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from edtk.calibration.timetable import Day
from edtk.design.plan import Plan
from edtk.measure.pose_table import (
    LOAD_COLUMNS,
    VISIT_COLUMN,
    WRENCH_COLUMNS,
    pose_columns,
    pose_factors,
)
from edtk.programs.program import (
    Axis,
    Dwell,
    Move,
    Program,
    ProgramError,
    Step,
    Wait,
    axes_of,
    said,
)
from edtk.programs.writer import DECIMALS, Writer
from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

SPEED = 20.0  # percent: an arm with a load, and people beside it
DWELL_S = 2.0  # until a large arm has come to rest
STEP = 10.0**-DECIMALS  # [deg or mm]


@dataclass(frozen=True)
class Driven:
    """How an arm is to be driven through the rows of a sheet.

    Attributes:
        speed: Speed of the joint moves, in percent of what the joints can.
        dwell: Rest before each reading [s].
        handshake: The output that asks for a reading, and the input that tells that it is done;
            None where an operator starts the program again.
        home: What the controller shows (n,) where the program begins and ends [deg or mm]; None
            for none.
        axes: The controller's axes of the joints, see `axes_of`.
    """

    speed: float = SPEED
    dwell: float = DWELL_S
    handshake: tuple[str, str] | None = None
    home: tuple[float, ...] | None = None
    axes: str | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class WrittenProgram(Presented):
    """The program of a plan, and what the plan is worth as the controller takes it.

    Attributes:
        program: The program.
        brand: Name of the writer.
        title: What it writes, in words.
        files: The text of each file by its name.
        rows: Rows of the sheet.
        criterion: Name of the criterion by which plans are judged.
        efficiency: Cost of the plan as given by that of the plan as rounded; None where a plan
            leaves parameters open.
        rounding: Largest change of an axis by rounding [deg or mm].
    """

    program: Program
    brand: str
    title: str
    files: dict[str, str]
    rows: int
    criterion: str
    efficiency: float | None
    rounding: float

    def headline(self) -> str:
        """Brand, name, and how many moves."""
        return f"{self.title} program {self.program.name}, {len(self.program.moves)} moves"

    @property
    def visits(self) -> int:
        """Moves to poses at which something is measured."""
        return sum(move.rows is not None for move in self.program.moves)

    @cached_property
    def poses(self) -> int:
        """Distinct poses at which something is measured."""
        return len({move.target for move in self.program.moves if move.rows is not None})

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units, and the text of the files."""
        axes = self.program.axes
        units = [np.pi / 180 if axis.kind == "revolute" else 1e-3 for axis in axes]
        return {
            "writer": self.brand,
            "name": self.program.name,
            "rows": self.rows,
            "visits": self.visits,
            "poses": self.poses,
            "via_poses": sum(move.purpose == "via" for move in self.program.moves),
            "axes": {axis.joint: axis.place for axis in axes},
            "speed": self.program.speed_percent / 100,
            "targets": {
                name: [float(x * unit) for x, unit in zip(target, units, strict=True)]
                for target, name in self.program.targets.items()
            },
            "criterion": self.criterion,
            "efficiency_as_rounded": self.efficiency,
            "files": self.files,
        }


def program_axes(robot: Robot, places: str | None) -> tuple[Axis, ...]:
    """The controller's axes of a robot's joints, see `axes_of`."""
    kinds = [joint.kind for joint in robot.joints]
    return axes_of(robot.joint_names, kinds, places)


def taken_by(robot: Robot, writer: Writer, axes: Sequence[Axis], q: Array) -> Array:
    """What the controller takes (k, n) [deg or mm] for poses q (k, n) within its limits.

    A limit may have more digits than the controller takes: a value that rounding has led beyond it
    goes one step back.
    """
    factors = pose_factors(robot)
    signs = np.ones(robot.n) if robot.controller is None else robot.controller.sign
    taken = writer.taken(robot.shown(q) / factors, axes)
    low, high = robot.hard_limits
    again = robot.of_shown(taken * factors)
    allowed = 1.5 * STEP * factors
    beyond = 1.0 * (again > high + AT_LIMIT) - 1.0 * (again < low - AT_LIMIT)
    near = (again < high + allowed) & (again > low - allowed)
    return writer.taken(taken - signs * beyond * near * STEP, axes)


def require_limits(robot: Robot, taken: Array, names: Sequence[str]) -> None:
    """Check that a controller that shows values (k, n) [deg or mm] is within its limits.

    Raises:
        ProgramError: It is not; names the pose and the joint.
    """
    factors = pose_factors(robot)
    q = robot.of_shown(taken * factors)
    low, high = robot.hard_limits
    outside = (q > high + AT_LIMIT) | (q < low - AT_LIMIT)
    if outside.any():
        i, j = np.argwhere(outside)[0]
        joint = robot.joints[j]
        unit = "deg" if joint.kind == "revolute" else "mm"
        lower, upper = (f"{limit[j] / factors[j]:.9g}" for limit in (low, high))
        raise ProgramError(
            f"{joint.name} is {q[i, j] / factors[j]:.6g} {unit}; its limits are {lower} to "
            f"{upper} {unit}, and a controller would stop there",
            key=names[i],
        )


@dataclass(frozen=True, eq=False)
class Visits:
    """The visits of a sheet, in its order.

    Attributes:
        taken: What the controller shows (v, n) [deg or mm].
        wrench: Loads (v, 6 or 9) [N, N m, mm].
        rows: First and last row of each visit, from 1.
        paired: Whether each is read without its load, and with it.
    """

    taken: Array
    wrench: Array
    rows: list[tuple[int, int]]
    paired: bool

    @staticmethod
    def of(study: Study, table: "pd.DataFrame", writer: Writer, axes: Sequence[Axis]) -> "Visits":
        """The visits of a sheet as a controller takes them.

        Args:
            study: The study.
            table: The sheet, as `edtk.template` makes it.
            writer: Says what the controller takes.
            axes: The controller's axes.

        Raises:
            ProgramError: A pose is beyond a limit.
        """
        firsts = _first_rows(table)
        rows = [(a + 1, b) for a, b in pairwise([*firsts.tolist(), len(table)])]
        shown = table[list(pose_columns(study.robot))].to_numpy(dtype=float)[firsts]
        q = study.robot.of_shown(shown * pose_factors(study.robot))
        taken = taken_by(study.robot, writer, axes, q)
        require_limits(study.robot, taken, [said(one) for one in rows])
        loads = [name for name in (*WRENCH_COLUMNS, *LOAD_COLUMNS) if name in table]
        wrench = table[loads].to_numpy(dtype=float)[firsts]
        return Visits(taken, wrench, rows, study.kind.is_paired(study))


def _first_rows(table: "pd.DataFrame") -> Indices:
    """Indices of the rows with which visits begin."""
    if VISIT_COLUMN not in table:
        return np.arange(len(table))
    number = table[VISIT_COLUMN].to_numpy()
    return np.flatnonzero(np.r_[True, number[1:] != number[:-1]])


def load_in_words(wrench: Array) -> str:
    """Such as "Fz -2500 N", or "no load"."""
    if not wrench[:6].any():
        return "no load"
    letters = [column.rpartition("_")[0] for column in WRENCH_COLUMNS]
    parts = [f"{letter} {x:.6g}" for letter, x in zip(letters, wrench[:6], strict=True)]
    forces = ", ".join(part for part, x in zip(parts[:3], wrench[:3], strict=True) if x)
    torques = ", ".join(part for part, x in zip(parts[3:], wrench[3:6], strict=True) if x)
    texts = [f"{forces} N" if forces else "", f"{torques} Nm" if torques else ""]
    if len(wrench) > 6:
        place = " ".join(f"{x:.6g}" for x in wrench[6:])
        texts.append(f"at {place} mm")
    return ", ".join(filter(None, texts))


Vias = Mapping[tuple[int | None, int | None], Array]  # between visits, None for home


def require_free(day: Day) -> None:
    """Check that all ways of a day are free: a program must not drive along others.

    Raises:
        ProgramError: No free way leads to a step, or something touches in its pose.
    """
    for step in day.steps:
        if step.blocked is not None or step.touches:
            where = step.what if step.visit is None else f"visit {step.visit}"
            message = "no free way leads there; edtk check says what touches"
            raise ProgramError(message, key=where)


def vias_of(
    day: Day, robot: Robot, writer: Writer, axes: Sequence[Axis], order: Sequence[int]
) -> Vias:
    """What the controller takes for the via poses (s, n) between visits, by their indices.

    Args:
        day: The ways between rows of the plan.
        robot: The robot.
        writer: Says what the controller takes.
        axes: The controller's axes.
        order: The plan's row of each visit.
    """
    between = {}
    for one in day.ways:
        if one.way is not None and len(one.way.via):
            via = taken_by(robot, writer, axes, one.way.via)
            between[one.rows] = via
            between[one.rows[::-1]] = via[::-1]
    places = list(zip([None, *range(len(order))], [None, *order], strict=True))
    return {
        (start, end): between[a, b] for start, a in places for end, b in places if (a, b) in between
    }


class Station(NamedTuple):
    """A visit under a load, of a day.

    Attributes:
        visit: Index of the visit.
        loaded: Whether its load is on; a pair is read without it first, in another pass.
    """

    visit: int
    loaded: bool


def stations_of(day: Day) -> tuple[Station, ...]:
    """The visits of a day in its order, those of pairs twice."""
    return tuple(
        Station(step.visit - 1, bool(step.load.any()))
        for step in day.steps
        if step.visit is not None
    )


def steps_of(
    visits: Visits,
    driven: Driven,
    vias: Vias | None = None,
    stations: Sequence[Station] | None = None,
) -> tuple[Step, ...]:
    """The steps of a program: home, each visit with its load and readings, home.

    Loads are changed at home, where there is one. Between two places the arm goes by via poses
    where it has to.

    Args:
        visits: The visits of the sheet.
        driven: How the arm is driven.
        vias: The via poses between visits.
        stations: In which order, those of pairs in passes without a load and with it; without them
            in the order of the sheet, pairs one after the other.
    """
    between = {} if vias is None else vias
    at: int | None = None
    steps: list[Step] = []
    home = () if driven.home is None else (Move(driven.home, purpose="home"),)
    steps += home
    load = np.zeros(visits.wrench.shape[1])
    in_passes = stations is not None or not visits.paired
    for number, loaded in stations or [Station(i, True) for i in range(len(visits.rows))]:
        rows, wrench = visits.rows[number], visits.wrench[number]
        acting = wrench if loaded else np.zeros_like(wrench)
        if in_passes and (acting != load).any():
            if home and at is not None:
                steps += (*_by(between, (at, None)), *home)
                at = None
            steps.append(Wait(f"load: {load_in_words(acting)}"))
            load = acting
        taken = tuple(visits.taken[number].tolist())
        steps += [*_by(between, (at, number)), Move(taken, rows), *_rest(driven)]
        at = number
        pair = visits.paired and bool(wrench[:6].any())
        if pair and in_passes:
            how = "under load" if loaded else "without load"
            steps.append(Wait(f"{said(rows)}: read {how}", driven.handshake))
        else:
            steps += _readings(said(rows), wrench, pair, driven)
    return (*steps, *(_by(between, (at, None)) if home else ()), *home)


def _by(vias: Vias, places: tuple[int | None, int | None]) -> Iterator[Step]:
    """Moves to the via poses between two places."""
    for via in vias.get(places, ()):
        yield Move(tuple(via.tolist()), purpose="via")


def _rest(driven: Driven) -> Sequence[Step]:
    return (Dwell(driven.dwell),) if driven.dwell else ()


def _readings(rows: str, wrench: Array, paired: bool, driven: Driven) -> Iterator[Step]:
    """What is waited for in one visit."""
    signals = driven.handshake
    if not paired:
        yield Wait(f"{rows}: read", signals)
        return
    load = load_in_words(wrench)
    if signals is None:
        yield Wait(f"{rows}: read, then put on {load}")
        yield from _rest(driven)
        yield Wait(f"{rows}: read under load, then take it off")
        return
    yield Wait(f"{rows}: read without load", signals)
    yield Wait(f"{rows}: put on {load}")
    yield from _rest(driven)
    yield Wait(f"{rows}: read under load", signals)
    yield Wait(f"{rows}: take the load off")


def home_taken(robot: Robot, writer: Writer, axes: Sequence[Axis], home: Sequence[float]) -> Array:
    """A home pose as a controller takes it (n,) [deg or mm].

    Raises:
        ArgumentError: It has another number of joints.
        ProgramError: It is beyond a limit.
    """
    if len(home) != robot.n:
        names = ", ".join(robot.joint_names)
        message = f"{len(home)} values; expected one for each joint: {names}"
        raise ArgumentError(message, argument="home")
    taken = writer.taken(np.asarray(home, dtype=float), axes)
    require_limits(robot, taken[None], ["home"])
    return taken


def as_taken(robot: Robot, writer: Writer, axes: Sequence[Axis], plan: Plan) -> Plan:
    """The plan as the controller takes it."""
    taken = taken_by(robot, writer, axes, plan.q)
    return Plan(robot.of_shown(taken * pose_factors(robot)), plan.wrench, plan.repeats)
