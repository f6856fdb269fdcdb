"""The text of a URDF file as links and the joints that connect them."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.robots.joint import SHORTEST_AXIS, Link
from edtk.robots.robot_file import RobotFileError
from edtk.robots.rotations import transform
from edtk.system.errors import UserError
from edtk.system.fields import LARGEST
from edtk.system.parsing import Element, parse_xml
from edtk.system.typing import Array

KINDS = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")
LIMITED = ("revolute", "prismatic")  # other kinds have no limits, whatever the file says
BOUNDLESS = ("inf", "+inf", "-inf", "infinity", "-infinity")
X_AXIS = (1.0, 0.0, 0.0)  # of a joint that names none
LONGEST_ROBOT_NAME = 200  # characters of a robot's name


@dataclass(frozen=True)
class Mimic:
    """A joint's tie to another one: ``q = factor * q_master + offset``.

    Attributes:
        master: Name of the joint that is followed.
        factor: Factor [rad/rad, m/m, or mixed].
        offset: Value where the master is at zero [rad or m].
    """

    master: str
    factor: float
    offset: float


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint of a URDF file.

    Attributes:
        name: Its name.
        kind: "fixed", "revolute", "continuous", "prismatic", "floating" or "planar".
        parent: Name of the link that carries it.
        child: Name of the link that it moves.
        origin: Transform (4, 4) of its frame in the parent's [m].
        axis: Axis (3,) of positive motion in its own frame, of any length.
        limits: Lower and upper limit [rad or m]; None for each that the file does not give.
        mimic: The tie to another joint; None for a joint of its own.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    limits: tuple[float | None, float | None]
    mimic: Mimic | None


@dataclass(frozen=True, eq=False)
class Urdf:
    """A tree of links and joints.

    Attributes:
        name: Name of the robot.
        links: Mass and centre of each link in its own frame, by name; None where the file has none.
        joints: The joints by name, in the order of the file.
        elements: The element of each link, by name: its shapes are read where they are asked for.
    """

    name: str
    links: dict[str, Link | None]
    joints: dict[str, UrdfJoint]
    elements: dict[str, Element]

    @cached_property
    def above(self) -> dict[str, UrdfJoint]:
        """The joint that moves a link, by the name of the link; roots have none."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def below(self) -> dict[str, list[UrdfJoint]]:
        """The joints that a link carries, by the name of the link."""
        carried: dict[str, list[UrdfJoint]] = {name: [] for name in self.links}
        for joint in self.joints.values():
            carried[joint.parent].append(joint)
        return carried

    @property
    def roots(self) -> list[str]:
        """The links that no joint moves."""
        return [name for name in self.links if name not in self.above]


def parse_urdf(text: str, where: str | None = None) -> Urdf:
    """Read links and joints; meshes, materials, transmissions and extensions are left alone.

    Args:
        text: The text of the file.
        where: The file, for messages.

    Raises:
        RobotFileError: One line that says which joint or link, and what was expected.
    """
    try:
        root = parse_xml(text, where)
    except UserError as error:
        raise RobotFileError(error.message, where=error.where, key=error.key) from error
    return urdf_of(root, where)


def urdf_of(root: Element, where: str | None = None) -> Urdf:
    """Read links and joints from the root element, see `parse_urdf`."""
    if root.tag != "robot":
        message = f"the root element is <{root.tag}>; expected <robot>"
        raise RobotFileError(message, where=where)
    if any(element.tag.startswith("xacro:") for element in root.everything()):
        message = "is a xacro file; expected a name that ends in .xacro"
        raise RobotFileError(message, where=where)
    return _Reader(where).robot(root)


