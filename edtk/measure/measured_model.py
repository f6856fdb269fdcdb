"""What instruments read of a robot whose geometry and springs are not those of the drawing."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from edtk.measure.few_columns import FewColumns
from edtk.measure.instruments.distance import NEAREST
from edtk.measure.parameters import COMPONENTS, Parameter
from edtk.measure.springs import Answers, Bending, Springs, UnknownNumbers, sprung
from edtk.robots.compensator import GivingWay
from edtk.robots.elastic_robot import ElasticJoint, body_of, widened
from edtk.robots.robot import Robot
from edtk.robots.rotations import left_jacobian, rotation, vector_product
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class PlacedChain:
    """Where the frames of an erring chain are in some poses, in the world of the model.

    Attributes:
        frames: Rotations (N, m, 3, 3) of the frame before each joint, in whose axes its error is.
        origins: Points (N, m, 3) about which that error turns [m].
        turned: The same frames after the error's turn (N, m, 3, 3): those of the joint itself.
        tips: Rotations (m, 3, 3) of the tool frame.
        points: Tool points (m, 3) [m].
        bodies: Rotations (N, m, 3, 3) of the body behind each joint.
        centers: Origins (N, m, 3) of these frames [m].
    """

    frames: Array
    origins: Array
    turned: Array
    tips: Array
    points: Array
    bodies: Array
    centers: Array

    def body(self, joint: int | None) -> tuple[Array, Array]:
        """Rotations (m, 3, 3) and origins (m, 3) of the body of a joint; None for the tool."""
        if joint is None:
            return self.tips, self.points
        return self.bodies[joint], self.centers[joint]


@dataclass(frozen=True, eq=False)
class ErringChain:
    """A robot with a small rigid motion `e_j` before each joint.

    The pose of the tool is ``base prod_j (O_j exp(e_j) exp(xi_j q_j)) tool`` with the origins O_j
    of the drawing. A motion ``e = (v, w)`` is a shift v, then a turn by the vector w, both along
    the axes of the frame O_j: to first order this is the exponential of the twist (v, w), and it
    describes the same set of motions.

    Args:
        robot: The drawing.
    """

    robot: Robot

    @cached_property
    def _axes(self) -> Array:
        """Axes (N, 3) about which the joints turn; zeros where they slide."""
        axes = np.array([joint.axis for joint in self.robot.chain])
        return np.where(self.robot.chain_slides[:, None], 0.0, axes)

    @property
    def n(self) -> int:
        """Number N of joints of the chain, those that follow others included."""
        return len(self.robot.chain)

    def variables(self, q: Array) -> Array:
        """Variables (m, N) of all joints, for those (m, n) of the free ones [rad or m].

        Elastic joints that are left out are at zero.
        """
        ties = self.robot.ties
        q = widened(q, self.robot.n)
        return q if ties is None else ties.variables(q.T).T

    def place(self, variables: Array, errors: Array) -> PlacedChain:
        """Place the chain.

        Args:
            variables: Joint variables (m, N) [rad or m].
            errors: Motions (N, 6) before the joints, shifts first [m, rad].
        """
        m = len(variables)
        R = np.broadcast_to(self.robot.base[:3, :3], (m, 3, 3))
        p = np.broadcast_to(self.robot.base[:3, 3], (m, 3))
        frames = np.empty((self.n, m, 3, 3))
        turned = np.empty((self.n, m, 3, 3))
        bodies = np.empty((self.n, m, 3, 3))
        origins = np.empty((self.n, m, 3))
        centers = np.empty((self.n, m, 3))
        bends = rotation(errors[:, 3:])
        turns = rotation(np.ascontiguousarray(variables.T)[..., None] * self._axes[:, None])
        for j, joint in enumerate(self.robot.chain):
            p = p + R @ joint.origin[:3, 3]
            R = R @ joint.origin[:3, :3]
            frames[j] = R
            p = p + R @ errors[j, :3]
            R = R @ bends[j]
            origins[j] = p
            turned[j] = R
            if self.robot.chain_slides[j]:
                p = p + variables[:, j, None] * (R @ joint.axis)
            else:
                R = R @ turns[j]
            bodies[j] = R
            centers[j] = p
        tips = R @ self.robot.tool[:3, :3]
        tool = p + R @ self.robot.tool[:3, 3]
        return PlacedChain(frames, origins, turned, tips, tool, bodies, centers)

    def by_errors(self, placed: PlacedChain, errors: Array, points: Array) -> Array:
        """Derivatives (m, k, 3, N, 6) of points on the tool by the errors.

        A shift moves all that follows along the axes of its frame, and a turn about its origin:
        columns ``R_j [I, -[r_j]x J_l]``, with the lever r_j from there to the point.

        Args:
            placed: The chain with these errors.
            errors: Motions (N, 6).
            points: Points (m, k, 3) of the tool in the world of the model [m].
        """
        m, k = points.shape[:2]
        D = np.empty((m, k, 3, self.n, 6))
        bends = placed.frames @ left_jacobian(errors[:, 3:])[:, None]
        # All joints and axes at once: of a few poses the time goes by the number of calls.
        levers = points - placed.origins[:, :, None]
        swings = vector_product(np.swapaxes(bends, 2, 3)[:, :, None], levers[:, :, :, None])
        D[..., :3] = placed.frames.transpose(1, 2, 0, 3)[:, None]
        D[..., 3:] = swings.transpose(1, 2, 4, 0, 3)
        return D

    def turns_by_errors(self, placed: PlacedChain, errors: Array) -> Array:
        """Derivatives (m, 3, N, 6) of the tool's orientation, as turns in the world's axes."""
        m = placed.points.shape[0]
        D = np.zeros((m, 3, self.n, 6))
        bends = placed.frames @ left_jacobian(errors[:, 3:])[:, None]
        D[..., 3:] = np.moveaxis(bends, 0, 2)
        return D

    def by_each(self, placed: PlacedChain, points: Array) -> Array:
        """Derivatives (m, k, 3, N) of points on the tool by each joint [m/rad, or 1]."""
        along = [
            turned @ joint.axis
            for turned, joint in zip(placed.turned, self.robot.chain, strict=True)
        ]
        axes = np.stack(along)[:, :, None]
        D = vector_product(axes, points - placed.origins[:, :, None])
        D[self.robot.chain_slides] = axes[self.robot.chain_slides]
        return np.moveaxis(D, 0, -1)

    def turns_by_each(self, placed: PlacedChain) -> Array:
        """Derivatives (m, 3, N) of the tool's orientation by each joint."""
        D = np.zeros((self.n, len(placed.points), 3))
        for j, joint in enumerate(self.robot.chain):
            if not self.robot.chain_slides[j]:
                D[j] = placed.turned[j] @ joint.axis
        return np.moveaxis(D, 0, -1)

    def folded(self, by_each: Array) -> Array:
        """Derivatives (..., n) by the free joints, of those (..., N) by each."""
        ties = self.robot.ties
        if ties is None:
            return by_each
        return np.moveaxis(ties.fold(np.moveaxis(by_each, -1, 0)), 0, -1)


