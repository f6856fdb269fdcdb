"""Whether bodies cross a beam: the distance of its points from a convex solid has one least value.

A solid is a segment with a radius, a box, an upright cylinder in a frame of its own, or all that is
below a plane.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array, Mask

MOST_SOLIDS = 10_000
SHARE = (5**0.5 - 1) / 2
STEPS = 45  # of the golden section: a beam of ten metres is known to a hundredth of a micrometre
NUMBERS = {"capsule": 7, "box": 3, "cylinder": 2, "plane": 4}
PLACED = ("box", "cylinder")  # in a frame of their own


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
