"""What a fault changes: readings of a day, of displacements or of positions, as a model has them.

A fault knows no kind of study. It asks its scene how readings differ where the load, the frame, the
tool, a joint or a link is another one, and the scene answers for its own kind.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from edtk.findings.causes.family import Added, Family, Predict
from edtk.fit.measurements import Measurements, joint_motion, measured_points, translations
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Loads
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.parameters import Parameter, all_parameters
from edtk.measure.task import Task
from edtk.robots.elastic_robot import turning_about
from edtk.robots.frames import Frames
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation
from edtk.system.typing import Array

AXES = "xyz"
TORQUE = 1.0  # [N m] of a difference: it turns no joint by more than a few arc seconds


def since_first(count: int) -> Array:
    """How far (count,) a drift has come by each row: nothing in the first, its size in the last.

    It means that wherever something drifts or grows: in sheets of displacements and of positions,
    and in faults that a plan is to notice.
    """
    return np.linspace(0.0, 1.0, count)


class Scene(Protocol):
    """Readings (m, rows) of a day, and what they would be with a fault of any size."""

    @property
    def robot(self) -> Robot:
        """The robot by its drawing."""

    @property
    def A(self) -> Array:
        """Regressors (m, rows, p) of the readings: of the parameters that are identified."""

    @property
    def k(self) -> Array:
        """Values (p,) of these."""

    @property
    def q(self) -> Array:
        """Poses (m, n) [rad or m]."""

    @property
    def wrench(self) -> Array:
        """Loads (m, 6) [N, N m]."""

    @property
    def time(self) -> Array:
        """When each reading is made (m,), see `since_first`."""

    @property
    def absolute(self) -> bool:
        """Whether readings show where the robot is; displacements show how far it gives way."""

    @property
    def in_frame(self) -> bool:
        """Whether that is in the frame of the instrument, and not counted from the rigid robot."""

    @property
    def shows_load(self) -> bool:
        """Whether the size of the load shows; unknown compliances may take it up in full."""

    @property
    def assumed(self) -> tuple[AssumedJoint, ...]:
        """Joints whose compliance is assumed, and may be another one."""

    @property
    def sprung(self) -> tuple[int, ...]:
        """Indices (s,) of the joints whose compliances are known or identified."""

    @property
    def soft(self) -> Array:
        """Their compliances (s,) [rad/(N m)]."""

    @property
    def torque(self) -> Array:
        """Their loads (m, s) [N m, or N if prismatic]."""

    @property
    def sheet(self) -> "Scene":
        """The measurements by which faults and their sizes are counted: these, as a rule."""

    @property
    def springs(self) -> Array:
        """What readings (m, rows, s) show of a unit of their compliances."""

    @property
    def shift(self) -> Array:
        """What readings (m, rows, 3) show of a motion along the axes of the world.

        A displacement shows it where all moves between its two readings.
        """

    def under(self, wrench: Callable[[Array], Array]) -> Predict:
        """Loads (m, 6) that are others, by the size of a fault."""

    def stretched(self, factor: Callable[[Array], Array]) -> Predict:
        """Springs that are softer by factors (m, 1, s), by the size of a fault."""

    def turned(self) -> Predict:
        """The measuring frame, turned about three axes."""

    def tool(self, axis: int) -> Predict:
        """The tool point, elsewhere along an axis of the tool."""

    def counted(self, joint: int) -> Predict:
        """A joint that is further than written."""

    def longer(self, lengths: Mapping[str, float]) -> Predict:
        """Links before some joints that are longer, each by a length a unit."""

    def compliant(self, joint: int) -> Array:
        """What readings (m, rows) show of a unit of the compliance of a joint."""

    def across(self, joint: int, axis: int) -> Array:
        """What readings (m, rows) show of a unit of a spring about an axis before a joint.

        It is an axis of the frame before the joint, in which errors of geometry are, too.
        """

    def law(self, one: int, b: Callable[[Array], Array]) -> Array:
        """What readings (m, rows) show where spring `one` (of s) turns by b of its torques (m,)."""

    def with_law(self, one: int, column: Array) -> Predict:
        """Spring `one` that gives way by ``k (tau + c b)``, with what readings show of b."""

    def pulled(self, one: int, pull: "Pull") -> Predict:
        """Spring `one` (of s) that a further torque loads, by the size of a fault."""

    def families(self, of: "Models") -> Iterator[Family]:
        """The models of a fault in this scene."""


Models = Callable[[Scene], Iterator[Family]]


def same_in(scene: Scene, of: Models, family: Family) -> Family:
    """The same fault of the same robot in another scene, whose faults the sheet's count."""

    def key(one: Family) -> tuple[str, str, float, int]:
        return one.cause, one.joint, one.usual, one.shape

    return next(one for one in scene.families(of) if key(one) == key(family))


