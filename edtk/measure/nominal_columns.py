"""The columns of a geometric model at the geometry of the drawing, and their slopes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.measure.geometric_model import GeometricModel
from edtk.measure.parameters import COMPONENTS
from edtk.robots.frames import Frames, columns_slope, combine
from edtk.system.typing import Array

BASE = -1  # the frame of the base's error, which no joint moves


MOVED = slice(0, 3)  # the rows of a marker that are its position
TURNED = slice(3, 6)  # and those of its orientation, where that is measured


@dataclass(frozen=True)
class Element:
    """One twist that moves markers: a unit vector of a frame, to shift along or to turn about.

    Attributes:
        parameter: Index of the parameter that it belongs to.
        frame: Index of the joint before which the frame is; BASE, or the number of joints for the
            tool.
        turns: Whether it is a turn.
        axis: Which unit vector of the frame; None for the axis of the joint, of a spring.
        marker: The only marker that it moves, and turns about itself; None for all.
        joint: The free joint whose load it is multiplied by; None for none.
        factor: What it is multiplied by besides.
    """

    parameter: int
    frame: int
    turns: bool
    axis: int | None = None
    marker: int | None = None
    joint: int | None = None
    factor: float = 1.0


@dataclass(frozen=True, eq=False)
class NominalColumns:
    """Derivatives of what markers show by small errors, springs and joints, about the drawing.

    With errors of zero, each parameter moves the markers x by a twist: along a unit vector u, or
    about it through a point o, ``u x (x - o)``; that of a spring is multiplied by its load tau.
    Where orientations are measured, a marker has three more rows: u of a turn, zero of a shift. All
    arrays are component first, so that every operation runs over contiguous poses; it takes a tenth
    of the time of `GeometricModel.see`, which knows errors of any size.

    Args:
        model: Markers and parameters; its start is the identity.
    """

    model: GeometricModel

    @cached_property
    def elements(self) -> tuple[Element, ...]:
        """The twists of all parameters."""
        found: list[Element] = []
        robot = self.model.robot
        count = len(robot.chain)
        ties = np.eye(count) if robot.ties is None else robot.ties.matrix
        for i, one in enumerate(self.model.parameters):
            if one.place == "compliance":
                j = robot.joint_names.index(one.of)
                found += [
                    Element(
                        i, int(c), robot.chain[c].kind == "revolute", joint=j, factor=ties[c, j]
                    )
                    for c in np.flatnonzero(ties[:, j])
                ]
                continue
            axis = COMPONENTS.index(one.component) % 3
            if one.place == "tool":
                marker = self.model.markers.index(one.of)
                found.append(Element(i, count, one.turns, axis, marker))
            else:
                frame = BASE if one.place == "base" else robot.body_names.index(one.of)
                found.append(Element(i, frame, one.turns, axis))
        return tuple(found)

    def at(self, q: Array) -> "PlacedColumns":
        """The columns in poses q (m, n) [rad or m]."""
        robot = self.model.robot
        frames = robot.frames(q, tuple(range(len(robot.chain))))
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
        return self.columns.model.rows == "pose"

    @cached_property
    def points(self) -> Array:
        """Markers (k, 3, m) [m]."""
        offsets = self.columns.model.offsets
        turned = [combine(list(self.frames.rotation), offset) for offset in offsets]
        return np.stack([self.frames.position + own for own in turned])

    def before(self, joint: int) -> Array:
        """Unit vectors (3, 3, m) of the frame in which the error before a joint is."""
        robot = self.columns.model.robot
        origin = robot.chain[joint].origin[:3, :3]
        if not joint:
            base = robot.base[:3, :3] @ origin
            return np.broadcast_to(base.T[..., None], (3, 3, self._poses))
        rotation = list(self.frames.bodies[joint - 1][0])
        return np.stack([combine(rotation, origin[:, c]) for c in range(3)])

    @cached_property
    def units(self) -> Array:
        """The unit vector (e, 3, m) of each twist, times its factor."""
        count = len(self.columns.model.robot.chain)
        frames: dict[int, Array] = {
            BASE: np.broadcast_to(np.eye(3)[..., None], (3, 3, self._poses)),
            count: self.frames.rotation,
        }
        found = np.empty((len(self.columns.elements), 3, self._poses))
        for place, one in zip(found, self.columns.elements, strict=True):
            if one.axis is None:
                place[:] = one.factor * self.frames.axes[one.frame]
                continue
            if one.frame not in frames:
                frames[one.frame] = self.before(one.frame)
            place[:] = frames[one.frame][one.axis]
        return found

    @cached_property
    def twists(self) -> Array:
        """How each twist moves the markers (e, k, rows, m), springs by a load of one."""
        points = self.points
        found = np.zeros((len(self.columns.elements), *self._shape))
        for place, u, one in zip(found, self.units, self.columns.elements, strict=True):
            if one.marker is not None:
                place[one.marker, TURNED if one.turns else MOVED] = u
            elif one.turns:
                o = 0.0 if one.frame == BASE else self.frames.origins[one.frame]
                _cross(u, points - o, place[:, MOVED])
                if self._has_turns:
                    place[:, TURNED] = u
            else:
                place[:, MOVED] = u
        return found

    @cached_property
    def by_joints(self) -> Array:
        """Velocities of the markers per free joint (n, k, rows, m) [m/rad, or 1 if prismatic]."""
        return self.frames.folded(self.by_each)

    @cached_property
    def by_each(self) -> Array:
        """The same per joint of the chain (N, k, rows, m)."""
        found = np.zeros((len(self.frames.axes), *self._shape))
        for j, axis in enumerate(self.frames.axes):
            if self.frames.prismatic[j]:
                found[j, :, MOVED] = axis
                continue
            _cross(axis, self.points - self.frames.origins[j], found[j, :, MOVED])
            if self._has_turns:
                found[j, :, TURNED] = axis
        return found

    def jacobian(self, torque: Array | None) -> Array:
        """Derivatives of the markers by the parameters (p, k, rows, m), in SI units.

        Args:
            torque: Loads (n, m) of the free joints [N m or N]; None for none.
        """
        model = self.columns.model
        found = np.zeros((model.p, *self._shape))
        for twist, one in zip(self.twists, self.columns.elements, strict=True):
            if one.joint is None:
                found[one.parameter] = twist
            elif torque is not None:
                found[one.parameter] += torque[one.joint] * twist
        return found

    def slope(self, B: Array, torque: Array | None) -> tuple[Array, Array]:
        """Derivatives of ``<B, jacobian>`` by the free joints, weights B and loads held fixed.

        A joint that is before a frame turns all of its twists, ``d(c) = a x c`` for a column c, of
        points and of turns alike. One at or behind it moves the markers alone, by v, and the twist
        of a turn about u by ``u x v``. So, with b the weights of a column,

            d/dq_k = a_k . sum_{frames behind k} c x b + v_k . sum_{others, turns} b x u.

        Args:
            B: Weights (p, k, rows, m) of the entries.
            torque: Loads (n, m) of the free joints; None for none.

        Returns:
            The derivatives (n, m), and the weights (n, m) of the loads: ``<B, jacobian>`` is linear
            in the loads, whose own derivatives come on top.
        """
        count = len(self.frames.axes)
        turning = np.zeros((count + 2, 3, self._poses))  # by frame, that of the base first
        moving = np.zeros((count + 2, *self.points.shape))
        by_torque = np.zeros((self.columns.model.robot.n, self._poses))
        for twist, u, one in zip(self.twists, self.units, self.columns.elements, strict=True):
            b = B[one.parameter]
            if one.joint is not None:
                if torque is None:
                    continue
                by_torque[one.joint] += np.einsum("kcm,kcm->m", twist, b)
                b = b * torque[one.joint]
            if one.frame != BASE:
                turning[one.frame + 1] += _crossed(_vectors(twist), _vectors(b))
            if one.turns and one.marker is None:
                moving[one.frame + 1] += _turned(b[:, MOVED], u)
        behind = np.cumsum(turning[::-1], axis=0)[::-1][2:]
        before = np.cumsum(moving, axis=0)[1:-1]
        slope = np.einsum("jcm,jcm->jm", self.frames.angular_of_each, behind)
        slope += np.einsum("jkcm,jkcm->jm", self.by_each[:, :, MOVED], before)
        return self.frames.folded(slope), by_torque

    def motion_slope(self, C: Array) -> Array:
        """Derivatives (n, m) of ``<C, by_joints>`` by the free joints, C (n, k, rows, m) fixed.

        The motions by the joints are columns of a Jacobian for each marker, see `columns_slope`.
        """
        by_each = self.frames.spread(C)
        angular = self.frames.angular_of_each
        slopes = [
            columns_slope(
                self.by_each[:, marker, MOVED],
                angular,
                by_each[:, marker, MOVED],
                by_each[:, marker, TURNED] if self._has_turns else None,
            )
            for marker in range(len(self.points))
        ]
        return self.frames.folded(np.sum(slopes, axis=0))


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
