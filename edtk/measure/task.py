"""The tasks of a robot: the poses, tools and loads in which it shall be accurate."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import Friction
from edtk.measure.measured_model import Load, MeasuredModel, Seen
from edtk.robots.compensator import GivingWay
from edtk.robots.robot import Robot
from edtk.robots.weights import DeadWeights
from edtk.robots.workspace import neighbourhood
from edtk.system.typing import Array

# The order of an industrial robot's joint compliances: the example by which the effect is judged.
EXAMPLE = 1e-7  # [rad/(N m)]
LEAST = 1e-6  # displacement by the example from which a joint is reported [m]


@dataclass(frozen=True)
class RigidJoint:
    """A joint that counts as rigid.

    Attributes:
        name: The joint.
        displacement: By how much 1e-7 rad/(N m) of compliance in it would move the tool point under
            the load, in the pose where that is most [m].
    """

    name: str
    displacement: float


def rigid_joints(
    model: ElastostaticModel, q: Array, wrench: Array, known: tuple[str, ...]
) -> tuple[RigidJoint, ...]:
    """Find the joints whose unknown compliance would matter in a task.

    Args:
        model: The robot with the task's tool, and weights that load it.
        q: Task poses (t, n) [rad or m].
        wrench: Their wrenches (t, 6) [N, N m].
        known: Names of the joints whose compliances are known.

    Returns:
        The revolute joints without a known compliance that the load turns, from base to tip.
    """
    robot = model.robot
    J = robot.jacobian(q)
    torque = np.einsum("tij,ti->tj", J, wrench)
    if model.weights is not None:
        torque = torque + model.torque_of(model.frames(q), np.zeros(6)).T
    moved = EXAMPLE * np.linalg.norm(J[:, :3] * torque[:, None], axis=1).max(axis=0)
    return tuple(
        RigidJoint(joint.name, float(displacement))
        for joint, displacement in zip(robot.joints, moved, strict=True)
        if joint.name not in known and joint.kind == "revolute" and displacement > LEAST
    )


def rigid_joints_in_words(joints: tuple[RigidJoint, ...]) -> str:
    """One sentence that names the joints, or an empty text for none."""
    if not joints:
        return ""
    parts = ", ".join(f"{joint.name} ({1e3 * joint.displacement:.2g} mm)" for joint in joints)
    return (
        f"without a known compliance, and so taken as rigid: {parts}; under the task's load the "
        f"tool would move so far for each {EXAMPLE:g} rad/(N m) that the joint really has"
    )


def all_compliances(
    model: ElastostaticModel, k: ArrayLike, known: Mapping[int, float] | None = None
) -> Array:
    """Compliances (..., n) of all joints; those that are neither unknown nor known are rigid.

    Args:
        model: Says which joints the compliances belong to.
        k: Compliances (..., p) of the unknown joints [rad/(N m)].
        known: Compliances of other joints, by their indices [rad/(N m)]; none by default.
    """
    k = np.asarray(k, dtype=float)
    complete = np.zeros((*k.shape[:-1], model.robot.n))
    complete[..., model.joints] = k
    for j, compliance in (known or {}).items():
        complete[..., j] = compliance
    return complete


class Columns(Protocol):
    """How what counts in a task moves with the parameters."""

    def __call__(self, q: Array, turned: bool) -> Array:
        """Rows (..., r, p) in poses q (..., n), for a unit of each parameter.

        The squares of the rows, times errors of the parameters, add up to a squared displacement
        [m]. Where `turned`, three more rows are the rotation of the tool [rad].
        """


def spring_columns(model: ElastostaticModel, wrench: Array, q: Array, turned: bool) -> Array:
    """How a tool point moves with compliances: the regressor, Eq. (4), see `Columns`.

    Args:
        model: The elastostatic model with the task's tool.
        wrench: The load (..., 6) or (6,) of the task [N, N m].
        q: Poses (..., n) [rad or m].
        turned: Whether the rotation of the tool counts, too.

    Returns:
        Rows (..., 3 or 6, p) [m, rad for 1 rad/(N m)].
    """
    own = replace(model, rows="pose") if turned else model
    return own.regressor(q, wrench)


@dataclass(frozen=True, eq=False)
class ErringColumns:
    """How markers, or a tool point, move with geometry and springs.

    A tool rides on the last joint, as drawn: where markers sit on it moves no tool. Of k markers
    the squares of the rows add up to the mean over the markers.

    Attributes:
        model: Markers and parameters.
        theta: Values (p,) of the parameters about which they move, in SI units.
        tool: Transform (4, 4) of the tool after the last joint, whose point counts [m]; None where
            the markers count.
        torque: Gives the loads of the free joints in poses (m, n) [N m or N]; None where
            nothing loads them.
    """

    model: MeasuredModel
    theta: Array
    tool: Array | None
    torque: Callable[[Array], Load | None]

    def __call__(self, q: Array, turned: bool) -> Array:
        """Rows (..., 3k or 3, p) [m, rad] for a unit of each parameter; with turns three more."""
        own = [one.place != "tool" for one in self.model.parameters]
        scales = self.model.scales

        def moved(seen: Seen) -> Array:
            assert seen.jacobian is not None
            if seen.jacobian.shape[-1] == self.model.p:
                return seen.jacobian * scales
            rows = np.zeros((*seen.jacobian.shape[:-1], self.model.p))
            rows[..., own] = seen.jacobian * scales[own]
            return rows

        return self._rows(q, turned, moved)

    def by_joints(self, q: Array, turned: bool) -> Array:
        """The same for motions (..., r, n) of the free joints, by 1 rad or 1 m."""

        def moved(seen: Seen) -> Array:
            assert seen.by_joints is not None
            return seen.by_joints

        return self._rows(q, turned, moved)

    def _rows(self, q: Array, turned: bool, moved: Callable[[Seen], Array]) -> Array:
        """Rows (..., r, c) of what counts, from those (m, k, rows, c) of markers or of a tool."""
        flat = q.reshape(-1, q.shape[-1])
        torque = self.torque(flat)
        parts = []
        if self.tool is None:
            counted = self.model.on_tool
            rows = moved(self.model.see(self.theta, flat, torque))[:, counted, :3]
            parts.append(rows.reshape(len(flat), -1, rows.shape[-1]) / np.sqrt(counted.sum()))
        if self.tool is not None or turned:
            tool = self.model.robot.tool if self.tool is None else self.tool
            own = np.array([one.place != "tool" for one in self.model.parameters], dtype=bool)
            of_tool = moved(self.model.at_tool(tool).see(self.theta[own], flat, torque))[:, 0]
            first = 3 if self.tool is None else 0
            parts.append(of_tool[:, first : 6 if turned else 3])
        found = np.concatenate(parts, axis=1)
        return np.asarray(found.reshape(*q.shape[:-1], *found.shape[1:]))


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """One pose in which the robot works, or several, with the task's own tool and load.

    It is here that errors of parameters do harm: an error dk of the compliances moves the tool
    point by ``A0 dk``, with the regressor A0 of the pose (Eq. 17, 20); those of geometry have
    columns of their own.

    Args:
        q: Joint variables (..., n) under load [rad or m].
        tool: Transform (4, 4) of the task's tool after the last joint [m]; None where the markers
            of the study count, and no tool point.
        wrench: Task load (..., 6) or (6,) at the tool point in the world frame [N, N m].
        robot: The chain, with any tool.
        unknown: Indices (p,) of the joints whose compliances are to be found, or are known.
        within: The robot shall be accurate in all poses whose joints are within this of q, see
            `neighbourhood`; zero for q alone [rad].
        lever: A rotation of the tool counts as the displacement at this distance from the tool
            point; zero if rotations do no harm [m].
        weight: How much the task counts beside others; zero for a task that is only looked at.
        dead_weights: Weights that load the joints besides the wrench; None for none.
        carries: Whether the task says by itself what the robot carries.
        columns: How what counts moves with the parameters; None for the tool point by the
            compliances of `unknown`.
        own_weights: Weights that bend the robot with and without the task's load; None for none,
            or where displacements do not see them.
        gives: How joints with compensators give way where the load is; None where none does.
        friction: What friction of these joints holds, whose shares do harm, too; None where it
            counts for nothing.
    """

    q: Array
    tool: Array | None
    wrench: Array
    robot: Robot
    unknown: tuple[int, ...] = ()
    within: float = 0.0
    lever: float = 0.0
    weight: float = 1.0
    dead_weights: DeadWeights | None = None
    carries: bool = False
    columns: Columns | None = None
    own_weights: DeadWeights | None = None
    gives: GivingWay | None = None
    friction: Friction | None = None

    @cached_property
    def placed(self) -> Robot:
        """The chain with the task's tool; with its own where the markers count."""
        return self.robot if self.tool is None else self.robot.with_tool(self.tool)

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the task's tool, for the position of the tool point."""
        return ElastostaticModel(
            self.placed,
            self.unknown,
            weights=self.dead_weights,
            own_weights=self.own_weights,
            gives=self.gives,
            friction=self.friction,
        )

    @cached_property
    def moved(self) -> Columns:
        """How what counts moves with the parameters."""
        if self.columns is None:
            return partial(spring_columns, self.model, self.wrench)
        return self.columns

    @cached_property
    def regressor(self) -> Array:
        """A0 (..., r, p): how positions move, Eq. (4), with the task's tool and load [m]."""
        return self.moved(self.q, False)

    @property
    def point(self) -> Array:
        """The tool point (..., 3) of the task [m]."""
        return self.placed.forward(self.q)[..., :3, 3]

    @property
    def place(self) -> str:
        """Where rho0 is the error, in words."""
        around = f"within {np.rad2deg(self.within):.3g} deg of the test pose"
        return around if self.within else "in the test pose"

    @property
    def poses(self) -> Array:
        """The pose itself (n,), or all poses (N, n) of its neighbourhood."""
        return neighbourhood(self.robot, self.q, self.within) if self.within else self.q

    @cached_property
    def target(self) -> Array:
        """The target (r, p) of rho0: ``|target dk|^2`` is the harm of dk [m/(rad/(N m))].

        For a pose alone it is its regressor A0. Over a neighbourhood of N poses it is a triangle R
        of at most p rows with ``R'R = sum_i A_i' A_i / N``, so that the harm is the mean square of
        the errors there.
        """
        A = self.harm(self.poses)
        if not self.within:
            return A
        # From the stacked rows: their squares would lose half of the digits.
        return np.asarray(np.linalg.qr(A.reshape(-1, A.shape[-1]) / np.sqrt(len(A)), mode="r"))

    def harm(self, q: Array) -> Array:
        """Rows (..., r, p) whose squares, times dk, add up to the squared error in poses q.

        Rotation rows count with the lever: a small rotation phi moves a point at that distance from
        the tool point by up to ``lever |phi|``.

        Args:
            q: Joint variables (..., n) [rad or m].
        """
        A = self.moved(q, bool(self.lever))
        if self.lever:
            A[..., -3:, :] *= self.lever
        return A