# A torque (m,) at a joint, and its derivative (m,) by the joint, by the size (dims,) of a fault.
Pull = Callable[[Array], tuple[Array, Array]]


def added(scene: Scene, columns: Array) -> Predict:
    """Readings to which something is added (m, rows, dims) a unit."""
    return Added(scene.A, columns)


def grown(scene: Scene, predict: Predict, shape: Array) -> Predict:
    """Readings of a fault whose size is another one in each row, by shares (m,)."""

    def scaled(c: Array) -> tuple[Array, Array]:
        A, b = predict(c)
        return scene.A + shape[:, None, None] * (A - scene.A), shape[:, None] * b

    return scaled


def play(scene: Scene) -> Array:
    """What readings (m, rows, s) show of a unit of motion of each sprung joint."""
    torque = scene.torque[:, None]
    springs = scene.springs
    return np.divide(springs, torque, out=np.zeros_like(springs), where=torque != 0)


@dataclass(frozen=True, eq=False)
class Displacements:
    """Displacements under loads, or positions that are counted from the rigid robot.

    Attributes:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p).
        k: Compliances (p,) [rad/(N m)].
        known: Compliances of further joints, by their index [rad/(N m)].
        told: Whether something is known of the size of the unknown compliances.
        assumed: The joints that are not identified, and how far each may be off.
        counted_by: The measurements by which faults are counted, of a task; None for a sheet.
    """

    model: ElastostaticModel
    data: Measurements
    A: Array
    k: Array
    known: Mapping[int, float] | None = None
    told: bool = False
    assumed: tuple[AssumedJoint, ...] = ()
    counted_by: "Displacements | None" = None
    _across: dict[tuple[int, int], Array] = field(default_factory=dict, init=False, repr=False)
    in_frame = False

    @property
    def robot(self) -> Robot:
        """The robot by its drawing."""
        return self.model.robot

    @property
    def q(self) -> Array:
        """Poses (m, n) [rad or m]."""
        return self.data.q

    @property
    def wrench(self) -> Array:
        """Loads (m, 6) [N, N m]."""
        return self.data.wrench

    @property
    def time(self) -> Array:
        """When each is made (m,), from the first row to the last."""
        return since_first(len(self.A))

    @property
    def absolute(self) -> bool:
        """Whether positions are measured, counted from the rigid robot."""
        return self.data.absolute

    @property
    def shows_load(self) -> bool:
        """Unknown compliances take up a load of another size in full.

        Only where the compliance of some joint is known, or something is known of the unknown ones,
        or weights load the joints besides, such a load is seen.
        """
        return bool(self.known) or self.told or self.model.weights is not None

    @property
    def sprung(self) -> tuple[int, ...]:
        """The joints of the model."""
        return tuple(int(j) for j in self.model.joints)

    @property
    def soft(self) -> Array:
        """Their compliances (p,)."""
        return self.k

    @property
    def sheet(self) -> "Displacements":
        """These, or those by which a task is counted."""
        return self if self.counted_by is None else self.counted_by

    @property
    def springs(self) -> Array:
        """The regressors: all of them are of compliances."""
        return self.A

    @cached_property
    def frames(self) -> Frames:
        """The chain in the poses, with the frames of all bodies."""
        robot = self.model.robot
        return robot.frames(self.data.q, range(len(robot.chain)))

    def _regressor(self, frames: Frames) -> Array:
        """Regressors (m, rows, p) of another chain."""
        return self.data.regressor_of(self.model, frames, self.data.wrench)

    @cached_property
    def torque(self) -> Array:
        """Loads (m, p) of the joints of the model [N m, or N if prismatic]."""
        return self.model.torque_of(self.frames, self.data.wrench)[self.model.joints].T

    @cached_property
    def _before(self) -> Array:
        """Loads (m, p) before the wrench, which a displacement is counted from [N m or N].

        Weights bend the robot before and after; what a spring does that is not linear differs.
        """
        weights = self.model.own_weights
        if weights is None:
            return np.zeros_like(self.torque)
        frames = self.robot.frames(self.data.q, weights.bodies)
        return np.asarray(frames.folded(weights.torque(frames))[self.model.joints].T)

    @cached_property
    def motion(self) -> Array:
        """What readings (m, rows, p) show of a motion of each sprung joint by 1 rad, or 1 m."""
        return joint_motion(self.model, self.data)[..., self.model.joints]

    @cached_property
    def shift(self) -> Array:
        """Translations of the readings."""
        return translations(self.model, self.data)

    def under(self, wrench: Callable[[Array], Array]) -> Predict:
        """The same displacements under other loads."""
        nothing = np.zeros(self.data.deflection.shape)
        frames = self.frames
        return lambda c: (self.data.regressor_of(self.model, frames, wrench(c)), nothing)

    def stretched(self, factor: Callable[[Array], Array]) -> Predict:
        """Regressors that are larger by factors."""
        return lambda c: (self.A * factor(c), np.zeros(self.A.shape[:2]))

    def turned(self) -> Predict:
        """The frame in which displacements are measured, turned about the world's axes.

        So are rotations; and positions, where they are counted from the rigid robot. Distances do
        not see it.
        """
        data, A = self.data, self.A
        whole, own = data.whole_rows(self.model, A)
        m, rows = A.shape[:2]
        places = np.zeros((m, 1, 3, 1))
        if data.absolute:
            places = measured_points(self.model, data)[:, None, :, None]

        def predict(c: Array) -> tuple[Array, Array]:
            turned = np.moveaxis(turned_by(c, np.moveaxis(whole, 2, -1)), -1, 2)
            moved = np.moveaxis(turned_by(c, np.moveaxis(places, 2, -1)), -1, 2) - places
            offset = np.zeros((m, rows))
            if own is None:
                offset[:, :3] = moved[:, 0, :, 0]
                return turned.reshape(A.shape), offset
            seen = np.flatnonzero(own >= 0)
            found = A.copy()
            found[seen, 0] = turned[seen, 0, own[seen]]
            lengths = seen[data.lengths[seen, 0]]
            offset[lengths, 0] = moved[lengths, 0, own[lengths], 0]
            return found, offset

        return predict

    @cached_property
    def _shown_by_tool(self) -> Array:
        """By how much readings grow (m, rows, 3) where the tool point moves along its axes.

        Positions that are counted from the rigid robot see that at once.
        """
        model, data = self.model, self.data
        if not data.absolute:
            return np.zeros((*data.deflection.shape, 3))
        axes = np.moveaxis(self.frames.rotation, -1, 0)  # (m, axis of the tool, 3)
        found = np.einsum("mrc,mac->mra", self.shift, axes)
        for rows, sensor in data.instruments(model):
            if sensor.point.joint is not None:
                found[rows] = 0.0
        return found

    def tool(self, axis: int) -> Predict:
        """Other lever arms of the load."""
        frames, shown = self.frames, self._shown_by_tool[..., axis]
        tip = len(frames.axes)

        def predict(c: Array) -> tuple[Array, Array]:
            other = frames.shifted(tip, c[0] * frames.rotation[axis])
            return self._regressor(other), c[0] * shown

        return predict

    def counted(self, joint: int) -> Predict:
        """The same in other poses."""
        return counted_from(self.model, self.data, joint)

    def longer(self, lengths: Mapping[str, float]) -> Predict:
        """A robot with other links."""
        links = [
            (place, lengths[joint.name] * self._along(place))
            for place, joint in enumerate(self.model.robot.chain)
            if joint.name in lengths
        ]

        def predict(c: Array) -> tuple[Array, Array]:
            other = self.frames
            for place, along in links:
                other = other.shifted(place, c[0] * along)
            return self._regressor(other), _shown(self.model, self.data, other)

        return predict

    def _along(self, place: int) -> Array:
        """Direction (3, m) of the link before a joint of the chain, in the world."""
        robot = self.model.robot
        joint = robot.chain[place]
        link = joint.origin[:3, 3] / link_length(joint)
        if place == 0:
            return (robot.base[:3, :3] @ link)[:, None]
        return np.asarray(np.einsum("kcm,k->cm", self.frames.bodies[place - 1][0], link))

    def compliant(self, joint: int) -> Array:
        """The column of Eq. (4) of a joint."""
        model = replace(self.model, unknown=(joint,))
        return self.data.regressor_of(model, self.frames, self.data.wrench)[..., 0]

    def across(self, joint: int, axis: int) -> Array:
        """The column of a spring that nobody drives: ``dy/de tau_e`` of its axis e."""
        if (joint, axis) not in self._across:
            model, data = self.model, self.data
            frames = turning_about(model.robot, self.frames, joint, axis)
            torque = model.torque_of(frames, data.wrench)[joint]
            column = np.asarray((data.motion_of(model, frames)[joint] * torque).T)
            self._across[joint, axis] = column
        return self._across[joint, axis]

    def law(self, one: int, b: Callable[[Array], Array]) -> Array:
        """Of displacements, the difference of both readings."""
        after = self.torque[:, one] + self._before[:, one]
        turned = b(after) - b(self._before[:, one])
        return np.asarray(self.motion[..., one] * turned[:, None])

    def with_law(self, one: int, column: Array) -> Predict:
        """Another column of that spring."""
        nothing = np.zeros(self.A.shape[:2])

        def predict(c: Array) -> tuple[Array, Array]:
            A = self.A.copy()
            A[..., one] += c[0] * column
            return A, nothing

        return predict

    def pulled(self, one: int, pull: "Pull") -> Predict:
        """With the torque's slope T' the spring of compliance k gives way by ``k / (1 - k T')``.

        Displacements are counted from where that torque has bent the joint already, by ``k T``: it
        changes them by less than a per cent, to the first order. Positions that are counted from
        the rigid robot see that, too, and there it may be most of what loads the joint.
        """
        model, data = self.model, self.data
        k = max(float(self.k[one]), 0.0)
        nothing = np.zeros(self.A.shape[:2])
        if not self.absolute:
            own = np.arange(model.robot.n) == model.joints[one]
            columns = []
            for c in TORQUE * np.eye(2):
                torque, slope = pull(c)
                q = data.q + k * torque[:, None] * own
                A = replace(data, q=q).regressor(model)
                A[..., one] /= 1 - k * slope[:, None]
                columns.append((A - self.A) @ self.k / TORQUE)
            return Added(self.A, np.stack(columns, axis=-1))

        def predict(c: Array) -> tuple[Array, Array]:
            torque, slope = pull(c)
            A = self.A.copy()
            A[..., one] += self.motion[..., one] * torque[:, None]
            A[..., one] /= 1 - k * slope[:, None]
            return A, nothing

        return predict

    def in_task(self, task: Task) -> "Displacements":
        """The same robot in a task, where it shall be accurate: faults are in the same order."""
        model = replace(task.model, unknown=self.model.unknown)
        data = Measurements(
            q=np.atleast_2d(task.q),
            wrench=np.atleast_2d(task.wrench),
            deflection=np.zeros((1, model.row_count)),
            sigma=np.ones((1, model.row_count)),
            marker=np.zeros((1, 3)),
            absolute=self.absolute,
        )
        A = data.regressor(model)
        return Displacements(model, data, A, self.k, self.known, self.told, self.assumed, self)

    @cached_property
    def _whole(self) -> "Displacements":
        """The same with the known joints among the unknown ones, behind them."""
        assert self.known
        every = replace(self.model, unknown=(*self.model.joints, *self.known))
        k = np.append(self.k, list(self.known.values()))
        by = None if self.counted_by is None else self.counted_by._whole
        A = self.data.regressor(every)
        return Displacements(every, self.data, A, k, None, True, self.assumed, by)

    def families(self, of: Models) -> Iterator[Family]:
        """The models of a fault, which changes what known joints do, too."""
        if not self.known:
            yield from of(self)
            return
        values = np.array(list(self.known.values()))
        for family in of(self._whole):
            yield _of_unknown(family, self._whole.A, values)


