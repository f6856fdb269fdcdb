"""What instruments see of their markers, and why they do not see the others.

A marker is read in a pose where every eye, a tracker or a camera, sees it: its reflector looks
towards the eye, it is neither too near nor too far, it stands within the eye's angles, and nothing
crosses the beam. A marker that is not read has no rows in that pose.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from edtk.cell.beams import NOTHING, Beams, Passing
from edtk.cell.cell import REACH, chunks, smooth_least
from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import BodyPoint, Frames, cross, dot
from edtk.robots.joint import DEGREE, MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices, Mask

# Keeps gradients finite where an angle has a kink: along the axis that it is counted from.
LEAST_SINE = 1e-12
NEAREST = 1e-9  # distance below which a beam has no direction [m]
UP = np.array([0.0, 0.0, 1.0])
STRAIGHT = 1e-6  # sine of an angle to the vertical below which a direction has no azimuth

Reason = Literal["normal", "near", "far", "azimuth", "elevation", "cone", "beam"]


@dataclass(frozen=True, eq=False)
class Eye:
    """A tracker or a camera: where it stands, and how far and where it sees.

    Angles are counted in its own axes: x to where it faces, y to the left, z up. Azimuth turns
    about z from x to y, and elevation is above the plane of x and y.

    Attributes:
        name: Name for people.
        position: Where it stands (3,), in the world [m].
        axes: Its unit vectors as rows (3, 3), in the world.
        distance: Least and largest distance of a marker [m].
        azimuth: Least and largest azimuth [rad]; None for all around.
        elevation: Least and largest elevation [rad]; None for all.
        cone: Half the opening angle of a round field of view about x [rad]; None for none.
    """

    name: str
    position: Array
    axes: Array = field(default_factory=lambda: np.eye(3))
    distance: tuple[float, float] = (0.0, np.inf)
    azimuth: tuple[float, float] | None = None
    elevation: tuple[float, float] | None = None
    cone: float | None = None


@dataclass(frozen=True, eq=False)
class Reflector:
    """A marker that eyes see.

    Attributes:
        name: Name for people.
        point: Where it is on the robot.
        normal: Unit vector (3,) in the frame of its body, to where it looks; None where it is seen
            from all sides.
        acceptance: Largest angle between the normal and the way to an eye [rad].
    """

    name: str
    point: BodyPoint
    normal: Array | None = None
    acceptance: float = np.pi


class Condition(NamedTuple):
    """One inequality of seeing a marker from an eye.

    Attributes:
        reason: What it is about.
        slack: By how much it holds (...) [m or rad].
        gradient: Derivatives (n, ...) of the slack by the free joints; empty where not asked for.
        amount: What is compared with a bound (...) [m or rad].
    """

    reason: Reason
    slack: Array
    gradient: Array
    amount: Array


LENGTHS = ("near", "far", "beam")
REASONS: dict[Reason, str] = {
    "normal": "looks away by {} deg",
    "near": "nearer than range, at {} mm",
    "far": "beyond range, at {} mm",
    "azimuth": "beyond azimuth, at {} deg",
    "elevation": "beyond elevation, at {} deg",
    "cone": "out of the field of view, {} deg off its axis",
    "beam": "hidden by {}",
}


@dataclass(frozen=True)
class Hidden:
    """Why a marker is not read in a pose.

    Attributes:
        reason: What it is about.
        amount: The distance, or the angle, that is out of bounds [m or rad].
        eye: Name of the eye that does not see it; empty where there is only one.
        body: Name of the body that hides it; empty where none does.
    """

    reason: Reason
    amount: float
    eye: str = ""
    body: str = ""

    def __str__(self) -> str:
        if self.body:
            return REASONS[self.reason].format(self.body) + (f" ({self.eye})" if self.eye else "")
        if self.reason in LENGTHS:
            size = f"{1e3 * self.amount:.0f}"
        else:  # to a tenth, as a marker at the edge of sight may be off by less than a degree
            size = f"{round(float(np.rad2deg(self.amount)), 1) + 0:g}"
        return REASONS[self.reason].format(size) + (f" ({self.eye})" if self.eye else "")


class View(NamedTuple):
    """A marker from an eye, with the index of its instrument."""

    instrument: int
    eye: Eye
    marker: Reflector


@dataclass(frozen=True, eq=False)
class Sight:
    """Which markers are read in which poses.

    Arrays are component first, as in `Frames`.

    Attributes:
        robot: The chain that carries the markers.
        eyes: What must see a marker, so that it is read.
        reflectors: The instruments' markers, one after another; None for an instrument that needs
            no line of sight, such as a wire.
        widths: Number of measured rows of each instrument.
        beams: What may hide a marker; None for nothing.
    """

    robot: Robot
    eyes: tuple[Eye, ...]
    reflectors: tuple[Reflector | None, ...]
    widths: tuple[int, ...]
    beams: Beams | None = None

    @cached_property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames are needed, see `Robot.frames`."""
        found = {joint for one in self.seeable for joint in one.point.bodies}
        return tuple(sorted(found))

    @cached_property
    def bodies_in_beams(self) -> tuple[int, ...]:
        """Joints whose bodies' frames are needed, those that may hide a marker among them."""
        hiding = () if self.beams is None else self.beams.cell.carriers
        return tuple(sorted({*self.bodies, *hiding}))

    @property
    def seeable(self) -> tuple[Reflector, ...]:
        """The markers that need a line of sight."""
        return tuple(one for one in self.reflectors if one is not None)

    def seen(self, q: ArrayLike) -> Mask:
        """Which instruments (..., k) are read in poses q (..., n) [rad or m]."""
        return np.moveaxis(self.seen_in(self.robot.frames(q, self.bodies)), 0, -1)

    @cached_property
    def views(self) -> tuple[View, ...]:
        """Each marker from each eye, markers in the order of instruments."""
        return tuple(
            View(i, eye, one)
            for i, one in enumerate(self.reflectors)
            if one is not None
            for eye in self.eyes
        )

    def seen_in(self, frames: Frames) -> Mask:
        """Which instruments (k, ...) are read in poses whose frames are at hand."""
        frames = self._with_bodies(frames)
        shape = frames.position.shape[1:]
        found = np.ones((len(self.reflectors), *shape), dtype=bool)
        for view, conditions in zip(self.views, _conditions(frames, self.views), strict=True):
            for condition in conditions:
                found[view.instrument] &= condition.slack >= 0
        if self.beams is not None:
            of_view = [view.instrument for view in self.views]
            least, _ = self._look(frames).nearest(found[of_view])
            for instrument, distance in zip(of_view, least, strict=True):
                found[instrument] &= distance.reshape(shape) >= 0
        return found

    def rows(self, q: ArrayLike) -> Mask:
        """Which measured rows (..., r) there are in poses q (..., n) [rad or m]."""
        return np.repeat(self.seen(q), self.widths, axis=-1)

    def rows_in(self, frames: Frames) -> Mask:
        """Which measured rows (r, ...) there are in poses whose frames are at hand."""
        return np.repeat(self.seen_in(frames), self.widths, axis=0)

    def hidden(self, q: ArrayLike) -> list[list["Hidden | None"]]:
        """Why instruments are not read in poses q (m, n), by pose and instrument; None if read.

        Of several reasons the first counts, of the first eye that does not see the marker.
        """
        frames = self.robot.frames(q, self.bodies)
        m = frames.position.shape[-1]
        found: list[list[Hidden | None]] = [[None] * len(self.reflectors) for _ in range(m)]
        conditions = _conditions(frames, self.views)
        if self.beams is not None:
            least, body = self._look(frames).nearest(np.ones((len(self.views), m), dtype=bool))
            for own, distance, index in zip(conditions, least, body, strict=True):
                own.append(Condition("beam", distance, np.zeros((0, m)), index.astype(float)))
        for view, of_view in zip(self.views, conditions, strict=True):
            of_eye = view.eye.name if len(self.eyes) > 1 else ""
            for condition in of_view:
                for pose in np.flatnonzero(condition.slack < 0):
                    if found[pose][view.instrument] is None:
                        amount, hiding = float(condition.amount[pose]), ""
                        if condition.reason == "beam" and self.beams is not None:
                            hiding = self.beams.cell.bodies[int(amount)].name
                        why = Hidden(condition.reason, amount, of_eye, hiding)
                        found[pose][view.instrument] = why
        return found

    def conditions(
        self, frames: Frames, slopes: bool = False, held: Mask | None = None
    ) -> Iterator[tuple[View, Condition]]:
        """All inequalities of each view, that of its beam behind the others.

        Beams take most of the time, and are looked at where an instrument is held alone. The slack
        of one is smooth, as that of `Clear` is: what bodies are nearest changes along a descent.

        Args:
            frames: Poses, with the bodies of the markers.
            slopes: Whether gradients are asked for.
            held: Instruments (k, ...) that are asked for in each pose; None for all.
        """
        shape = frames.q.shape[1:]
        if self.beams is not None:
            asked = np.ones((len(self.views), *shape), dtype=bool)
            if held is not None:
                asked &= held[[view.instrument for view in self.views]]
            slack, change = self._look(frames).smooth(asked, slopes)
        for index, of_view in enumerate(_conditions(frames, self.views, slopes)):
            view = self.views[index]
            for condition in of_view:
                yield view, condition
            if self.beams is not None:
                room = slack[index].reshape(shape)
                yield view, Condition("beam", room, change[:, index].reshape(-1, *shape), room)

    def _look(self, frames: Frames) -> "_Look":
        """What is known of beams in poses whose frames are at hand."""
        known = _known.setdefault(frames, {})
        if self not in known:
            known[self] = _Look(self, frames.flat)
        return known[self]

    def always_hidden(self, q: ArrayLike) -> list[int]:
        """Indices of the instruments that are read in none of the poses q (..., n)."""
        seen = self.seen(q).reshape(-1, len(self.reflectors))
        return np.flatnonzero(~seen.any(axis=0)).tolist()

    def _with_bodies(self, frames: Frames) -> Frames:
        """Frames that have all bodies that matter here."""
        if set(self.bodies) <= set(frames.bodies):
            return frames
        return self.robot.frames(np.moveaxis(frames.q, 0, -1), self.bodies)


