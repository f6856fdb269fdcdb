"""What is measured and what loads the joints, where that is not the tool point alone."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array

GRAVITY = 9.80665  # standard acceleration [m/s^2], along -z of the world
MEASURED = {"position": 3, "pose": 6, "distance": 1}  # rows of each kind of instrument
MOST_SENSORS = 100
MOST_WEIGHTS = 64
PLACE = ("offset", "joint")


@dataclass(frozen=True, eq=False)
class Place:
    """A point of the tool, or of the body of a joint.

    Attributes:
        offset: Offset (3,) in the frame of the tool, or of the joint [m].
        joint: Index of the joint; None for the tool.
    """

    offset: Array
    joint: int | None

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Place":
        """Read the keys `offset` and `joint` of a table.

        Raises:
            ValueError: They are no point of a robot with n joints.
        """
        joint = content["joint"]
        index = None if joint is None else whole(joint, 0, n - 1, f"{where}.joint")
        return cls(numbers(content["offset"], (3,), f"{where}.offset"), index)


Weight = tuple[float, Place]  # mass [kg] and centre of mass


@dataclass(frozen=True, eq=False)
class Physics:
    """Instruments, load point and weights.

    Attributes:
        sensors: Kind, point and anchor (3,) of each instrument; anchors count for distances [m].
        load_point: Where the wrench acts.
        weights: Mass [kg] and centre of mass of each weight.
    """

    sensors: list[tuple[str, Place, Array]]
    load_point: Place
    weights: list[Weight]

    @classmethod
    def from_dict(cls, content: Any, n: int) -> "Physics":
        """Read the part `setting.physics` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.physics"
        content = table(content, ("sensors", "load_point", "weights"), where)
        sensors = []
        for i, sensor in enumerate(rows(content["sensors"], MOST_SENSORS, f"{where}.sensors")):
            place = f"{where}.sensors[{i}]"
            sensor = table(sensor, ("kind", *PLACE), place, ("anchor",))
            kind = text(sensor["kind"], MEASURED, f"{place}.kind")
            anchor = numbers(sensor.get("anchor", [0, 0, 0]), (3,), f"{place}.anchor")
            sensors.append((kind, Place.from_dict(sensor, n, place), anchor))
        if not sensors:
            raise ValueError(f"{where}.sensors: expected at least one")
        load_point = table(content["load_point"], PLACE, f"{where}.load_point")
        return cls(
            sensors,
            Place.from_dict(load_point, n, f"{where}.load_point"),
            read_weights(content["weights"], n, f"{where}.weights"),
        )

    @classmethod
    def at_tool_point(cls, rows: str) -> "Physics":
        """Load and measurement, "position" or "pose", at the tool point."""
        place = Place(np.zeros(3), None)
        return cls([(rows, place, np.zeros(3))], place, [])

    @property
    def measured(self) -> int:
        """Number of measured rows."""
        return sum(MEASURED[kind] for kind, _, _ in self.sensors)

    def regressors(self, chain: Chain, unknown: list[int], q: Array, wrench: Array) -> Array:
        """Regressors (k, rows, p): motion of what is measured times the torque of its joint."""
        at_load = chain.jacobian(q, self.load_point.offset, self.load_point.joint)
        torque = np.einsum("krn,kr->kn", at_load, wrench) + weight_torque(chain, self.weights, q)
        return np.asarray((self.motion(chain, q) * torque[:, None])[:, :, unknown])

    def motion(self, chain: Chain, q: Array) -> Array:
        """Derivatives (k, rows, n) of all measured rows by the joints, at poses q (k, n)."""
        return np.concatenate([self._motion(chain, q, *sensor) for sensor in self.sensors], axis=1)

    def positions(self, A: Array) -> Array:
        """The rows (rows, p) of a measurement that are positions, not rotations or distances."""
        kept = []
        for kind, _, _ in self.sensors:
            kept += [row < 3 and kind != "distance" for row in range(MEASURED[kind])]
        return np.asarray(A[np.array(kept)])

    def _motion(self, chain: Chain, q: Array, kind: str, place: Place, anchor: Array) -> Array:
        """Derivatives (k, rows, n) of the rows of one instrument by the joints."""
        columns = chain.jacobian(q, place.offset, place.joint)
        if kind == "pose":
            return columns
        if kind == "position":
            return columns[:, :3]
        wire = chain.point(q, place.offset, place.joint) - anchor
        length = np.linalg.norm(wire, axis=1)
        return np.asarray(wire[:, None] @ columns[:, :3] / length[:, None, None])


def read_weights(content: Any, n: int, where: str) -> list[Weight]:
    """Masses [kg] and their centres.

    Raises:
        ValueError: They are none, or a mass is negative.
    """
    found = []
    for i, weight in enumerate(rows(content, MOST_WEIGHTS, where)):
        place = f"{where}[{i}]"
        weight = table(weight, ("mass", *PLACE), place)
        mass = number(weight["mass"], f"{place}.mass")
        if mass < 0:
            raise ValueError(f"{place}.mass: expected a number from 0 on")
        found.append((mass, Place.from_dict(weight, n, place)))
    return found


def weight_torque(chain: Chain, weights: Collection[Weight], q: Array) -> Array:
    """Joint loads (k, n) of weights [N m, or N if prismatic]: ``-m g dz/dq``, one after another."""
    torque = np.zeros_like(q)
    for mass, place in weights:
        torque -= mass * GRAVITY * chain.jacobian(q, place.offset, place.joint)[:, 2]
    return torque