def counted_from(model: ElastostaticModel, data: Measurements, j: int) -> Predict:
    """Poses in which joint j is further than written."""

    def predict(c: Array) -> tuple[Array, Array]:
        shown = model.robot.shown(data.q).copy()
        shown[:, j] += c[0]
        frames = model.frames(model.robot.of_shown(shown))
        return data.regressor_of(model, frames, data.wrench), _shown(model, data, frames)

    return predict


def _shown(model: ElastostaticModel, data: Measurements, other: Frames) -> Array:
    """What readings (m, rows) show of another rigid chain, or of other poses: nothing, or all."""
    found = np.zeros(data.deflection.shape)
    if data.absolute:
        change = data.rigid_of(model, other) - data.rigid(model)
        found[:, : change.shape[1]] = change
    return found


def _of_unknown(family: Family, whole: Array, values: Array) -> Family:
    """A fault of all joints as one of the unknown ones, beside what known joints do without it.

    Args:
        family: The fault, with the known joints behind the unknown ones.
        whole: Regressors (m, rows, p + n) of all of them without the fault.
        values: The known compliances (n,) [rad/(N m)].
    """
    p = whole.shape[-1] - len(values)

    def predict(c: Array) -> tuple[Array, Array]:
        A, b = family.predict(c)
        return A[..., :p], b + (A[..., p:] - whole[..., p:]) @ values

    return replace(family, predict=predict)