class Tasks(tuple[Task, ...]):
    """Tasks in their order, of which each counts by its weight.

    Where a number stands for all of them it is the root of the weighted mean of squares; one task
    alone gives its own numbers, to the last bit. A task of weight zero is looked at, but nothing is
    designed for it.
    """

    @cached_property
    def shares(self) -> Array:
        """The weights (t,), divided by their sum."""
        weights = np.array([task.weight for task in self])
        return np.asarray(weights / weights.sum())

    @cached_property
    def target(self) -> Array:
        """The target (r, p) of rho0: ``|target dk|^2`` is the mean harm of dk [m/(rad/(N m))].

        The target of a single task is its own, and otherwise a triangle R of at most p rows with
        ``R'R = sum_i w_i A_i' A_i / sum_i w_i`` for the targets A_i.
        """
        if len(self) == 1:
            return self[0].target
        # From the stacked rows: their squares would lose half of the digits.
        return np.asarray(np.linalg.qr(self._weighted([task.target for task in self]), mode="r"))

    @cached_property
    def targets(self) -> Array:
        """The target of each task (t, r, p), padded with rows of zeros to one shape.

        That of a task without weight is zero: it is no part of the worst.
        """
        each = [task.target for task in self]
        padded = np.zeros((len(self), max(map(len, each)), each[0].shape[-1]))
        for place, target, task in zip(padded, each, self, strict=True):
            if task.weight:
                place[: len(target)] = target
        return padded

    @cached_property
    def regressor(self) -> Array:
        """Rows (r, p) whose squares, times dk, are the mean squared displacement of the tool point.

        Those of a single task are A0 (3, p), Eq. (4) [m for a unit of each parameter].
        """
        if len(self) == 1:
            return self[0].regressor
        return self._weighted([task.regressor for task in self])

    @property
    def subject(self) -> str:
        """What rho0 is the error of, in words."""
        kinds = {task.tool is None for task in self}
        if len(kinds) > 1:
            return "markers and tool points"
        return "the markers" if True in kinds else "the tool point"

    @property
    def place(self) -> str:
        """Where rho0 is the error, in words."""
        if len(self) == 1:
            return self[0].place
        sizes = {task.within for task in self}
        if len(sizes) > 1:
            return f"in {len(self)} test poses and around them"
        around = f"within {np.rad2deg(max(sizes)):.3g} deg of {len(self)} test poses"
        return around if max(sizes) else f"in {len(self)} test poses"

    def with_unknown(self, unknown: tuple[int, ...]) -> "Tasks":
        """The same tasks of a robot of which other compliances are unknown."""
        return Tasks(replace(task, unknown=unknown, friction=None) for task in self)

    def with_friction(self, friction: Friction) -> "Tasks":
        """The same tasks, in which what friction of the unknown joints holds does harm, too."""
        return Tasks(replace(task, friction=friction) for task in self)

    def with_columns(self, columns: Callable[[Task], Columns]) -> "Tasks":
        """The same tasks, in which other parameters do harm."""
        return Tasks(replace(task, columns=columns(task)) for task in self)

    def _weighted(self, each: Sequence[Array]) -> Array:
        """Rows (..., p) of each task, times the root of its share, below each other."""
        return np.concatenate(
            [np.sqrt(share) * rows for share, rows in zip(self.shares, each, strict=True) if share]
        )