Kind = Literal["position", "pose", "distance"]
ROWS_OF: dict[Kind, int] = {"position": 3, "pose": 6, "distance": 1}


@dataclass(frozen=True, eq=False)
class Load:
    """What loads the joints of a robot that has come to rest.

    Attributes:
        torque: Loads (m, s) of the free joints, elastic ones last [N m or N].
        gives: ``(I - K H)^-1`` (m, s, s) with the compliances K and ``H = dtau/dq``: by how much
            all joints give way, where one is turned and its load changes on the way; None for I.
        tangent: K (m, s, s), by which numbers of compensators turn the joints; None for zero.
        near: Where the joints (m, s) have come to rest; None likewise.
        sizes: Changes (c,) of numbers of compensators at which the loads are these, the first of
            those of a model; all others are zero.
    """

    torque: Array
    gives: Array | None = None
    tangent: Array | None = None
    near: Array | None = None
    sizes: Array = field(default_factory=lambda: np.zeros(0))

    def __getitem__(self, chosen: Mask) -> "Load":
        """In some of the poses."""
        others = (self.gives, self.tangent, self.near)
        gives, tangent, near = (None if one is None else one[chosen] for one in others)
        return Load(self.torque[chosen], gives, tangent, near, self.sizes)

    def by_terms(self, by_joints: Array, springs: Springs) -> Array:
        """Derivatives (m, k, rows, T) by the terms of springs, of those (m, k, rows, s) by joints.

        A spring turns the joints by ``b_i(tau)``, and as their loads change with them, the arm by
        ``J (I - K H)^-1 b_i``.
        """
        turned = self._turned(by_joints)
        return (turned @ springs.out.T) * springs.amplitudes(self.torque.T).T[:, None, None]

    def by_numbers(self, by_joints: Array, numbers: UnknownNumbers, sizes: Array) -> Array | float:
        """Derivatives (m, k, rows, c) by numbers of compensators, which load the joints."""
        if self.tangent is None or self.near is None:
            return 0.0
        turns = self.tangent @ numbers.by_numbers(sizes, self.near)
        return np.asarray(self._turned(by_joints) @ turns[:, None])

    def turned(self, numbers: UnknownNumbers, sizes: Array) -> Array | float:
        """Turns (..., m, s) of the joints by other numbers (..., c) of compensators than these."""
        if self.tangent is None or self.near is None or not len(numbers.of):
            return 0.0
        own = np.pad(self.sizes, (0, len(numbers.of) - len(self.sizes)))
        added = numbers.by_numbers(own, self.near) @ (sizes - own)[..., None, :, None]
        return np.asarray((self.tangent @ added)[..., 0])

    def _turned(self, by_joints: Array) -> Array:
        return by_joints if self.gives is None else by_joints @ self.gives[:, None]


