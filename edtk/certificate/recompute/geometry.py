"""What positions tell of geometry and springs together, one column after the other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain, Gives, Pull
from edtk.certificate.recompute.physics import (
    GRAVITY,
    MEASURED,
    Physics,
    Place,
    Weight,
    at_load_point,
    read_weights,
    weight_torque,
)
from edtk.certificate.recompute.plain_data import rows, table, text, whole
from edtk.system.typing import Array

WHERE = "setting.geometry"
PLACES = ("base", "joint", "tool", "compliance", "spring", "compensator")
# By how much a spring of size one answers a torque, and the unit of its size in SI units.
LAWS: dict[str, tuple[Callable[[Array], Array], float]] = {
    "": (np.array, 1e-6),
    "square": (lambda torque: torque * np.abs(torque), 1e-9),
    "cubic": (lambda torque: torque**3, 1e-12),
    "sign": (np.abs, 1e-6),
    "gap": (np.sign, 1e-3),
}
MOST_PARAMETERS = 300
LONGEST_NAME = 200
UNIT = 1e-3  # of a shift [m] and of a turn [rad]
FORCE = 1e3  # of a preload [N] and of a stiffness [N/m]
ANCHORS = 6  # coordinates of a compensator's anchors, its first numbers
NUMBERS = 8
ANCHOR_STEP = 1e-2  # of differences by these numbers, in their units
ALONG = 1 - 1e-9  # cosine of what is along a joint's axis


@dataclass(frozen=True)
class Parameter:
    """One unknown: a small motion of a frame, or a spring.

    Attributes:
        name: Its name.
        place: What it moves: "base", the frame before a "joint", a "tool", or a "compliance"; or
            another "spring", or a "compensator", one of whose numbers it is.
        of: Index of the joint among all, of the marker, of the free joint, or of the compensator;
            zero for the base.
        component: 0 to 2 for a shift along an axis of its frame, 3 to 5 for a turn about one; of a
            compensator see `Pull.changed`.
        ends: Components of a spring in the frame before its joint, two of an entry off the diagonal
            of its matrix; None for the motion of the joint itself.
        law: How a spring answers its torque, see `LAWS`.
    """

    name: str
    place: str
    of: int
    component: int
    ends: tuple[int | None, ...] = ()
    law: str = ""

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
        gives: How joints with compensators give way; None without any.
        brought: Whether poses are those under load, as in a task.
    """

    parameters: list[Parameter]
    payload: list[Weight]
    changes: bool = False
    places: tuple[int, ...] = ()
    gives: Gives | None = None
    brought: bool = False

    @classmethod
    def from_dict(
        cls, content: Any, chain: Chain, physics: Physics, gives: Gives | None
    ) -> "Geometry":
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
            "spring": len(chain.axes),
            "compensator": 0 if gives is None else len(gives.pulls),
        }
        for i, one in enumerate(rows(content["parameters"], MOST_PARAMETERS, WHERE)):
            place = f"{WHERE}.parameters[{i}]"
            one = table(one, ("name", "place", "of", "component"), place, ("ends", "law"))
            name = one["name"]
            # Names are printed, so that none must hold a line that looks like a verdict.
            if not isinstance(name, str) or not name.isprintable() or len(name) > LONGEST_NAME:
                raise ValueError(f"{place}.name: expected a name")
            kind = text(one["place"], PLACES, f"{place}.place")
            of = whole(one["of"], 0, sizes[kind] - 1, f"{place}.of")
            last = {"compliance": 0, "spring": 0, "compensator": NUMBERS - 1}.get(kind, 5)
            component = whole(one["component"], 0, last, f"{place}.component")
            spring = _spring(one, of, chain, place) if kind == "spring" else ()
            found.append(Parameter(name, kind, of, component, *spring))
        if not found:
            raise ValueError(f"{WHERE}.parameters: expected at least one")
        k = len(physics.sensors)
        given = rows(content.get("places", list(range(k))), k, f"{WHERE}.places")
        places = tuple(whole(one, 0, k - 1, f"{WHERE}.places") for one in given)
        if len(places) != k:
            raise ValueError(f"{WHERE}.places: expected one an instrument")
        weights = read_weights(content["payload"], len(chain.axes), f"{WHERE}.payload")
        return cls(found, weights, changes, places, gives)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def rows(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Rows (k, measured, p) [m, rad] of poses q (k, n) under wrenches (k, 6), unit by unit.

        A loaded reading less an unloaded one moves with springs alone, by the change of the loads;
        both of them err, so that its covariance is twice that of one.
        """
        answers = self._answers(chain, physics, q, wrench)
        differs = (wrench != 0).any(axis=1) & self.changes
        if differs.any():
            before = self._answers(chain, physics, q, np.zeros_like(wrench))
            answers = [
                [np.where(differs, a - b, a) for a, b in zip(*pair, strict=True)]
                for pair in zip(answers, before, strict=True)
            ]
        parts = []
        for marker, (kind, place, anchor) in enumerate(physics.sensors):
            own = self._of_point(chain, answers, q, place, self.places[marker])
            if kind == "distance":
                own = self._along(chain, q, place, anchor, own)
            parts.append(own[:, : MEASURED[kind]])
        rigid = np.array([one.place in ("base", "joint", "tool") for one in self.parameters])
        still = differs[:, None] & rigid
        size = np.where(differs, np.sqrt(0.5), 1.0)
        return np.asarray(np.concatenate(parts, axis=1) * (size[:, None] * ~still)[:, None])

    def torque(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Loads (k, n) of the free joints, or their change where readings are differences."""
        loaded = (wrench != 0).any(axis=1, keepdims=True)
        found = physics.torque(chain, q, wrench) + loaded * weight_torque(chain, self.payload, q)
        before = physics.torque(chain, q, np.zeros_like(wrench))
        return np.asarray(found - (loaded & self.changes) * before)

    def readings(self, wrench: Array) -> Array:
        """How many readings (k,) the rows of visits under wrenches (k, 6) are made of."""
        return np.where((wrench != 0).any(axis=1) & self.changes, 2.0, 1.0)

    def of_tool(self, chain: Chain, physics: Physics, q: Array, wrench: Array) -> Array:
        """Rows (k, 6, p) of the tool frame of a chain, which parameters of markers do not move."""
        answers = self._answers(chain, physics, q, wrench)
        return self._of_point(chain, answers, q, Place(np.zeros(3), None), None)

    def _along(self, chain: Chain, q: Array, place: Place, anchor: Array, moved: Array) -> Array:
        """Rows (k, 1, p) of a distance from an anchor, which stands with the robot's base."""
        wire = chain.point(q, place.offset, place.joint) - anchor
        direction = wire / np.linalg.norm(wire, axis=1)[:, None]
        apart = np.array([one.place != "base" for one in self.parameters])
        return np.asarray(np.einsum("kr,krp->kp", direction, moved[:, :3])[:, None] * apart)

    def _of_point(
        self,
        chain: Chain,
        answers: list[list[Array]],
        q: Array,
        place: Place,
        marker: int | None,
    ) -> Array:
        """Rows (k, 6, p) of a point that sits on a marker, or on none."""
        frames = chain.frames(q)
        point = chain.point(q, place.offset, place.joint)
        columns = []
        for one, answer in zip(self.parameters, answers, strict=True):
            if not answer:
                columns.append(UNIT * _moved(one, chain, frames, point, marker, place.joint))
                continue
            turns = [self._turn(one, end, chain, q, place) for end in _ends(one)]
            pairs = zip(turns, answer, strict=True)
            moved = np.sum([turn * own[:, None] for turn, own in pairs], axis=0)
            columns.append(unit_of(one) * moved)
        return np.stack(columns, axis=-1)

    def _answers(
        self, chain: Chain, physics: Physics, q: Array, wrench: Array
    ) -> list[list[Array]]:
        """By how much each spring turns along its ends (k,), for a size of one; empty for others.

        An entry off the diagonal answers along each of its ends to the torque about the other one.
        """
        loaded = (wrench != 0).any(axis=1)

        acting = at_load_point(chain, q, wrench, physics.load_point.joint)

        def torque(one: Parameter, end: int | None) -> Array:
            moved = _turned(one, end, chain, q, physics.load_point)
            found = np.einsum("kr,kr->k", moved, acting)
            found = found + _by_weights(one, end, chain, q, physics.weights)
            return np.asarray(found + loaded * _by_weights(one, end, chain, q, self.payload))

        def answer(one: Parameter) -> list[Array]:
            if one.place == "compensator":
                spring = self._spring_of(one, chain)
                return [self._of_number(one, torque(spring, None), chain, q)]
            return [
                LAWS[one.law][0](self._rested(one, end, chain, q) * torque(one, end))
                for end in reversed(_ends(one))
            ]

        return [answer(one) for one in self.parameters]

    def _turn(self, one: Parameter, end: int | None, chain: Chain, q: Array, place: Place) -> Array:
        """How a point moves and turns (k, 6) by what is left of a unit turn of a spring."""
        spring = self._spring_of(one, chain)
        moved = _turned(spring, end, chain, q, place)
        return moved * self._left(spring, end, chain, q)[:, None]

    def _spring_of(self, one: Parameter, chain: Chain) -> Parameter:
        """The spring of the joint that a compensator loads; a spring itself."""
        if one.place != "compensator":
            return one
        assert self.gives is not None
        joint = chain.free.index(self.gives.pulls[one.of].joint)
        return Parameter(one.name, "compliance", joint, 0)

    def _left(self, one: Parameter, end: int | None, chain: Chain, q: Array) -> Array:
        """What is left (k,) of a motion of a joint that a compensator makes stiffer, or softer."""
        joint = _own_joint(one, end, chain)
        if self.gives is None or joint is None:
            return np.ones(len(q))
        return self.gives.factors(chain, q)[:, joint]

    def _rested(self, one: Parameter, end: int | None, chain: Chain, q: Array) -> Array | float:
        """The same of its load, which has given way before where poses are those commanded."""
        return 1.0 if self.brought else self._left(one, end, chain, q)

    def _of_number(self, one: Parameter, torque: Array, chain: Chain, q: Array) -> Array:
        """By how much a unit of a compensator's number turns its joint (k,), where that rests."""
        assert self.gives is not None
        spring = self._spring_of(one, chain)
        pull = self.gives.pulls[one.of]
        gives = self.gives.compliances[spring.of] * self._left(spring, None, chain, q)
        rest = q.copy()
        if not self.brought:
            rest[:, spring.of] += gives * torque
        loads = [
            pull.changed(one.component, steps * ANCHOR_STEP * unit_of(one)).on(chain, rest)[0][
                :, spring.of
            ]
            for steps in (1, -1, 2, -2)
        ]
        slope = 8 * (loads[0] - loads[1]) - (loads[2] - loads[3])
        k = self.gives.compliances[spring.of]
        return np.asarray(k * slope / (12 * ANCHOR_STEP * unit_of(one)))


def _own_joint(one: Parameter, end: int | None, chain: Chain) -> int | None:
    """The free joint that an end of a spring turns; None for a turn or shift across it."""
    if one.place == "compliance":
        return one.of
    if one.of not in chain.free:
        return None
    along = end is not None and end >= 3 and abs(chain.axes[one.of][end % 3]) > ALONG
    return chain.free.index(one.of) if end is None or along else None


def unit_of(one: Parameter) -> float:
    """The unit of a spring, or of a compensator's number, in SI units."""
    if one.place != "compensator":
        return LAWS[one.law][1]
    return UNIT if one.component < ANCHORS else FORCE


def _ends(one: Parameter) -> tuple[int | None, ...]:
    """What a spring turns; nothing of what is none."""
    return (None,) if one.place in ("compliance", "compensator") else one.ends


def _turned(one: Parameter, end: int | None, chain: Chain, q: Array, place: Place) -> Array:
    """How a point moves and turns (k, 6) by a unit turn or shift of one end of a spring."""
    if end is None:
        return chain.jacobian(q, place.offset, place.joint)[:, :, _free(one, chain)]
    point = chain.point(q, place.offset, place.joint)
    error = Parameter(one.name, "joint", one.of, end)
    return _moved(error, chain, chain.frames(q), point, None, place.joint)


def _by_weights(
    one: Parameter, end: int | None, chain: Chain, q: Array, weights: list[Weight]
) -> Array:
    """Load (k,) of one end of a spring by weights, and by compensators across its joint."""
    found = np.zeros(len(q))
    joint = _own_joint(one, end, chain)
    for weight in weights:
        if not isinstance(weight, Pull):
            mass, place = weight
            found -= mass * GRAVITY * _turned(one, end, chain, q, place)[:, 2]
        elif joint is not None:
            found += weight.on(chain, q)[0][:, joint]
        elif one.of == weight.joint and end is not None:
            found += weight.along(chain, q, end)
    return found


def _free(one: Parameter, chain: Chain) -> int:
    """Index among the free joints of that of a joint's own spring."""
    return one.of if one.place == "compliance" else chain.free.index(one.of)


def _spring(
    one: dict[str, Any], of: int, chain: Chain, place: str
) -> tuple[tuple[int | None, ...], str]:
    """Ends and law of a spring.

    Raises:
        ValueError: A part is missing, or is not what it should be.
    """
    one = table(one, ("name", "place", "of", "component", "ends", "law"), place)
    given = rows(one["ends"], 2, f"{place}.ends")
    ends = tuple(None if end is None else whole(end, 0, 5, f"{place}.ends") for end in given)
    law = text(one["law"], tuple(LAWS), f"{place}.law")
    if not ends or (None in ends and (len(ends) > 1 or of not in chain.free)):
        raise ValueError(f"{place}.ends: expected one or two components, or the joint's own")
    if len(ends) > 1 and law:
        raise ValueError(f"{place}.law: expected none of an entry off the diagonal")
    return ends, law


def _moved(
    one: Parameter,
    chain: Chain,
    frames: Array,
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