class _Look:
    """Beams in some poses (N,): each is looked at once, whoever asks how often."""

    def __init__(self, sight: Sight, poses: Frames) -> None:
        assert sight.beams is not None
        self.beams = sight.beams
        self.views = [(view.eye.position, view.marker.point) for view in sight.views]
        self.frames = partial(sight.robot.frames_of, poses, sight.bodies_in_beams)
        self.joints, self.count = poses.q.shape
        self.known = np.zeros((len(self.views), self.count), dtype=bool)
        self.found = NOTHING

    def near(self, asked: Mask) -> Passing:
        """What beams (b, N) pass, of those that anybody has asked for, as `ravel` counts them."""
        new = asked.reshape(self.known.shape) & ~self.known
        self.known |= new
        poses = np.flatnonzero(new.any(axis=0))
        for part in chunks(len(poses)):
            some = poses[part]
            found = self.beams.passing(self.frames(some), self.views, new[:, some])
            view, pose = np.nonzero(new[:, some])
            beam = (view * self.count + some[pose])[found.beam]
            self.found = Passing.joined([self.found, found._replace(beam=beam)])
        return self.found

    def nearest(self, asked: Mask) -> tuple[Array, Indices]:
        """The least distances (b, N) of beams [m], `REACH` at most, and the bodies that have them.

        Where nothing is near the body is the first one.
        """
        near = self.near(asked)
        least = np.full(self.known.size, REACH)
        body = np.zeros(self.known.size, dtype=int)
        order = np.argsort(-near.distance, kind="stable")
        least[near.beam[order]], body[near.beam[order]] = near.distance[order], near.body[order]
        return least.reshape(self.known.shape), body.reshape(self.known.shape)

    def smooth(self, asked: Mask, slopes: bool) -> tuple[Array, Array]:
        """Smooth slacks (b, N) [m], and derivatives (n, b, N); of no joint if nobody asks."""
        near = self.near(asked)
        every = self.known.shape
        slack, share = smooth_least(near.distance, near.beam, self.known.size)
        if not slopes:
            return slack.reshape(every), np.zeros((0, *every))
        view, pose = np.divmod(near.beam, self.count)
        some, own = np.unique(pose, return_inverse=True)
        change = np.zeros((self.joints, self.known.size))
        if len(some):
            by_joint = share * self.beams.slopes(self.frames(some), self.views, near, view, own)
            change[:] = [np.bincount(near.beam, row, self.known.size) for row in by_joint]
        return slack.reshape(every), change.reshape(self.joints, *every)