@dataclass(frozen=True, eq=False)
class LoadsOfReadings:
    """What loads the joints in some readings, of which some are differences of two.

    Attributes:
        after: The loads in all poses (m).
        differs: Which readings (m,) are those less what was read before.
        before: The loads before, in the poses of these alone.
    """

    after: Load
    differs: Mask
    before: Load


Torque = Array | Load | LoadsOfReadings | None


@dataclass(frozen=True, eq=False)
class Seen:
    """What a model says is read in some poses, and how the parameters move that.

    Rows that an instrument does not have are zero.

    Attributes:
        points: Positions (m, k, 3) in the frame of the instrument [m], or their change where a
            reading is a difference. A distance stands in the first coordinate.
        turns: Orientations (m, k, 3, 3) there, in the axes of the instrument; or the turn.
        columns: Derivatives by the P parameters of the model, in SI units; rotations as turns in
            the axes of the instrument. None where they were not asked for.
        by_joints: Derivatives (m, k, rows, n) by the free joints, of the reading that a difference
            ends with; None likewise.
        places: Where the points are (m, k, 3) in the frame of the instrument, of that reading [m].
    """

    points: Array
    turns: Array
    columns: FewColumns | None = None
    by_joints: Array | None = None
    places: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))

    @cached_property
    def jacobian(self) -> Array | None:
        """The derivatives as an array (m, k, rows, P)."""
        if self.columns is None:
            return None
        return self.columns.dense.reshape(*self.columns.part.shape[:3], self.columns.p)

    def less(self, before: "Seen", differs: Mask) -> "Seen":
        """The same with differences in some poses (m,): less what was seen there before.

        The turn of a difference is ``R R0'``, which moves by the vector ``w - R R0' w0``.
        """
        points = self.points.copy()
        points[differs] -= before.points
        turned = self.turns[differs] @ np.swapaxes(before.turns, -1, -2)
        turns = self.turns.copy()
        turns[differs] = turned
        if self.columns is None or before.columns is None:
            return replace(self, points=points, turns=turns)
        first = before.columns.part.copy()
        first[:, :, 3:] = turned @ first[:, :, 3:] if first.shape[2] > 3 else 0.0
        part = self.columns.part.copy()
        part[differs] -= first
        return replace(self, points=points, turns=turns, columns=replace(self.columns, part=part))


