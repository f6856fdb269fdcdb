"""Which rows an instrument reads in which poses: angles and lengths of beams, and what hides them.

A solid that may cross a beam is a segment with a radius, a box, an upright cylinder in a frame of
its own, or all that is below a plane: the distance of a beam's points from it has one least value.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.physics import PLACE, Place
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array, Mask

MOST_SOLIDS = 10_000
SHARE = (5**0.5 - 1) / 2
STEPS = 45  # of the golden section: a beam of ten metres is known to a hundredth of a micrometre
NUMBERS = {"capsule": 7, "box": 3, "cylinder": 2, "plane": 4}
PLACED = ("box", "cylinder")  # in a frame of their own
MOST_EYES = 100
EYE_KEYS = ("position", "axes")
ENDS = ("nearest", "farthest", "cone")
PAIRS = ("azimuth", "elevation")
UNIT_LENGTH = 1e-9  # deviation of axes from unit vectors that is rounding


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex body.

    Attributes:
        kind: One of `NUMBERS`.
        size: Both ends and the radius of a capsule; half edges of a box; radius and half height of
            a cylinder; normal and offset of a plane [m].
        frame: Where a box or a cylinder is (4, 4) [m].
        carrier: Index of the joint that moves it; None for none.
        hangs_at: The point (3,) of its carrier from which it hangs, and does not turn; else None.
    """

    kind: str
    size: Array
    frame: Array
    carrier: int | None
    hangs_at: Array | None

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Solid":
        """Read a solid.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, ("kind", "size"), where, ("frame", "carrier", "hangs_at"))
        kind = text(content["kind"], NUMBERS, f"{where}.kind")
        size = numbers(content["size"], (NUMBERS[kind],), f"{where}.size")
        frame = np.eye(4)
        if kind in PLACED:
            frame = numbers(content["frame"], (4, 4), f"{where}.frame")
        carrier = hangs_at = None
        if "carrier" in content:
            carrier = whole(content["carrier"], 0, n - 1, f"{where}.carrier")
            if kind != "capsule":
                raise ValueError(f"{where}: what moves is made of capsules")
        if "hangs_at" in content:
            hangs_at = numbers(content["hangs_at"], (3,), f"{where}.hangs_at")
        return cls(kind, size, frame, carrier, hangs_at)

    def distance(self, x: Array, frame: Array) -> Array:
        """Distances (k,) of points (k, 3), where its carrier has frames (k, 4, 4); zero inside."""
        if self.kind == "plane":
            return np.maximum(x @ self.size[:3] - self.size[3], 0.0)
        if self.kind == "capsule":
            R = np.eye(3) if self.hangs_at is not None else frame[:, :3, :3]
            at = frame[:, :3, 3]
            if self.hangs_at is not None:
                at = at + frame[:, :3, :3] @ self.hangs_at
            own = x - at - R @ self.size[:3]
            way = np.broadcast_to(R @ (self.size[3:6] - self.size[:3]), own.shape)
            square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
            share = np.clip((own * way).sum(axis=1) / square, 0, 1)
            far = np.linalg.norm(own - share[:, None] * way, axis=1)
            return np.maximum(far - self.size[6], 0.0)
        own = (x - self.frame[:3, 3]) @ self.frame[:3, :3]
        if self.kind == "cylinder":
            own = np.stack([np.hypot(own[:, 0], own[:, 1]), own[:, 2]], axis=1)
        return np.asarray(np.linalg.norm(np.maximum(np.abs(own) - self.size, 0.0), axis=1))


@dataclass(frozen=True, eq=False)
class Beams:
    """What may hide a marker.

    Attributes:
        radius: Radius of a beam [m].
        own: Its last part, which the body that carries the marker does not hide [m].
        solids: The bodies.
    """

    radius: float
    own: float
    solids: list[Solid]

    @classmethod
    def from_dict(cls, content: Any, n: int) -> "Beams":
        """Read the part `setting.sight.beams` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.sight.beams"
        content = table(content, ("radius", "own", "solids"), where)
        every = rows(content["solids"], MOST_SOLIDS, f"{where}.solids")
        solids = [Solid.from_dict(one, n, f"{where}.solids[{i}]") for i, one in enumerate(every)]
        radius, own = (number(content[key], f"{where}.{key}") for key in ("radius", "own"))
        return cls(radius, own, solids)

    def pass_all(self, chain: Chain, q: Array, eye: Array, p: Array, carrier: int) -> Mask:
        """Whether beams from an eye (3,) to points (k, 3) of a body cross nothing in poses q."""
        found = np.ones(len(q), dtype=bool)
        frames = chain.frames(q)
        length = np.linalg.norm(p - eye, axis=1, keepdims=True)
        short = eye + (p - eye) * np.maximum(1 - self.own / length, 0)
        for one in self.solids:
            end = short if one.carrier == carrier else p
            still = np.broadcast_to(np.eye(4), (len(q), 4, 4))
            frame = still if one.carrier is None else frames[one.carrier]
            found &= _least(one, eye, end, frame) >= self.radius
        return found


