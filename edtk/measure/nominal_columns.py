"""The columns of a geometric model at the geometry of the drawing, and their slopes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.measure.instruments.distance import NEAREST
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import COMPONENTS
from edtk.robots.frames import BodyPoint, Frames, columns_slope, combine
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices, Mask

BASE = -1  # the frame of the base's error, which no joint moves


MOVED = slice(0, 3)  # the rows of a marker that are its position
TURNED = slice(3, 6)  # and those of its orientation, where that is measured


@dataclass(frozen=True, eq=False)
class Wire:
    """Distances of points from their anchors: ``u . dx`` by the directions u of the wires.

    Attributes:
        own: Indices (d,) of the instruments.
        directions: Unit vectors u (d, 3, m) from the anchors to the points.
        lengths: Distances (d, m) [m].
    """

    own: Indices
    directions: Array
    lengths: Array

    def read(self, moved: Array) -> Array:
        """What the wires read (..., d, m) of motions (..., d, 3, m) of their points."""
        return np.asarray((self.directions * moved).sum(axis=-2))

    def turned(self, moved: Array) -> Array:
        """Weights (d, 3, m) of the points' motions v in ``s . du``, for sums s (d, 3, m) of theirs.

        A direction turns by ``du = (v - u u.v) / d``.
        """
        along = self.read(moved)[:, None]
        return np.asarray((moved - self.directions * along) / self.lengths[:, None])


@dataclass(frozen=True)
class Element:
    """One twist that moves markers: a unit vector of a frame, to shift along or to turn about.

    Attributes:
        parameter: Index of the parameter that it belongs to.
        frame: Index of the joint before which the frame is; BASE. For the place of a marker, one
            more than that of the joint that moves its body: the number of joints for the tool.
        turns: Whether it is a turn.
        axis: Which unit vector of the frame; None for the axis of the joint, of a spring.
        marker: The marker whose place it moves, and that it turns about itself; None for all.
        term: The term of the springs whose amplitude it is multiplied by; None for none.
        factor: What it is multiplied by besides.
    """

    parameter: int
    frame: int
    turns: bool
    axis: int | None = None
    marker: int | None = None
    term: int | None = None
    factor: float = 1.0


@dataclass(frozen=True, eq=False)
class NominalColumns:
    """Derivatives of what markers show by small errors, springs and joints, about the drawing.

    With errors of zero, each parameter moves the markers x by a twist: along a unit vector u, or
    about it through a point o, ``u x (x - o)``; those of a spring are multiplied by the amplitudes
    of its terms, which are its load tau as a rule, see `Springs`.
    Where orientations are measured, a marker has three more rows: u of a turn, zero of a shift. All
    arrays are component first, so that every operation runs over contiguous poses; it takes a tenth
    of the time of `MeasuredModel.see`, which knows errors of any size.

    Args:
        model: Markers and parameters; its start is the identity.
    """

    model: MeasuredModel

    @cached_property
    def elements(self) -> tuple[Element, ...]:
        """The twists of all parameters."""
        found = self._of_springs()
        robot = self.robot
        count = len(robot.chain)
        bodies = self.model.carriers
        for i, one in enumerate(self.model.parameters):
            if not one.is_motion:
                continue
            axis = COMPONENTS.index(one.component) % 3
            if one.place == "tool":
                marker = self.model.markers.index(one.of)
                joint = bodies[marker]
                frame = count if joint is None else joint + 1
                found.append(Element(i, frame, one.turns, axis, marker))
            else:
                frame = BASE if one.place == "base" else robot.body_names.index(one.of)
                found.append(Element(i, frame, one.turns, axis))
        return tuple(found)

    def _of_springs(self) -> list[Element]:
        """The twists of springs and compensators: of all joints that each of their terms turns."""
        robot, answers = self.robot, self.model.answers
        turned = answers.out if robot.ties is None else answers.out @ robot.ties.matrix.T
        return [
            Element(
                int(i),
                int(c),
                robot.chain[c].kind == "revolute",
                term=t,
                factor=turned[t, c],
            )
            for t, i in enumerate(answers.of)
            for c in np.flatnonzero(turned[t])
        ]

    @property
    def robot(self) -> Robot:
        """The chain, with its elastic joints."""
        return self.model.chain.robot

    def at(self, q: Array) -> "PlacedColumns":
        """The columns in poses q (m, n) [rad or m]."""
        frames = self.robot.frames(q, tuple(range(len(self.robot.chain))))
        return PlacedColumns(self, frames)


@dataclass(frozen=True, eq=False)
class PlacedColumns:
    """The columns of a model in some poses.

    Attributes:
        columns: What they are columns of.
        frames: The chain in these poses (m), with the frames of all bodies.
    """

    columns: NominalColumns
    frames: Frames

    @property
    def _poses(self) -> int:
        return int(self.frames.position.shape[-1])

    @property
    def _shape(self) -> tuple[int, int, int]:
        """Markers, rows of each, and poses."""
        model = self.columns.model
        return len(model.markers), model.row_count, self._poses

    @property
    def _has_turns(self) -> bool:
        """Whether orientations are measured."""
        return self.columns.model.row_count == 6

    @cached_property
    def points(self) -> Array:
        """Markers (k, 3, m) [m]."""
        model = self.columns.model
        pairs = zip(model.offsets, model.carriers, strict=True)
        return np.stack([BodyPoint(at, joint).position(self.frames) for at, joint in pairs])

    @cached_property
    def _is_plain(self) -> bool:
        """Whether all markers are on the tool, and all of their rows are read."""
        model = self.columns.model
        return bool(model.present.all()) and all(joint is None for joint in model.bodies)

    @cached_property
    def wires(self) -> Wire | None:
        """The distances; None without any."""
        model = self.columns.model
        own = np.flatnonzero(model.is_distance)
        if not len(own):
            return None
        assert model.anchors is not None
        wires = self.points[own] - model.anchors[own, :, None]
        lengths = np.maximum(np.linalg.norm(wires, axis=1), NEAREST)
        return Wire(own, wires / lengths[:, None], lengths)

    def _as_read(self, moved: Array) -> Array:
        """Rows (..., k, rows, m) of all instruments, of motions of their points alike."""
        if self._is_plain:
            return moved
        read = moved * self.columns.model.present[..., None]
        if self.wires is not None:
            own = self.wires.own
            read[..., own, 0, :] = self.wires.read(moved[..., own, MOVED, :])
        return read

    def _of_points(self, B: Array) -> Array:
        """Weights (..., k, rows, m) of the points' motions, for those of all rows that are read."""
        if self.wires is None:
            return B
        own = self.wires.own
        B = B.copy()
        B[..., own, MOVED, :] = B[..., own, :1, :] * self.wires.directions
        return B

    def before(self, joint: int) -> Array:
        """Unit vectors (3, 3, m) of the frame in which the error before a joint is."""
        robot = self.columns.robot
        origin = robot.chain[joint].origin[:3, :3]
        if not joint:
            base = robot.base[:3, :3] @ origin
            return np.broadcast_to(base.T[..., None], (3, 3, self._poses))
        rotation = list(self.frames.bodies[joint - 1][0])
        return np.stack([combine(rotation, origin[:, c]) for c in range(3)])

    @cached_property
    def units(self) -> Array:
        """The unit vector (e, 3, m) of each twist, times its factor."""
        count = len(self.columns.robot.chain)
        frames: dict[int, Array] = {
            BASE: np.broadcast_to(np.eye(3)[..., None], (3, 3, self._poses)),
            count: self.frames.rotation,
        }
        found = np.empty((len(self.columns.elements), 3, self._poses))
        for place, one in zip(found, self.columns.elements, strict=True):
            if one.axis is None:
                place[:] = one.factor * self.frames.axes[one.frame]
                continue
            if one.marker is not None and one.frame < count:
                place[:] = self.frames.bodies[one.frame - 1][0][one.axis]
                continue
            if one.frame not in frames:
                frames[one.frame] = self.before(one.frame)
            place[:] = frames[one.frame][one.axis]
        return found

    @cached_property
    def _reached(self) -> Mask:
        """Whether each joint of the chain (N,), and what is before it, moves each marker (k,)."""
        last = len(self.frames.axes)
        bodies = [last if joint is None else joint for joint in self.columns.model.carriers]
        return np.asarray(np.arange(last)[:, None] <= np.array(bodies))

    @cached_property
    def twists(self) -> Array:
        """How each twist moves the rows (e, k, rows, m), those of springs by amplitudes of one."""
        return self._as_read(self._moves)

    @cached_property
    def _moves(self) -> Array:
        """How each twist moves the points of all instruments (e, k, rows, m)."""
        points = self.points
        model = self.columns.model
        found = np.zeros((len(self.columns.elements), *self._shape))
        for place, u, one in zip(found, self.units, self.columns.elements, strict=True):
            if one.marker is not None:
                its = np.equal(model.places, one.marker)
                place[its, TURNED if one.turns else MOVED] = u
                continue
            if one.turns:
                o = 0.0 if one.frame == BASE else self.frames.origins[one.frame]
                _cross(u, points - o, place[:, MOVED])
                if self._has_turns:
                    place[:, TURNED] = u
            else:
                place[:, MOVED] = u
            if not self._is_plain:
                place[~self._moved_by(one.frame)] = 0.0
        return found

    def _moved_by(self, frame: int) -> Mask:
        """Which instruments (k,) errors in a frame move: anchors stand with the robot's base."""
        return ~self.columns.model.is_distance if frame == BASE else self._reached[frame]

    @cached_property
    def by_joints(self) -> Array:
        """Velocities of the markers per driven joint (n, k, rows, m) [m/rad, 1 if prismatic]."""
        return self._driven(self.by_each)

    def _driven(self, by_each: Array) -> Array:
        """Derivatives (n, ...) by the joints that motors turn, of those (N, ...) by each."""
        return self.frames.folded(by_each)[: self.columns.model.robot.n]

    @cached_property
    def by_each(self) -> Array:
        """The same per joint of the chain (N, k, rows, m)."""
        return self._as_read(self._moves_by_each)

    @cached_property
    def _moves_by_each(self) -> Array:
        """How each joint of the chain moves the points of all instruments (N, k, rows, m)."""
        found = np.zeros((len(self.frames.axes), *self._shape))
        for j, axis in enumerate(self.frames.axes):
            if self.frames.prismatic[j]:
                found[j, :, MOVED] = axis
            else:
                _cross(axis, self.points - self.frames.origins[j], found[j, :, MOVED])
                if self._has_turns:
                    found[j, :, TURNED] = axis
            if not self._is_plain:
                found[j, ~self._reached[j]] = 0.0
        return found

    def _wires_turn(self, b: Array) -> Array:
        """Derivatives (N, m) by each joint of what wires read, by their own turns.

        Args:
            b: Sums (d, 3, m) of the motions of their points, with the weights of the rows.
        """
        assert self.wires is not None
        moved = self._moves_by_each[:, self.wires.own, MOVED]
        return np.asarray(np.einsum("jdcm,dcm->jm", moved, self.wires.turned(b)))

    def jacobian(self, amplitudes: Array | None, differs: Mask | None = None) -> Array:
        """Derivatives of the rows by the parameters (p, k, rows, m), in SI units.

        A difference of a loaded and an unloaded reading sees springs alone, by the difference of
        their amplitudes: any other error of the drawing is in both readings.

        Args:
            amplitudes: Amplitudes (T, m) of the springs' terms, or their differences; None for
                none. Those of the joints' own springs are the loads [N m or N].
            differs: Which readings (m,) are differences; None for none.
        """
        model = self.columns.model
        found = np.zeros((model.p, *self._shape))
        for twist, one in zip(self.twists, self.columns.elements, strict=True):
            if one.term is None:
                found[one.parameter] = twist if differs is None else twist * ~differs
            elif amplitudes is not None:
                found[one.parameter] += amplitudes[one.term] * twist
        return found

    def slope(
        self, B: Array, amplitudes: Array | None, differs: Mask | None = None
    ) -> tuple[Array, Array]:
        """Derivatives of ``<B, jacobian>`` by the driven joints, B and amplitudes held fixed.

        A joint that is before a frame turns all of its twists, ``d(c) = a x c`` for a column c, of
        points and of turns alike. One at or behind it moves the markers alone, by v, and the twist
        of a turn about u by ``u x v``. So, with b the weights of a column,

            d/dq_k = a_k . sum_{frames behind k} c x b + v_k . sum_{others, turns} b x u.

        The row of a distance is that of its point along the wire, whose own turn comes on top.

        Args:
            B: Weights (p, k, rows, m) of the entries.
            amplitudes: Amplitudes (T, m) of the springs' terms; None for none.
            differs: See `jacobian`.

        Returns:
            The derivatives (n, m), and the weights (T, m) of the amplitudes: ``<B, jacobian>`` is
            linear in them, whose own derivatives come on top.
        """
        count = len(self.frames.axes)
        model = self.columns.model
        turning = np.zeros((count + 2, 3, self._poses))  # by frame, that of the base first
        moving = np.zeros((count + 2, *self.points.shape))
        by_amplitudes = np.zeros((len(model.answers.of), self._poses))
        wired = np.zeros(0) if self.wires is None else np.zeros(self.wires.directions.shape)
        B = B if self._is_plain else B * model.present[..., None]
        weights = self._of_points(B)
        for i, (u, one) in enumerate(zip(self.units, self.columns.elements, strict=True)):
            b = weights[one.parameter]
            factor: Array | Mask | None = None if differs is None else ~differs
            if one.term is not None:
                if amplitudes is None:
                    continue
                own = np.einsum("kcm,kcm->m", self.twists[i], B[one.parameter])
                by_amplitudes[one.term] += own
                factor = amplitudes[one.term]
            b = b if factor is None else b * factor
            moves = self._moves[i]
            if one.frame != BASE:
                turning[one.frame + 1] += _crossed(_vectors(moves), _vectors(b))
            if one.turns and one.marker is None:
                own = b[:, MOVED]
                if not self._is_plain:
                    own = own * self._moved_by(one.frame)[:, None, None]
                moving[one.frame + 1] += _turned(own, u)
            if self.wires is not None:
                of_row = B[one.parameter][self.wires.own, :1]
                of_row = of_row if factor is None else of_row * factor
                wired += of_row * moves[self.wires.own, MOVED]
        behind = np.cumsum(turning[::-1], axis=0)[::-1][2:]
        before = np.cumsum(moving, axis=0)[1:-1]
        slope = np.einsum("jcm,jcm->jm", self.frames.angular_of_each, behind)
        slope += np.einsum("jkcm,jkcm->jm", self._moves_by_each[:, :, MOVED], before)
        if self.wires is not None:
            slope += self._wires_turn(wired)
        return self._driven(slope), by_amplitudes

    def motion_slope(self, C: Array) -> Array:
        """Derivatives (n, m) of ``<C, by_joints>`` by the free joints, C (n, k, rows, m) fixed.

        The motions by the joints are columns of a Jacobian for each marker, see `columns_slope`.
        """
        model = self.columns.model
        C = np.concatenate([C, np.zeros((self.columns.robot.n - len(C), *C.shape[1:]))])
        rows = self.frames.spread(C)
        rows = rows if self._is_plain else rows * model.present[..., None]
        by_each = self._of_points(rows)
        moves = self._moves_by_each
        slopes = []
        for marker in range(len(self.points)):
            reached = self._reached[:, marker, None, None]
            slopes.append(
                columns_slope(
                    moves[:, marker, MOVED],
                    self.frames.angular_of_each * reached,
                    by_each[:, marker, MOVED],
                    by_each[:, marker, TURNED] if self._has_turns else None,
                )
            )
        slope = np.sum(slopes, axis=0)
        if self.wires is not None:
            own = self.wires.own
            wired = (rows[:, own, :1] * moves[:, own, MOVED]).sum(axis=0)
            slope = slope + self._wires_turn(wired)
        return self._driven(slope)


def _vectors(rows: Array) -> Array:
    """Rows (k, rows, m) as vectors of points and of turns (k or 2 k, 3, m)."""
    return rows.reshape(-1, 3, rows.shape[-1])


def _cross(u: Array, points: Array, out: Array) -> None:
    """``u x x`` of one vector (3, m) and points (k, 3, m), into (k, 3, m)."""
    out[:, 0] = u[1] * points[:, 2] - u[2] * points[:, 1]
    out[:, 1] = u[2] * points[:, 0] - u[0] * points[:, 2]
    out[:, 2] = u[0] * points[:, 1] - u[1] * points[:, 0]


def _crossed(a: Array, b: Array) -> Array:
    """``sum_k a_k x b_k`` (3, m) of vectors (k, 3, m)."""
    return np.stack(
        [
            (a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]).sum(axis=0),
            (a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]).sum(axis=0),
            (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(axis=0),
        ]
    )


def _turned(b: Array, u: Array) -> Array:
    """``b x u`` (k, 3, m) of vectors (k, 3, m) and one (3, m)."""
    found = np.empty_like(b)
    _cross(-u, b, found)
    return found