# What is known of frames that are still in use.
_known: WeakKeyDictionary[Frames, dict[Sight, _Look]] = WeakKeyDictionary()


def _conditions(
    frames: Frames, views: Sequence[View], slopes: bool = False
) -> list[list[Condition]]:
    """All inequalities of seeing each marker from its eye, but for what is in the way.

    With the range ``r = |p - e|`` of the marker p from the eye e, and the way to it
    ``u = (e - p) / r``, a joint that moves the marker by v changes them by ``dr = -u.v`` and
    ``du = -(v - u u.v) / r``.

    Args:
        frames: Poses, with the bodies of the markers.
        views: The markers and their eyes (k,); arrays of all of them are computed together.
        slopes: Whether gradients are asked for.
    """
    if not views:
        return []
    points = [view.marker.point for view in views]
    p = np.stack([point.position(frames) for point in points], axis=1)
    places = np.array([view.eye.position for view in views]).T
    away = places.reshape(*places.shape, *[1] * (p.ndim - 2)) - p
    r = np.maximum(np.sqrt(np.square(away).sum(axis=0)), NEAREST)
    u = away / r
    none = np.zeros((0, 3, *r.shape))
    v = frames.folded(np.stack([one.linear(frames) for one in points], axis=2)) if slopes else none
    dr = -dot(v, u[None])
    du = -(v + u * dr[:, None]) / r
    off = _off_normals(frames, views, u, du)
    found = []
    for i, view in enumerate(views):
        nearest, farthest = view.eye.distance
        found.append(
            [
                *off.get(i, ()),
                *_bounded("near", r[i], dr[:, i], nearest if nearest > 0 else -np.inf, np.inf),
                *_bounded("far", r[i], dr[:, i], -np.inf, farthest),
                *_angles_of_eye(view.eye, -u[:, i], -du[:, :, i]),
            ]
        )
    return found