def _least(one: Solid, start: Array, end: Array, frame: Array) -> Array:
    """Least distance (k,) of the segments from start (3,) to ends (k, 3), by the golden section."""

    def at(t: Array) -> Array:
        return one.distance(start + t[:, None] * (end - start), frame)

    low, high = np.zeros(len(end)), np.ones(len(end))
    a, b = high - SHARE * (high - low), low + SHARE * (high - low)
    of_a, of_b = at(a), at(b)
    least = np.minimum(at(low), at(high))
    for _ in range(STEPS):
        least = np.minimum(least, np.minimum(of_a, of_b))
        left = of_a <= of_b
        low, high = np.where(left, low, a), np.where(left, b, high)
        a, b = high - SHARE * (high - low), low + SHARE * (high - low)
        of_a, of_b = at(a), at(b)
    return np.asarray(least)


@dataclass(frozen=True, eq=False)
class Eye:
    """A tracker or a camera.

    Attributes:
        position: Where it stands (3,) [m].
        axes: Its unit vectors as rows (3, 3): ahead, to the left, up.
        lengths: Least and largest length of a beam [m].
        azimuth: Least and largest angle to the left of ahead [rad]; None for any.
        elevation: Least and largest angle up [rad]; None for any.
        cone: Largest angle off the direction ahead [rad]; None for any.
    """

    position: Array
    axes: Array
    lengths: tuple[float, float]
    azimuth: Array | None
    elevation: Array | None
    cone: float | None

    @classmethod
    def from_dict(cls, content: Any, where: str) -> "Eye":
        """Read an eye.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, EYE_KEYS, where, (*ENDS, *PAIRS))
        axes = numbers(content["axes"], (3, 3), f"{where}.axes")
        if np.abs(axes @ axes.T - np.eye(3)).max() > UNIT_LENGTH:
            raise ValueError(f"{where}.axes: expected unit vectors at right angles")
        pairs = {
            key: numbers(content[key], (2,), f"{where}.{key}") for key in PAIRS if key in content
        }
        ends = {key: number(content[key], f"{where}.{key}") for key in ENDS if key in content}
        return cls(
            numbers(content["position"], (3,), f"{where}.position"),
            axes,
            (ends.get("nearest", 0.0), ends.get("farthest", np.inf)),
            pairs.get("azimuth"),
            pairs.get("elevation"),
            ends.get("cone"),
        )

    def sees(self, p: Array) -> Mask:
        """Whether points (k, 3) are within its lengths and angles."""
        x, y, z = self.axes @ (p - self.position).T
        length = np.sqrt(x**2 + y**2 + z**2)
        found = (self.lengths[0] <= length) & (length <= self.lengths[1])
        if self.azimuth is not None:
            low, high = self.azimuth
            found &= (np.arctan2(y, x) - low) % (2 * np.pi) <= high - low
        if self.elevation is not None:
            up = np.arcsin(np.clip(z / length, -1, 1))
            found &= (self.elevation[0] <= up) & (up <= self.elevation[1])
        if self.cone is not None:
            found &= np.arccos(np.clip(x / length, -1, 1)) <= self.cone
        return np.asarray(found)


@dataclass(frozen=True, eq=False)
class Marker:
    """A marker that eyes see.

    Attributes:
        place: Where it is.
        normal: Where it looks (3,), in the frame of its body; None where that does not matter.
        acceptance: Largest angle between that and the way to an eye [rad].
    """

    place: Place
    normal: Array | None
    acceptance: float

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Marker":
        """Read a marker.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, PLACE, where, ("normal", "acceptance"))
        normal, acceptance = None, np.pi
        if "normal" in content:
            normal = numbers(content["normal"], (3,), f"{where}.normal")
            acceptance = number(content["acceptance"], f"{where}.acceptance")
            if abs(np.linalg.norm(normal) - 1) > UNIT_LENGTH:
                raise ValueError(f"{where}.normal: expected a unit vector")
        return cls(Place.from_dict(content, n, where), normal, acceptance)

    def looks_at(self, chain: Chain, q: Array, eye: Eye) -> Mask:
        """Whether it looks towards an eye in poses q (k, n)."""
        if self.normal is None:
            return np.ones(len(q), dtype=bool)
        R = chain.frames(q)[-1 if self.place.joint is None else self.place.joint][:, :3, :3]
        way = eye.position - chain.point(q, self.place.offset, self.place.joint)
        cosine = np.einsum("kij,j,ki->k", R, self.normal, way) / np.linalg.norm(way, axis=1)
        return np.asarray(np.arccos(np.clip(cosine, -1, 1)) <= self.acceptance)