@dataclass(frozen=True, eq=False)
class MeasuredModel:
    """What instruments read of a robot: ``x = B prod_j (O_j exp(e_j) exp(xi_j q_j)) tool_i``.

    Joints are turned by springs besides, ``q + sum_i k_i b_i(tau)`` under the loads tau of the
    poses: the free joints, and elastic ones where springs are about other axes, see `Springs`.
    The base's error is after its start B, as those of the joints: B is where the world of the
    drawing is in the frame of the instrument. An instrument reads a marker's position, its pose, or
    the distance of a point from an anchor, which is fixed in the world of the drawing: a distance
    does not depend on B. All have the rows of the widest, of which `present` are read.

    Args:
        robot: The drawing, with its tool frame.
        offsets: Markers (k, 3) from the tool point, in the tool frame, or on another body in the
            frame of its joint [m].
        markers: Names of the instruments (k,).
        parameters: What is unknown, in this order.
        start: The transform B (4, 4) [m].
        rows: "position" for three measured rows a marker, "pose" for all six.
        bodies: The joint (k,) of the chain that moves each marker's body, None for the tool; all
            are on the tool by default.
        kinds: What is read of each (k,); `rows` by default.
        anchors: Fixed ends (k, 3) of the distances [m]; those of others do not count.
        places: The marker (k,) whose place on the robot each has: its own, or that of the marker
            where a distance ends.
        known: Compliances (n,) of the free joints that are known, zero of the others [rad/(N m)];
            None where none is.
        elastic: Elastic joints of the springs that are about other axes than the joints' own.
        gives: How joints with compensators give way about a guess of their compliances, for plans
            and for a start; None without compensators.

    Raises:
        ValueError: Names and offsets do not fit each other.
    """

    robot: Robot
    offsets: Array
    markers: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    start: Array = field(default_factory=lambda: np.eye(4))
    rows: Literal["position", "pose"] = "position"
    bodies: tuple[int | None, ...] = ()
    kinds: tuple[Kind, ...] = ()
    anchors: Array | None = None
    places: tuple[int, ...] = ()
    known: Array | None = None
    elastic: tuple[ElasticJoint, ...] = ()
    gives: GivingWay | None = None

    def __post_init__(self) -> None:
        k = len(self.markers)
        if np.shape(self.offsets) != (k, 3):
            raise ValueError(f"{k} markers, and offsets {np.shape(self.offsets)}")
        # Frozen, and yet defaults depend on how many markers there are.
        for name, default in (("bodies", None), ("kinds", self.rows)):
            if not getattr(self, name):
                object.__setattr__(self, name, (default,) * k)
        if not self.places:
            object.__setattr__(self, "places", tuple(range(k)))
        if self.anchors is None:
            object.__setattr__(self, "anchors", np.zeros((k, 3)))

    @cached_property
    def chain(self) -> ErringChain:
        """The chain of the drawing, with its elastic joints."""
        return ErringChain(sprung(self.robot, self.elastic))

    @cached_property
    def carriers(self) -> tuple[int | None, ...]:
        """The joint (k,) of that chain that moves each marker's body, None for the tool."""
        return tuple(body_of(self.chain.robot, joint) for joint in self.bodies)

    @cached_property
    def springs(self) -> Springs:
        """The springs among the parameters."""
        return Springs.among(self.robot, self.elastic, self.parameters)

    @cached_property
    def numbers(self) -> UnknownNumbers:
        """The numbers of compensators among the parameters."""
        return UnknownNumbers.among(self.robot, self.elastic, self.parameters)

    @cached_property
    def answers(self) -> Answers:
        """How springs and compensators answer loads in a plan."""
        return Answers(self.springs, self.numbers, self.gives)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    @cached_property
    def row_count(self) -> int:
        """Rows of one instrument: three, or six where any orientation is read."""
        return 6 if "pose" in self.kinds else 3

    @cached_property
    def present(self) -> Mask:
        """Which of these (k, rows) each instrument reads."""
        count = np.array([ROWS_OF[kind] for kind in self.kinds])
        return np.arange(self.row_count) < count[:, None]

    @property
    def placed_rows(self) -> Mask:
        """Which of the rows of a pose (k rows,) are positions."""
        positions = (np.arange(self.row_count) < 3) & ~self.is_distance[:, None]
        return np.asarray(positions.reshape(-1))

    @cached_property
    def is_distance(self) -> Mask:
        """Which instruments (k,) read a distance."""
        return np.array([kind == "distance" for kind in self.kinds], dtype=bool)

    @cached_property
    def on_tool(self) -> Mask:
        """Which instruments (k,) read where a marker on the tool is."""
        return np.array([joint is None for joint in self.bodies], dtype=bool) & ~self.is_distance

    @cached_property
    def scales(self) -> Array:
        """Units (p,) in which the parameters are of order one, in SI."""
        return np.array([parameter.scale for parameter in self.parameters])

    @cached_property
    def compliant(self) -> Indices:
        """Indices of the free joints whose compliances are parameters, in their order."""
        names = [one.of for one in self.parameters if one.place == "compliance"]
        return np.array([self.robot.joint_names.index(name) for name in names], dtype=int)

    def with_parameters(self, parameters: tuple[Parameter, ...]) -> "MeasuredModel":
        """The same model with other unknowns."""
        return replace(self, parameters=parameters)

    def of_markers(self, chosen: Indices) -> "MeasuredModel":
        """Some of the instruments, in their order, and the parameters that are theirs."""
        assert self.anchors is not None
        order = chosen.tolist()
        names = tuple(self.markers[i] for i in order)
        own = {i: at for at, i in enumerate(order)}
        return replace(
            self,
            offsets=np.asarray(self.offsets)[order],
            markers=names,
            parameters=tuple(p for p in self.parameters if p.place != "tool" or p.of in names),
            bodies=tuple(self.bodies[i] for i in order),
            kinds=tuple(self.kinds[i] for i in order),
            anchors=self.anchors[order],
            places=tuple(own.get(self.places[i], own[i]) for i in order),
        )

    def carried(self, q: Array) -> Array:
        """Frames (m, 4, 4) of the tool in the drawing's world, or (m, k, 4, 4) of all bodies [m].

        Args:
            q: Joint variables (m, n) [rad or m].
        """
        if all(joint is None for joint in self.bodies):
            return self.robot.forward(q)
        placed = self.chain.place(self.chain.variables(q), np.zeros((self.chain.n, 6)))
        frames = np.tile(np.eye(4), (len(q), len(self.bodies), 1, 1))
        for marker, joint in enumerate(self.carriers):
            frames[:, marker, :3, :3], frames[:, marker, :3, 3] = placed.body(joint)
        return frames

    def at_tool(self, tool: Array) -> "MeasuredModel":
        """The model of a tool frame, in position and orientation, in place of the markers.

        It rides on the last joint, as drawn: parameters of markers are none of it.

        Args:
            tool: Transform (4, 4) after the last joint [m].
        """
        own = tuple(one for one in self.parameters if one.place != "tool")
        return replace(
            self,
            robot=self.robot.with_tool(tool),
            offsets=np.zeros((1, 3)),
            markers=("tool",),
            parameters=own,
            rows="pose",
            bodies=(),
            kinds=(),
            anchors=None,
            places=(),
        )

    def compliances(self, theta: Array) -> Array:
        """Compliances (n,) of all free joints at parameters theta (p,) [rad/(N m)]."""
        k = np.zeros(self.robot.n) if self.known is None else self.known.copy()
        k[self.compliant] = theta[[p.place == "compliance" for p in self.parameters]]
        return k

    def bending(self, theta: Array) -> Bending:
        """What loads turn all joints by, at parameters theta (p,)."""
        known = np.zeros(self.robot.n) if self.known is None else self.known
        springs = self.springs
        known = widened(known, springs.width)
        numbers = self.numbers
        return Bending(springs, theta[springs.of], known, numbers, theta[numbers.of])

    @property
    def rigid(self) -> Bending:
        """The same of a robot that does not give way.

        With unknown numbers of compensators it is the robot of the guess: nothing else shows them.
        """
        springs, numbers = self.springs, self.numbers
        known = np.zeros(self.robot.n)
        if len(numbers.of) and self.gives is not None:
            known = self.gives.compliances
        none = np.zeros(len(springs.of)), widened(known, springs.width)
        return Bending(springs, *none, numbers, np.zeros(len(numbers.of)))

    def brought(self, q: Array, torque: Array) -> Load:
        """Loads (m, s) in poses (m, n) to which commands have brought the loaded joints."""
        gives = self.gives
        if gives is None:
            return Load(torque)
        left = np.ones(torque.shape)
        left[:, : self.robot.n] = replace(gives, brought=True).factors(q.T)[0].T
        m, width = torque.shape
        K = np.broadcast_to(np.diag(widened(gives.compliances, width)), (m, width, width))
        return Load(torque, left[:, :, None] * np.eye(width), K, widened(q, width))

    def see(self, theta: Array, q: Array, torque: Torque = None, derivatives: bool = True) -> Seen:
        """What is read in some poses.

        Args:
            theta: Parameters (p,) in SI units.
            q: Joint variables (m, n) [rad or m].
            torque: Loads (m, s) of the free joints, elastic ones last [N m or N], with those before
                where readings are differences; None for none.
            derivatives: Whether those are computed too.
        """
        if isinstance(torque, LoadsOfReadings):
            after = self._see(theta, q, torque.after, derivatives)
            before = self._see(theta, q[torque.differs], torque.before, derivatives)
            return after.less(before, torque.differs)
        load = Load(torque) if isinstance(torque, np.ndarray) else torque
        return self._see(theta, q, load, derivatives)

    def _see(self, theta: Array, q: Array, load: Load | None, derivatives: bool) -> Seen:
        """What is read in some poses, all readings by themselves."""
        base, errors, tools = self._motions(theta)
        bent = q
        if load is not None:
            bent = widened(q, self.springs.width) + self.bending(theta).turn(load.torque)
            bent = bent + load.turned(self.numbers, theta[self.numbers.of])
        placed = self.chain.place(self.chain.variables(bent), errors)
        points, axes = self._carried(placed, tools[:, :3])
        B = self.start[:3, :3] @ rotation(base[3:])
        origin = self.start[:3, 3] + self.start[:3, :3] @ base[:3]
        levers = points @ B.T
        turns = B @ axes @ rotation(tools[:, 3:])
        places = origin + levers
        seen = Seen(places, turns, places=places)
        if derivatives:
            world = self._in_world(placed, errors, tools, points)
            moved = {name: _turned(B, D) for name, D in world.items()}
            moved["base"] = self._by_base(base, levers)
            columns = self._chosen(moved, load, theta)
            seen = replace(seen, columns=columns, by_joints=moved["springs"][..., : self.robot.n])
        return self._as_read(seen, points, B)

    def _carried(self, placed: PlacedChain, shifts: Array) -> tuple[Array, Array]:
        """Markers (m, k, 3) in the world of the drawing, and the axes (m, k, 3, 3) of bodies."""
        bodies = [placed.body(joint) for joint in self.carriers]
        axes = np.stack([turned for turned, _ in bodies], axis=1)
        origins = np.stack([origin for _, origin in bodies], axis=1)
        return origins + np.einsum("mkij,kj->mki", axes, self.offsets + shifts), axes

    def _as_read(self, seen: Seen, world: Array, B: Array) -> Seen:
        """Distances instead of the positions of their points, and no rows that nothing reads.

        Args:
            seen: Positions and orientations of all, with the base among what moves them.
            world: Points (m, k, 3) in the world of the drawing [m].
            B: Axes (3, 3) of that world in those of the instrument.
        """
        own = np.flatnonzero(self.is_distance)
        points = seen.points
        if len(own):
            assert self.anchors is not None
            wires = world[:, own] - self.anchors[own]
            lengths = np.maximum(np.linalg.norm(wires, axis=-1), NEAREST)
            points = points.copy()
            points[:, own] = 0.0
            points[:, own, 0] = lengths
            seen = replace(seen, points=points)
            directions = (wires / lengths[..., None]) @ B.T
        if seen.columns is None or seen.by_joints is None or self.present.all():
            return seen
        parts = []
        for D in (seen.columns.part, seen.by_joints):
            read = np.where(self.present[..., None], D, 0.0)
            if len(own):
                read[:, own, 0] = np.einsum("mkc,mkcp->mkp", directions, D[:, own, :3])
            parts.append(read)
        of_base = [self.parameters[i].place == "base" for i in self._columns_of_all]
        parts[0][:, own[:, None], :, np.flatnonzero(of_base)] = 0.0
        columns = replace(seen.columns, part=parts[0])
        return replace(seen, columns=columns, by_joints=parts[1])

    def motions_of_many(self, theta: Array) -> tuple[Array, Array, Array]:
        """Motions of the base (w, 6), before the joints (w, N, 6) and of the tools (w, k, 6).

        Args:
            theta: Many sets of parameters (w, p).
        """
        base, errors, tools = (np.tensordot(theta, one, 1) for one in self._by_unit)
        return base, errors, tools

    @cached_property
    def _by_unit(self) -> list[Array]:
        """The same of one unit of each parameter (p, ...): motions are linear in the parameters."""
        parts = [self._motions(one) for one in np.eye(self.p)]
        return [np.array(part) for part in zip(*parts, strict=True)]

    def _motions(self, theta: Array) -> tuple[Array, Array, Array]:
        """Motions of the base (6,), before the joints (N, 6) and of the tools (k, 6)."""
        sizes = {"base": 1, "joint": self.chain.n, "tool": len(self.markers)}
        motions = {place: np.zeros(6 * size) for place, size in sizes.items()}
        for place, (own, at) in self._moving.items():
            motions[place][at] = theta[own]
        tools = motions["tool"].reshape(-1, 6)[list(self.places)]
        return motions["base"], motions["joint"].reshape(-1, 6), tools

    def _in_world(
        self, placed: PlacedChain, errors: Array, tools: Array, points: Array
    ) -> dict[str, Array]:
        """Derivatives (m, k, rows, ...) in the world of the drawing, by what moves the markers."""
        m, k = points.shape[:2]
        by_errors = self.chain.by_errors(placed, errors, points)
        by_joints = self.chain.by_each(placed, points)
        by_tools = np.zeros((m, k, self.row_count, 6))
        axes = np.stack([placed.body(joint)[0] for joint in self.carriers], axis=1)
        by_tools[..., :3, :3] = axes
        if self.row_count == 6:
            turned = self.chain.turns_by_errors(placed, errors)[:, None]
            by_errors = _stacked(by_errors, turned)
            by_joints = _stacked(by_joints, self.chain.turns_by_each(placed)[:, None])
            bends = axes @ left_jacobian(tools[:, 3:])
            by_tools[..., 3:, 3:] = bends
        for marker, joint in enumerate(self.carriers):
            if joint is not None:
                by_errors[:, marker, :, joint + 1 :] = 0.0
                by_joints[:, marker, :, joint + 1 :] = 0.0
        return {
            "joint": by_errors.reshape(m, k, self.row_count, 6 * self.chain.n),
            "springs": self.chain.folded(by_joints),
            "tool": by_tools,
        }

    def _by_base(self, base: Array, levers: Array) -> Array:
        """Derivatives (m, k, rows, 6) by the base's error, in the frame of the instrument."""
        R = self.start[:3, :3]
        bends = R @ left_jacobian(base[3:])
        D = np.zeros((*levers.shape[:2], self.row_count, 6))
        D[..., :3, :3] = R
        D[..., :3, 3:] = np.swapaxes(vector_product(bends.T, levers[:, :, None]), 2, 3)
        if self.row_count == 6:
            D[..., 3:, 3:] = bends
        return D

    @cached_property
    def _moving(self) -> dict[str, tuple[Indices, Indices]]:
        """Parameters that are motions of base, joints or tools, and where each is among these."""
        found = {}
        for place in ("base", "joint", "tool"):
            own = [i for i, one in enumerate(self.parameters) if one.place == place]
            at = [self._place_of(self.parameters[i]) for i in own]
            found[place] = (np.array(own, dtype=int), np.array(at, dtype=int))
        return found

    @cached_property
    def _columns_of_all(self) -> Indices:
        """Which parameters may move what all instruments read: all but the places of markers."""
        own = [i for i, one in enumerate(self.parameters) if one.place != "tool"]
        return np.array(own, dtype=int)

    @cached_property
    def _columns_of_tools(self) -> Indices:
        """Parameters (k, 6) of the place on the robot of each instrument; p where it has none."""
        own = np.full((len(self.markers), 6), self.p)
        for i, one in enumerate(self.parameters):
            if one.place == "tool":
                own[self.markers.index(one.of), COMPONENTS.index(one.component)] = i
        return own[list(self.places)]

    def _chosen(self, moved: dict[str, Array], load: Load | None, theta: Array) -> FewColumns:
        """The columns of the parameters."""
        every, tools = self._columns_of_all, self._columns_of_tools
        some = np.flatnonzero((tools < self.p).any(axis=0))
        shape = moved["joint"].shape[:3]
        part = np.zeros((*shape, len(every) + len(some)))
        for place in ("base", "joint"):
            own, at = self._moving[place]
            part[..., np.searchsorted(every, own)] = moved[place][..., at]
        # A place that is no parameter moves nothing here.
        of_tools = moved["tool"][..., some] * (tools[:, None, some] < self.p)
        part[..., len(every) :] = of_tools
        if load is not None and len(self.springs.of):
            by_terms = load.by_terms(moved["springs"], self.springs)
            for t, at in enumerate(np.searchsorted(every, self.springs.of)):
                part[..., at] += by_terms[..., t]
        if load is not None and len(self.numbers.of):
            sizes = theta[self.numbers.of]
            own = np.searchsorted(every, self.numbers.of)
            part[..., own] = load.by_numbers(moved["springs"], self.numbers, sizes)
        of = np.concatenate([np.tile(every, (len(tools), 1)), tools[:, some]], axis=1)
        return FewColumns(part, of, self.p)

    def _place_of(self, parameter: Parameter) -> int:
        """Where a component of a motion is among those of all bases, joints or tools."""
        c = COMPONENTS.index(parameter.component)
        if parameter.place == "base":
            return c
        names = self.markers if parameter.place == "tool" else self.chain.robot.body_names
        return 6 * names.index(parameter.of) + c


def _turned(B: Array, derivatives: Array) -> Array:
    """Derivatives (m, k, 3 or 6, p) with their three or twice three rows turned by B (3, 3)."""
    m, k, rows, p = derivatives.shape
    return (B @ derivatives.reshape(m, k, rows // 3, 3, p)).reshape(derivatives.shape)


def _stacked(points: Array, turns: Array) -> Array:
    """Rows of points (m, k, 3, ...), then those of turns (m, 1, 3, ...) of the body they are on."""
    return np.concatenate([points, np.broadcast_to(turns, points.shape)], axis=2)