def turned_by(turn: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by a rotation vector (3,), or one by several (m, 3) [rad]."""
    return vectors @ np.swapaxes(rotation(turn), -1, -2)


def link_length(joint: Joint) -> float:
    """Length of the link before a joint [m]."""
    return float(np.linalg.norm(joint.origin[:3, 3]))


class ColumnsOf(Protocol):
    """How readings move with any parameters."""

    def __call__(self, parameters: tuple[Parameter, ...], wrench: Array) -> Array:
        """Columns (m, rows, p) for a metre, a radian or a rad/(N m), under some loads (m, 6)."""


class JointLoads(Loads, Protocol):
    """What loads the joints, about other axes too."""

    def across(self, q: Array, wrench: Array, joint: int, axis: int) -> Array:
        """Loads (m,) about an axis of the frame before a free joint [N m]."""


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions or poses of markers in the frame of the instrument, to first order.

    Every fault of the robot or the frame is a sum of columns of parameters that a calibration might
    ask for, whatever the instruments are.

    Attributes:
        drawing: The robot.
        markers: Names of the markers on the tool.
        columns: How the readings move with parameters.
        A: Regressors (m, rows, p) of the parameters that are identified.
        k: Their values (p,).
        q: Poses (m, n) [rad or m].
        wrench: Loads (m, 6) [N, N m].
        time: When each visit is made (m,).
        sprung: Indices (s,) of the joints whose springs are known or identified.
        soft: Their compliances (s,) [rad/(N m)].
        loads: What loads the joints; None without springs.
        counted_by: The readings by which faults are counted, of a task; None for a sheet.
    """

    drawing: Robot
    markers: tuple[str, ...]
    columns: ColumnsOf
    A: Array
    k: Array
    q: Array
    wrench: Array
    time: Array
    sprung: tuple[int, ...]
    soft: Array
    loads: JointLoads | None
    assumed: tuple[AssumedJoint, ...] = ()
    counted_by: "Positions | None" = None
    _by_joint: dict[str, Array] = field(default_factory=dict, init=False, repr=False)
    in_frame = True
    absolute = True
    shows_load = True

    @property
    def robot(self) -> Robot:
        """The robot by its drawing."""
        return self.drawing

    def _of(
        self, joints: tuple[str, ...] = (), base: bool = False, tool: bool = False
    ) -> tuple[Parameter, ...]:
        """Parameters of all motions before some joints, of the base, or of the markers."""
        return all_parameters(self.robot, self.markers, joints, base=base, tool=tool)

    @cached_property
    def torque(self) -> Array:
        """Loads (m, s) of the sprung joints."""
        if self.loads is None:
            return np.zeros((len(self.q), 0))
        return self.loads(self.q, self.wrench)[:, list(self.sprung)]

    @property
    def sheet(self) -> "Positions":
        """These, or those by which a task is counted."""
        return self if self.counted_by is None else self.counted_by

    @cached_property
    def springs(self) -> Array:
        """Columns (m, rows, s) of the sprung joints."""
        return self._springs(self.wrench)

    def _springs(self, wrench: Array) -> Array:
        if not self.sprung:
            return np.zeros((*self.A.shape[:2], 0))
        names = [self.robot.joint_names[j] for j in self.sprung]
        unknown = all_parameters(self.robot, (), (), names, base=False, tool=False)
        return self.columns(unknown, wrench)

    @cached_property
    def frame(self) -> Array:
        """Columns (m, rows, 6) of a motion of the frame: shifts, then turns."""
        return self.columns(self._of(base=True), self.wrench)

    @property
    def shift(self) -> Array:
        """Those of its shifts."""
        return self.frame[..., :3]

    def under(self, wrench: Callable[[Array], Array]) -> Predict:
        """What other loads bend beyond what those of the sheet do."""
        bent = self.springs @ self.soft
        return lambda c: (self.A, self._springs(wrench(c)) @ self.soft - bent)

    def stretched(self, factor: Callable[[Array], Array]) -> Predict:
        """What springs give way beyond what they do."""
        return lambda c: (self.A, (self.springs * (factor(c) - 1)) @ self.soft)

    def turned(self) -> Predict:
        """A turn of the frame about the place of the robot."""
        return added(self, self.frame[..., 3:])

    def tool(self, axis: int) -> Predict:
        """All markers that move together."""
        by_markers = self.columns(self._of(tool=True), self.wrench)
        return added(self, by_markers[..., axis :: len(AXES)].sum(axis=-1, keepdims=True))

    def _before(self, joint: Joint) -> Array:
        """Columns (m, rows, 6) of shifts and turns of the frame before a joint."""
        if joint.name not in self._by_joint:
            self._by_joint[joint.name] = self.columns(self._of((joint.name,)), self.wrench)
        return self._by_joint[joint.name]

    def counted(self, joint: int) -> Predict:
        """A motion about, or along, the axes of all joints that one drive moves."""
        ties = self.robot.ties
        factors = np.eye(self.robot.n) if ties is None else ties.matrix
        found = np.zeros((*self.A.shape[:2], 1))
        for one, factor in zip(self.robot.chain, factors[:, joint], strict=True):
            if factor:
                part = slice(3, 6) if one.kind == "revolute" else slice(0, 3)
                found += factor * self._before(one)[..., part] @ one.axis[:, None]
        return added(self, found)

    def longer(self, lengths: Mapping[str, float]) -> Predict:
        """Shifts along the links."""
        found = np.zeros((*self.A.shape[:2], 1))
        for joint in self.robot.chain:
            if joint.name in lengths:
                along = joint.origin[:3, :3].T @ joint.origin[:3, 3] / link_length(joint)
                found += lengths[joint.name] * self._before(joint)[..., :3] @ along[:, None]
        return added(self, found)

    def compliant(self, joint: int) -> Array:
        """The column of a spring."""
        names = [self.robot.joint_names[joint]]
        unknown = all_parameters(self.robot, (), (), names, base=False, tool=False)
        return self.columns(unknown, self.wrench)[..., 0]

    def across(self, joint: int, axis: int) -> Array:
        """A turn of the frame before a joint, times its load."""
        if self.loads is None:
            return np.zeros(self.A.shape[:2])
        turned = self._before(self.robot.joints[joint])[..., 3 + axis]
        return turned * self.loads.across(self.q, self.wrench, joint, axis)[:, None]

    def law(self, one: int, b: Callable[[Array], Array]) -> Array:
        """Of readings one by one."""
        return np.asarray(self._motion(one) * b(self.torque[:, one])[:, None])

    def with_law(self, one: int, column: Array) -> Predict:
        """What the spring gives way beyond what it does."""
        return added(self, self.soft[one] * column[..., None])

    def pulled(self, one: int, pull: "Pull") -> Predict:
        """To first order ``k (T + k tau T')``."""
        k = self.soft[one]
        motion, springs = self._motion(one), self.springs[..., one]

        def predict(c: Array) -> tuple[Array, Array]:
            torque, slope = pull(c)
            return self.A, k * (motion * torque[:, None] + k * springs * slope[:, None])

        return predict

    def _motion(self, one: int) -> Array:
        """What readings (m, rows) show of a motion of a sprung joint by 1 rad, or 1 m."""
        return self.counted(self.sprung[one])(np.ones(1))[1]

    def families(self, of: Models) -> Iterator[Family]:
        """The models of a fault."""
        yield from of(self)
