"""Task poses from a file, tools and loads that the robot has in them, and rows without answer."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from edtk.design.plan import Plan
from edtk.findings.finding import Finding, Severity, Wording
from edtk.findings.units import like_radians
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.pose_table import Table
from edtk.measure.task import Task
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.study.study_model import largest_force
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices

MOST_NAMED = 3  # rows that a sentence names one by one
FACTOR = 10.0  # up to which a ratio is that of units which are a thousand apart
A_THOUSAND = 1e3
# Displacement over the arm's reach beyond which no arm is used: it would give way by decimetres.
TOO_SOFT = 0.05


@dataclass(frozen=True)
class RefusedRow:
    """A row that is left out, and why.

    Attributes:
        row: The row, counted from 0.
        reason: What is wrong with it.
        column: The column at fault; empty if none is.
    """

    row: int
    reason: str
    column: str = ""

    @property
    def place(self) -> str:
        """Row, counted from 1, and column."""
        return f"row {self.row + 1}" + (f", column {self.column}" if self.column else "")

    @property
    def text(self) -> str:
        """One line."""
        return f"{self.place}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """For JSON; rows are counted from 1 there."""
        return {"row": self.row + 1, "column": self.column or None, "reason": self.reason}


class RefusedRowsError(Exception):
    """Some rows of a batch have no answer.

    Args:
        rows: Those rows, in their order.
    """

    def __init__(self, rows: Sequence[RefusedRow]) -> None:
        super().__init__(rows[0].text)
        self.rows = tuple(rows)


class NoRowError(UserError):
    """No row of a task has an answer; the message says why of the first one.

    Args:
        rows: All rows.
        where: Their file.

    Attributes:
        rows: As given.
    """

    def __init__(self, rows: Sequence[RefusedRow], where: Path | str) -> None:
        first = min(rows, key=lambda row: row.row)
        super().__init__(first.reason, where=where, key=first.place)
        self.rows = tuple(rows)


def require_one(answered: int, refused: Sequence[RefusedRow], where: Path | str) -> None:
    """Check that a row at least has an answer.

    Raises:
        NoRowError: None has.
    """
    if answered or not refused:
        return
    raise NoRowError(refused, where)


def refused_lines(refused: Sequence[RefusedRow]) -> tuple[str, ...]:
    """How many rows are left out, then why each of the first of them is; empty for none."""
    if not refused:
        return ()
    number = f"{len(refused)} row{'s' * (len(refused) > 1)} left out"
    more = len(refused) - MOST_NAMED
    also = [f"and {more} more"] if more > 0 else []
    return (number, *(row.text for row in refused[:MOST_NAMED]), *also)


def refused_in_words(refused: Sequence[RefusedRow]) -> str:
    """`refused_lines` in one; empty for none."""
    number, *reasons = refused_lines(refused) or ("",)
    return f"{number}: {'; '.join(reasons)}" if reasons else ""


def load_task(study: Study, path: Table | None = None) -> Plan:
    """Read task poses, columns as in a plan; without wrench columns, the test pose's load acts.

    A file without them goes with test poses of one and the same load. Joints that the study fixes
    may be left out, as in a plan. A column `repeats` means nothing.

    Args:
        study: Robot and test poses; without any, one of [parameters] has no load.
        path: The CSV file, or a data frame that holds what it would; None for the poses
            of the study itself.

    Raises:
        UserError: The study has no test pose where it needs one, or some with different tools, or
            the file cannot be read; names the row and the column.
    """
    if path is not None:
        return Plan.from_csv(path, study.robot, study.fixed, _load_of_all(study))
    if not study.tasks and study.kind.task.wrench is not None:
        message = "expected poses (CSV), as the study has no test pose"
        raise ArgumentError(message, argument="task")
    require_task(study)
    poses = np.array([task.q for task in study.tasks])
    wrenches = np.array([task.wrench for task in study.tasks])
    return Plan(poses, wrenches, np.ones(len(poses), dtype=int))


def _load_of_all(study: Study) -> Array | None:
    """The wrench (6,) of all tasks; where they have several, or none, that of such a study.

    Raises:
        UserError: A study of compliances has no test pose, or test poses have several tools.
    """
    default = study.kind.task.wrench
    if not study.tasks and default is not None:
        return default
    wrench = task_of_all(study).wrench
    same = all(np.array_equal(task.wrench, wrench) for task in study.tasks)
    return wrench if same else default


def loaded_poses(study: Study, q: Array) -> Plan:
    """Poses in which the load of the study's task acts.

    Args:
        study: Robot and test poses; without any, one of [parameters] has no load.
        q: Joint variables (t, n) [rad or m].

    Raises:
        UserError: A study of compliances has no test pose, or test poses have several tools or
            loads.
    """
    wrench = _load_of_all(study)
    if wrench is None:
        message = "the test poses have different loads; expected one, as a program states none"
        raise study.error("test_pose", message)
    return Plan(q, np.tile(wrench, (len(q), 1)), np.ones(len(q), dtype=int))


def require_task(study: Study) -> None:
    """Check that a study has a task.

    Raises:
        UserError: It has none.
    """
    if not study.tasks:
        message = "expected a table with the tool and the load of the task; the study has none"
        raise study.error("test_pose", message)


def task_of_all(study: Study) -> Task:
    """Find the first task of a study, whose tool and payload all others share.

    Args:
        study: Robot and tasks.

    Raises:
        UserError: The study has no task, or tasks with several tools or payloads.
    """
    require_task(study)
    first = study.tasks[0]
    if len({_tool(task) for task in study.tasks}) > 1:
        message = "the test poses have different tools; expected one, or no file of other poses"
        raise study.error("test_pose", message)
    if len({pose.payload for pose in study.specification.test_poses}) > 1:
        message = "the test poses have different payloads; expected one, or no file of other poses"
        raise study.error("test_pose", message)
    return first


def _tool(task: Task) -> bytes:
    """What differs where tools do; empty where the markers count."""
    return b"" if task.tool is None else task.placed.tool.tobytes()


@dataclass(frozen=True, eq=False)
class ToolInUse:
    """A tool with a payload, and the poses in which the robot has them.

    Attributes:
        rows: Indices of the poses.
        task: One of the tasks that have them.
    """

    rows: Indices
    task: Task

    @property
    def robot(self) -> Robot:
        """The chain with the tool."""
        return self.task.placed

    def model(self, joints: tuple[int, ...], k: Array) -> ElastostaticModel:
        """The robot with what loads it besides wrenches, about compliances k (n,) [rad/(N m)]."""
        gives = self.robot.giving_way(k, brought=True)
        return replace(self.task.model, unknown=joints, gives=gives)


def tools_of_task(study: Study, poses: int, own: bool) -> tuple[ToolInUse, ...]:
    """Find the tools in which task poses are meant.

    Args:
        study: Robot and test poses.
        poses: Number of poses.
        own: Whether these are the test poses of the study, of which each says its own tool.

    Raises:
        UserError: The study has no task, or other poses go with test poses of several tools.
    """
    given = study.specification.test_poses
    if not own or not given:
        return (ToolInUse(np.arange(poses), task_of_all(study)),)
    pairs = zip(study.tasks, given, strict=True)
    keys = [(_tool(task), one.payload) for task, one in pairs]
    found = []
    for key in dict.fromkeys(keys):
        rows = np.array([i for i, other in enumerate(keys) if other == key])
        found.append(ToolInUse(rows, study.tasks[int(rows[0])]))
    return tuple(found)


def task_findings(study: Study, k: Mapping[str, float], task: Plan) -> tuple[Finding, ...]:
    """Compare poses, loads and compliances with the sizes that they have in their units.

    Args:
        study: Robot, test poses, and assumed compliances.
        k: Compliances by joint [rad/(N m)].
        task: Desired poses and wrenches.

    Returns:
        What looks like another unit; nothing where all is plausible.
    """
    known = [np.linalg.norm(np.atleast_2d(one.wrench)[:, :3], axis=1).max() for one in study.tasks]
    expected = float(max(known, default=0.0))
    forces = _forces(task.wrench, expected, "the task", "test pose")
    return (*_angles(study, task.q), *forces, *_sizes(study, k, task))


def reading_findings(
    study: Study, k: Mapping[str, float], data: Measurements | MarkerPositions
) -> tuple[Finding, ...]:
    """The same of poses in which readings are predicted, beside the loads of the study."""
    forces = _forces(data.wrench, largest_force(study), "the file", "loads")
    poses = Plan(data.q, data.wrench, np.ones(len(data.q), dtype=int))
    return (*forces, *_sizes(study, k, poses))


def _angles(study: Study, q: Array) -> Iterator[Finding]:
    """Joint angles in radians."""
    if like_radians(study, q):
        yield Finding.of(Severity.WARNING, WORDING, "angle_unit")


def _forces(wrench: Array, expected: float, whose: str, beside: str) -> Iterator[Finding]:
    """Forces a thousand times smaller, or larger, than those of the study."""
    applied = float(np.linalg.norm(wrench[:, :3], axis=1).max(initial=0.0))
    for factor, unit in ((1 / A_THOUSAND, "kilonewtons"), (A_THOUSAND, "millinewtons")):
        if _is_near(applied, factor * expected):
            data = {"ratio": applied / expected, "unit": unit, "whose": whose, "beside": beside}
            yield Finding.of(Severity.WARNING, WORDING, "force_unit", **data)


def _sizes(study: Study, k: Mapping[str, float], task: Plan) -> Iterator[Finding]:
    """Compliances a thousand times those assumed, or by which the load moves the arm far."""
    simulation = study.specification.simulation
    given = {} if simulation is None else simulation.compliance_rad_per_Nm
    ratios = np.array([k[name] / given[name] for name in k if k[name] > 0 and name in given])
    ratio = float(np.median(ratios)) if len(ratios) else 1.0
    if _is_near(ratio, A_THOUSAND):
        yield Finding.of(Severity.WARNING, WORDING, "compliance_unit", ratio=ratio)
        return
    moved = _displacement(study, k, task)
    if moved > TOO_SOFT * study.robot.reach:
        yield Finding.of(Severity.WARNING, WORDING, "soft_arm", moved=moved)


def _displacement(study: Study, k: Mapping[str, float], task: Plan) -> float:
    """What the load moves the tool point by, to the first order and at most [m]."""
    robot = study.robot
    joints = [robot.joint_names.index(name) for name in k]
    J = robot.jacobian(task.q)[:, :, joints]
    torque = np.einsum("trj,tr->tj", J, task.wrench)
    moved = np.einsum("trj,tj->tr", J[:, :3], torque * np.array([*k.values()]))
    return float(np.linalg.norm(moved, axis=1).max())


def _is_near(size: float, other: float) -> bool:
    """Whether two sizes are within a factor of ten."""
    return 0 < other / FACTOR < size < other * FACTOR


WORDING: Wording = {
    "angle_unit": lambda _: (
        "all joint angles of the task are within 6.3 degrees of zero: are they in radians? "
        "expected degrees"
    ),
    "force_unit": lambda data: (
        f"the forces of {data['whose']} are {data['ratio']:.2g} times those of the study's "
        f"{data['beside']}: are they in {data['unit']}? expected newtons"
    ),
    "compliance_unit": lambda data: (
        f"the compliances are {data['ratio']:.2g} times those of the study's [simulation]: are "
        "they in rad/(kN m)? expected rad/(N m)"
    ),
    "soft_arm": lambda data: (
        f"by these compliances the load moves the tool by {1e3 * data['moved']:.2g} mm, which no "
        "arm is used with; expected compliances in rad/(N m), and loads in newtons"
    ),
}
