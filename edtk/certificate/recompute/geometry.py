"""What positions tell of geometry and springs together, one column after the other."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.physics import (
    MEASURED,
    Physics,
    Place,
    Weight,
    read_weights,
    weight_torque,
)
from edtk.certificate.recompute.plain_data import rows, table, text, whole
from edtk.system.typing import Array

WHERE = "setting.geometry"
PLACES = ("base", "joint", "tool", "compliance")
MOST_PARAMETERS = 300
LONGEST_NAME = 200
UNIT = 1e-3  # of a shift [m] and of a turn [rad]
SOFTNESS = 1e-6  # of a spring [rad/(N m) or m/N]


@dataclass(frozen=True)
class Parameter:
    """One unknown: a small motion of a frame, or a spring.

    Attributes:
        name: Its name.
        place: What it moves: "base", the frame before a "joint", a "tool", or a "compliance".
        of: Index of the joint among all, of the marker, or of the free joint; zero for the base.
        component: 0 to 2 for a shift along an axis of its frame, 3 to 5 for a turn about one.
    """

    name: str
    place: str
    of: int
    component: int

    @property
    def axis(self) -> int:
        """Which axis of its frame."""
        return self.component % 3

    @property
    def turns(self) -> bool:
        """Whether it turns."""
        return self.component >= 3


@dataclass(frozen=True, eq=False)
class Geometry:
    """The unknowns of a study of geometry, in their own units (mm, mrad, 1e-6 rad/(N m)).

    Attributes:
        parameters: The unknowns.
        payload: Mass [kg] and centre of what the robot carries wherever a wrench loads it.
        changes: Whether visits under a wrench are read as a loaded position less an unloaded one.
        places: The instrument (k,) whose place on the robot each has: its own, as a rule.
    """

    parameters: list[Parameter]
    payload: list[Weight]
    changes: bool = False
    places: tuple[int, ...] = ()

    @classmethod
    def from_dict(cls, content: Any, chain: Chain, physics: Physics) -> "Geometry":
        """Read the part `setting.geometry` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, ("parameters", "payload"), WHERE, ("changes", "places"))
        changes = content.get("changes", False)
        if not isinstance(changes, bool):
            raise ValueError(f"{WHERE}.changes: expected true or false")
        found = []
        sizes = {
            "base": 1,
            "joint": len(chain.axes),
            "tool": len(physics.sensors),
            "compliance": chain.n,
        }
        for i, one in enumerate(rows(content["parameters"], MOST_PARAMETERS, WHERE)):
            place = f"{WHERE}.parameters[{i}]"
            one = table(one, ("name", "place", "of", "component"), place)
            name = one["name"]
            # Names are printed, so that none must hold a line that looks like a verdict.
            if not isinstance(name, str) or not name.isprintable() or len(name) > LONGEST_NAME:
                raise ValueError(f"{place}.name: expected a name")
            kind = text(one["place"], PLACES, f"{place}.place")
            of = whole(one["of"], 0, sizes[kind] - 1, f"{place}.of")
            last = 0 if kind == "compliance" else 5
            component = whole(one["component"], 0, last, f"{place}.component")
            found.append(Parameter(name, kind, of, component))
        if not found:
            raise ValueError(f"{WHERE}.parameters: expected at least one")
        k = len(physics.sensors)
        given = rows(content.get("places", list(range(k))), k, f"{WHERE}.places")
        places = tuple(whole(one, 0, k - 1, f"{WHERE}.places") for one in given)
        if len(places) != k:
            raise ValueError(f"{WHERE}.places: expected one an instrument")
        weights = read_weights(content["payload"], len(chain.axes), f"{WHERE}.payload")
        return cls(found, weights, changes, places)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def rows(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Rows (k, measured, p) [m, rad] of poses q (k, n) under wrenches (k, 6), unit by unit.

        A loaded reading less an unloaded one moves with springs alone, by the change of the loads;
        both of them err, so that its covariance is twice that of one.
        """
        torque = self._torque(chain, physics, q, wrench)
        differs = (wrench != 0).any(axis=1) & self.changes
        if differs.any():
            before = self._torque(chain, physics, q, np.zeros_like(wrench))
            torque = np.where(differs[:, None], torque - before, torque)
        parts = []
        for marker, (kind, place, anchor) in enumerate(physics.sensors):
            own = self._of_point(chain, torque, q, place, self.places[marker])
            if kind == "distance":
                own = self._along(chain, q, place, anchor, own)
            parts.append(own[:, : MEASURED[kind]])
        rigid = np.array([one.place != "compliance" for one in self.parameters])
        still = differs[:, None] & rigid
        size = np.where(differs, np.sqrt(0.5), 1.0)
        return np.asarray(np.concatenate(parts, axis=1) * (size[:, None] * ~still)[:, None])

    def of_tool(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Rows (k, 6, p) of the tool frame of a chain, which parameters of markers do not move."""
        torque = self._torque(chain, physics, q, wrench)
        return self._of_point(chain, torque, q, Place(np.zeros(3), None), None)

    def _along(self, chain: Chain, q: Array, place: Place, anchor: Array, moved: Array) -> Array:
        """Rows (k, 1, p) of a distance from an anchor, which stands with the robot's base."""
        wire = chain.point(q, place.offset, place.joint) - anchor
        direction = wire / np.linalg.norm(wire, axis=1)[:, None]
        apart = np.array([one.place != "base" for one in self.parameters])
        return np.asarray(np.einsum("kr,krp->kp", direction, moved[:, :3])[:, None] * apart)

    def _of_point(
        self, chain: Chain, torque: Array, q: Array, place: Place, marker: int | None
    ) -> Array:
        """Rows (k, 6, p) of a point that sits on a marker, or on none."""
        frames = chain.frames(q)
        point = chain.point(q, place.offset, place.joint)
        springs = chain.jacobian(q, place.offset, place.joint)
        columns = [
            SOFTNESS * springs[:, :, one.of] * torque[:, one.of, None]
            if one.place == "compliance"
            else UNIT * _moved(one, chain, frames, point, marker, place.joint)
            for one in self.parameters
        ]
        return np.stack(columns, axis=-1)

    def _torque(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Loads (k, n) of the free joints: of the wrench, of the links, of a payload beside it."""
        at_load = chain.jacobian(q, physics.load_point.offset, physics.load_point.joint)
        torque = np.einsum("krn,kr->kn", at_load, wrench) + weight_torque(chain, physics.weights, q)
        loaded = (wrench != 0).any(axis=1, keepdims=True)
        return np.asarray(torque + loaded * weight_torque(chain, self.payload, q))


def _moved(
    one: Parameter,
    chain: Chain,
    frames: list[Array],
    point: Array,
    marker: int | None,
    joint: int | None,
) -> Array:
    """How a point (k, 3) of a marker, on the body of a joint, moves and turns (k, 6) by a unit."""
    still = np.zeros((len(point), 6))
    if one.place == "base":
        frame = np.broadcast_to(np.eye(4), (len(point), 4, 4))
    elif one.place == "joint":
        if joint is not None and one.of > joint:
            return still
        before = chain.base[None] if one.of == 0 else frames[one.of - 1]
        frame = np.broadcast_to(before @ chain.origins[one.of], (len(point), 4, 4))
    elif one.of != marker:
        return still
    else:
        # A tool's own turn is about the marker itself.
        frame = np.array(frames[-1 if joint is None else joint])
        frame[:, :3, 3] = point
    axis = frame[:, :3, one.axis]
    if one.turns:
        return np.concatenate([np.cross(axis, point - frame[:, :3, 3]), axis], axis=1)
    still[:, :3] = axis
    return still