class _Reader:
    """Makes numbers of texts; all messages name the file, and the joint or link."""

    def __init__(self, where: str | None) -> None:
        self.where = where

    def robot(self, root: Element) -> Urdf:
        """The whole tree."""
        links = self._by_name(root.all("link"))
        joints = self._by_name(root.all("joint"))
        tree = Urdf(
            " ".join(root.attributes.get("name", "").split())[:LONGEST_ROBOT_NAME],
            {name: self._link(element, name) for name, element in links.items()},
            {name: self._joint(element, name) for name, element in joints.items()},
            links,
        )
        self._check_links(tree)
        return tree

    def error(self, key: str, message: str) -> RobotFileError:
        """An error about one joint or link."""
        return RobotFileError(message, where=self.where, key=key)

    def _by_name(self, elements: list[Element]) -> dict[str, Element]:
        named: dict[str, Element] = {}
        for element in elements:
            name = self._text(element, "name", f"<{element.tag}> in line {element.line}")
            if name in named:
                raise self.error(
                    f"{element.tag} {name}",
                    f"stands in line {named[name].line} and in line {element.line}; expected once",
                )
            named[name] = element
        return named

    def _check_links(self, tree: Urdf) -> None:
        """Every joint lies between two links that there are, and moves a link of its own."""
        moved: dict[str, UrdfJoint] = {}
        for joint in tree.joints.values():
            for end in (joint.parent, joint.child):
                if end not in tree.links:
                    raise self.error(f"joint {joint.name}", f"there is no link {end!r}")
            first = moved.setdefault(joint.child, joint)
            if first is not joint:
                raise self.error(
                    f"link {joint.child}",
                    f"is moved by joint {first.name!r} and by joint {joint.name!r}; expected one",
                )

    def _link(self, element: Element, name: str) -> Link | None:
        inertial = element.first("inertial")
        if inertial is None:
            return None
        key = f"link {name}"
        mass = inertial.first("mass")
        if mass is None:
            raise self.error(key, "its <inertial> has no <mass>")
        kilograms = self._number(mass, "value", f"{key}: mass")
        if kilograms < 0:
            raise self.error(key, f"the mass is {kilograms:g} kg; expected a number from 0 on")
        return Link(kilograms, self._origin(inertial, key)[:3, 3])

    def _joint(self, element: Element, name: str) -> UrdfJoint:
        key = f"joint {name}"
        kind = self._text(element, "type", key)
        if kind not in KINDS:
            raise self.error(key, f"the type is {kind!r}; expected one of {', '.join(KINDS)}")
        return UrdfJoint(
            name,
            kind,
            self._end(element, "parent", key),
            self._end(element, "child", key),
            self._origin(element, key),
            self._axis(element, kind, key),
            self._limits(element, kind, key),
            self._mimic(element, key),
        )

    def _end(self, element: Element, tag: str, key: str) -> str:
        found = element.first(tag)
        if found is None:
            raise self.error(key, f"has no <{tag}>")
        return self._text(found, "link", f"{key}: {tag}")

    def _origin(self, element: Element, key: str) -> Array:
        """Transform (4, 4) of the element's <origin>."""
        origin = element.first("origin")
        if origin is None:
            return transform()
        position = self._vector(origin, "xyz", f"{key}: origin")
        return transform(position, self._vector(origin, "rpy", f"{key}: origin"))

    def _axis(self, element: Element, kind: str, key: str) -> Array:
        axis = element.first("axis")
        if axis is None or kind in ("fixed", "floating"):
            return np.array(X_AXIS)
        direction = self._vector(axis, "xyz", f"{key}: axis", X_AXIS)
        if not SHORTEST_AXIS <= np.linalg.norm(direction) <= 1 / SHORTEST_AXIS:
            given = " ".join(f"{number:g}" for number in direction)
            raise self.error(key, f"the axis is {given}; expected a vector of length 1")
        return direction

    def _limits(self, element: Element, kind: str, key: str) -> tuple[float | None, float | None]:
        limit = element.first("limit")
        if limit is None or kind not in LIMITED:
            return None, None
        lower, upper = (
            self._limit(limit.attributes.get(side), f"{key}: limit: {side}")
            for side in ("lower", "upper")
        )
        return lower, upper

    def _limit(self, text: str | None, key: str) -> float | None:
        """A limit; None where there is none, or where it is a way to say that there is none."""
        word = (text or "").strip()
        if text is None or word.lower() in BOUNDLESS:
            return None
        number = _finite(word)
        if number is None:
            raise self.error(key, f"is {text!r}; expected a number")
        return number if abs(number) <= LARGEST else None

    def _mimic(self, element: Element, key: str) -> Mimic | None:
        mimic = element.first("mimic")
        if mimic is None:
            return None
        place = f"{key}: mimic"
        return Mimic(
            self._text(mimic, "joint", place),
            self._number(mimic, "multiplier", place, 1.0),
            self._number(mimic, "offset", place, 0.0),
        )

    def _text(self, element: Element, attribute: str, key: str) -> str:
        found = element.attributes.get(attribute, "")
        if not found:
            raise self.error(key, f"has no {attribute}")
        return found

    def _vector(
        self, element: Element, attribute: str, key: str, default: tuple[float, ...] = (0, 0, 0)
    ) -> Array:
        text = element.attributes.get(attribute)
        if text is None:
            return np.array(default, dtype=float)
        numbers = [_number(word) for word in text.split()]
        if len(numbers) != 3 or None in numbers:
            raise self.error(key, f"{attribute} is {text!r}; expected three numbers")
        return np.array(numbers, dtype=float)

    def _number(
        self, element: Element, attribute: str, key: str, default: float | None = None
    ) -> float:
        text = element.attributes.get(attribute)
        if text is None and default is not None:
            return default
        number = _number((text or "").strip())
        if number is None:
            given = "missing" if text is None else repr(text)
            raise self.error(key, f"{attribute} is {given}; expected a number")
        return number


def _finite(word: str) -> float | None:
    """A number as C's strtod reads it, None for other words."""
    try:
        # Python takes underscores between digits, and digits of all scripts.
        number = float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _number(word: str) -> float | None:
    """A number that no slip of the pen makes, None for other words."""
    number = _finite(word)
    return number if number is not None and abs(number) <= LARGEST else None