def _bounded(
    reason: Reason, amount: Array, change: Array, low: float, high: float
) -> Iterator[Condition]:
    """Bounds on both sides of an amount that changes so (n, ...), as far as there are any."""
    if np.isfinite(low):
        yield Condition(reason, amount - low, change, amount)
    if np.isfinite(high):
        yield Condition(reason, high - amount, -change, amount)


def _off_normals(
    frames: Frames, views: Sequence[View], u: Array, du: Array
) -> dict[int, list[Condition]]:
    """How far reflectors look away from their eyes, by the index of the view.

    An angle phi between unit vectors a and b changes by ``-d(a.b) / sin phi``, and ``n.u`` by
    ``w.(n x u) + n.du`` where the body turns by w.

    Args:
        frames: The poses.
        views: The views (k,).
        u: Unit vectors (3, k, ...) from the markers to the eyes.
        du: Their derivatives (n, 3, k, ...), of no joint where no gradients are asked for.
    """
    normals = {i: x.marker.normal for i, x in enumerate(views) if x.marker.normal is not None}
    if not normals:
        return {}
    which = list(normals)
    points = [views[i].marker.point for i in which]
    looking = [
        np.einsum("k,kc...->c...", normal, point.orientation(frames))
        for normal, point in zip(normals.values(), points, strict=True)
    ]
    n, u, du = np.stack(looking, axis=1), u[:, which], du[:, :, which]
    across = cross(n[None], u[None])[0]
    sine = np.sqrt(np.square(across).sum(axis=0))
    angle = np.arctan2(sine, (n * u).sum(axis=0))
    change = -dot(du, n[None])
    if len(du):
        turning = [
            dot(frames.folded(point.angular(frames)), across[None, :, k])
            for k, point in enumerate(points)
        ]
        change -= np.stack(turning, axis=1)
    change /= np.maximum(sine, LEAST_SINE)
    return {
        i: list(_bounded("normal", angle[k], change[:, k], -np.inf, views[i].marker.acceptance))
        for k, i in enumerate(which)
    }