@dataclass(frozen=True, eq=False)
class Sight:
    """Which instruments are read in which poses.

    Attributes:
        eyes: All of which must see a marker.
        markers: One an instrument; None for one that needs no line of sight.
        widths: Rows of each instrument.
        needs_all: Whether a pose is allowed only if each marker is read.
        beams: What may hide a marker; None for nothing.
    """

    eyes: list[Eye]
    markers: list[Marker | None]
    widths: list[int]
    needs_all: bool
    beams: Beams | None = None

    @classmethod
    def from_dict(cls, content: Any, n: int, widths: list[int]) -> "Sight":
        """Read the part `setting.sight` of a certificate.

        Args:
            content: The part.
            n: Number of all joints.
            widths: Rows of each instrument.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.sight"
        content = table(content, ("eyes", "markers", "needs_all"), where, ("beams",))
        eyes = rows(content["eyes"], MOST_EYES, f"{where}.eyes")
        markers = rows(content["markers"], len(widths), f"{where}.markers")
        if not eyes or len(markers) < len(widths):
            raise ValueError(f"{where}: expected an eye, and as many markers as instruments")
        found = [
            None if one is None else Marker.from_dict(one, n, f"{where}.markers[{i}]")
            for i, one in enumerate(markers)
        ]
        return cls(
            [Eye.from_dict(one, f"{where}.eyes[{i}]") for i, one in enumerate(eyes)],
            found,
            widths,
            bool(whole(content["needs_all"], 0, 1, f"{where}.needs_all")),
            Beams.from_dict(content["beams"], n) if "beams" in content else None,
        )

    def seen(self, chain: Chain, q: Array) -> Mask:
        """Which instruments (k, s) are read in poses q (k, n)."""
        found = np.ones((len(q), len(self.markers)), dtype=bool)
        for i, one in enumerate(self.markers):
            if one is None:
                continue
            p = chain.point(q, one.place.offset, one.place.joint)
            for eye in self.eyes:
                found[:, i] &= eye.sees(p) & one.looks_at(chain, q, eye)
                some = np.flatnonzero(found[:, i])
                if self.beams is not None and len(some):
                    joint = len(chain.axes) - 1 if one.place.joint is None else one.place.joint
                    given = (chain, q[some], eye.position, p[some], joint)
                    found[some, i] = self.beams.pass_all(*given)
        return found

    def rows(self, chain: Chain, q: Array) -> Mask:
        """Which rows (k, r) there are."""
        return np.repeat(self.seen(chain, q), self.widths, axis=1)
