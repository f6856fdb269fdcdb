"""Which rows an instrument reads in which poses, by the angles and lengths of each beam."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.beams import Beams
from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.physics import PLACE, Place
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, whole
from edtk.system.typing import Array, Mask

MOST_EYES = 100
EYE_KEYS = ("position", "axes")
ENDS = ("nearest", "farthest", "cone")
PAIRS = ("azimuth", "elevation")
UNIT_LENGTH = 1e-9  # deviation of axes from unit vectors that is rounding


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