def _angles_of_eye(eye: Eye, d: Array, dd: Array) -> Iterator[Condition]:
    """The eye's limits on where it sees a marker, in its own axes.

    Args:
        eye: The eye.
        d: Unit vectors (3, ...) from the eye to the marker, in the world.
        dd: Their derivatives (n, 3, ...).
    """
    if eye.azimuth is None and eye.elevation is None and eye.cone is None:
        return
    d = np.einsum("ic,c...->i...", eye.axes, d)
    dd = np.einsum("ic,nc...->ni...", eye.axes, dd)
    flat = np.maximum(np.hypot(d[0], d[1]), LEAST_SINE)
    if eye.azimuth is not None:
        middle, half = (eye.azimuth[0] + eye.azimuth[1]) / 2, (eye.azimuth[1] - eye.azimuth[0]) / 2
        azimuth = np.arctan2(d[1], d[0])
        off = np.mod(azimuth - middle + np.pi, 2 * np.pi) - np.pi
        change = (d[0] * dd[:, 1] - d[1] * dd[:, 0]) / flat**2
        yield Condition("azimuth", half - np.abs(off), -np.sign(off) * change, azimuth)
    if eye.elevation is not None:
        yield from _bounded("elevation", np.arctan2(d[2], flat), dd[:, 2] / flat, *eye.elevation)
    if eye.cone is not None:
        sine = np.hypot(d[1], d[2])
        off = np.arctan2(sine, d[0])
        change = -dd[:, 0] / np.maximum(sine, LEAST_SINE)
        yield from _bounded("cone", off, change, -np.inf, eye.cone)


@dataclass(frozen=True, eq=False)
class AllSeen(Constraint):
    """Markers are read: each of them, or some in some poses.

    Attributes:
        sight: Eyes and markers.
        held: Instruments (k, ...) that have to be read in each pose; None for all of them.
    """

    sight: Sight
    held: Mask | None = None

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """One for each eye, marker and bound."""
        frames = self.sight.robot.frames(np.zeros(robot.n), self.sight.bodies)
        return tuple(
            Inequality(
                f"line of sight of {view.marker.name} ({condition.reason}, {view.eye.name})",
                MILLIMETRE if condition.reason in LENGTHS else DEGREE,
            )
            for view, condition in self.sight.conditions(frames)
        )

    def slack(self, frames: Frames) -> Array:
        """By how much each bound holds (c, ...) [m or rad]; one where it need not."""
        every = self._known.get(frames) or self._conditions(frames)
        return np.stack([np.where(self._must(view), one.slack, 1.0) for view, one in every])

    def gradient(self, frames: Frames) -> Array:
        """Their derivatives (c, n, ...) by the free joints; the slacks are known then, too."""
        every = self._conditions(frames, slopes=True)
        self._known[frames] = every
        return np.stack([np.where(self._must(view), one.gradient, 0.0) for view, one in every])

    @cached_property
    def _known(self) -> WeakKeyDictionary[Frames, list[tuple[View, Condition]]]:
        """The conditions of frames that are still in use."""
        return WeakKeyDictionary()

    def _conditions(self, frames: Frames, slopes: bool = False) -> list[tuple[View, Condition]]:
        return list(self.sight.conditions(self.sight._with_bodies(frames), slopes, self.held))

    def _must(self, view: View) -> Mask | bool:
        """Where (...) a marker has to be read."""
        return True if self.held is None else self.held[view.instrument]


def facing(towards: Array) -> Array:
    """The axes (3, 3) of an eye, as rows: x to where it faces, y to the left, z most upwards.

    One that faces straight up or down has its y-axis along that of the world.

    Args:
        towards: Direction (3,) to which it faces, of any length but zero.
    """
    x = towards / np.linalg.norm(towards)
    y = np.cross(UP, x)
    length = np.linalg.norm(y)
    y = y / length if length > STRAIGHT else np.eye(3)[1]
    return np.stack([x, y, np.cross(x, y)])
