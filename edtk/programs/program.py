"""A robot program as data: moves, dwells, waits and comments in order, before a brand has words."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from edtk.robots.joint import Kind
from edtk.system.errors import UserError

MOST_EXTERNAL = 6  # axes beside a robot; no brand here has more
FULL_SPEED = 100.0  # percent


class ProgramError(UserError):
    """A program that a controller does not take."""


@dataclass(frozen=True)
class Axis:
    """A joint of the robot as its controller has it.

    Attributes:
        joint: Name of the joint.
        kind: "revolute" or "prismatic".
        number: Number of the axis on the controller, from 1.
        external: Whether it is one of the axes beside the robot, which are counted on their own.
    """

    joint: str
    kind: Kind
    number: int
    external: bool = False

    @property
    def place(self) -> str:
        """How people write it: "3", or "E1" beside the robot."""
        return f"{'E' * self.external}{self.number}"


@dataclass(frozen=True)
class Comment:
    """A line that tells people something.

    Attributes:
        text: One line.
    """

    text: str


Purpose = Literal["pose", "via", "home"]


@dataclass(frozen=True)
class Move:
    """A joint move: all axes begin and end together.

    Attributes:
        target: What the controller shows at its end, an axis each [deg or mm], as rounded.
        rows: First and last row of the sheet, from 1, that are measured there; None where nothing
            is measured.
        purpose: "pose" where something is measured, "via" on the way, "home" at both ends.
    """

    target: tuple[float, ...]
    rows: tuple[int, int] | None = None
    purpose: Purpose = "pose"


@dataclass(frozen=True)
class Dwell:
    """A time in which the arm comes to rest.

    Attributes:
        seconds: How long [s].
    """

    seconds: float


@dataclass(frozen=True)
class Wait:
    """The program stops until somebody, or an instrument, has done something.

    Attributes:
        message: What is to be done, in few words.
        signals: The output that asks for it, and the input that tells that it is done, as the
            controller names them; None where an operator starts the program again.
    """

    message: str
    signals: tuple[str, str] | None = None


Step = Comment | Move | Dwell | Wait


@dataclass(frozen=True)
class Program:
    """What a robot does on a day of measurements.

    Attributes:
        name: Its name on the controller.
        axes: The joints, in the order of the targets.
        steps: What is done, in order.
        speed_percent: Speed of the joint moves, in percent of what the joints can.
        heading: Lines that say what the program is.

    Raises:
        ProgramError: Targets do not fit the axes, two joints have one axis, a time is negative, or
            the speed is none.
    """

    name: str
    axes: tuple[Axis, ...]
    steps: tuple[Step, ...]
    speed_percent: float = FULL_SPEED
    heading: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        places = [axis.place for axis in self.axes]
        if len(set(places)) < len(places):
            raise ProgramError(f"two joints have one axis of {', '.join(places)}")
        if not 0 < self.speed_percent <= FULL_SPEED:
            given = f"{self.speed_percent:g}"
            raise ProgramError(f"the speed is {given} percent; expected above 0, at most 100")
        if any(len(move.target) != len(self.axes) for move in self.moves):
            raise ProgramError(f"a target has not a value for each of {len(self.axes)} axes")
        if any(step.seconds < 0 for step in self.steps if isinstance(step, Dwell)):
            raise ProgramError("a dwell is negative; expected seconds from 0 on")

    @property
    def moves(self) -> tuple[Move, ...]:
        """The joint moves, in order."""
        return tuple(step for step in self.steps if isinstance(step, Move))

    @cached_property
    def targets(self) -> dict[tuple[float, ...], str]:
        """A name for each place that is driven to, in the order in which they are first met.

        A pose is named after the first row that is measured there: "row12"; others are "home" and
        "via3". A place that is driven to again keeps its name.
        """
        names: dict[tuple[float, ...], str] = {}
        counts = {"via": 0, "home": 0}
        for move in self.moves:
            if move.target in names:
                continue
            if move.rows is not None:
                names[move.target] = f"row{move.rows[0]}"
                continue
            counts[move.purpose] = counts.get(move.purpose, 0) + 1
            first_home = move.purpose == "home" and counts["home"] == 1
            names[move.target] = "home" if first_home else f"{move.purpose}{counts[move.purpose]}"
        return names


def said(rows: tuple[int, int]) -> str:
    """Rows of the sheet in words: "row 3", or "rows 3 to 5"."""
    first, last = rows
    return f"row {first}" if first == last else f"rows {first} to {last}"


def axes_of(
    names: Sequence[str], kinds: Sequence[Kind], places: str | None = None
) -> tuple[Axis, ...]:
    """The controller's axes of joints.

    Prismatic joints before the first revolute one carry an arm of four revolute joints and more:
    they are the axes E1, E2, ... beside the robot. All others are its own, 1, 2, ...

    Args:
        names: Names (n,) of the joints.
        kinds: Their kinds (n,).
        places: The axes in the order of the joints, such as "E1,1,2,3,4,5,6"; None for those above.

    Raises:
        ProgramError: The places are not such a list.
    """
    if places is not None:
        found = [place.strip() for place in places.split(",")]
        if len(found) != len(names):
            joints = ", ".join(names)
            raise ProgramError(f"{len(found)} axes; expected one for each joint: {joints}")
        return tuple(map(_axis, names, kinds, found))
    slides = next((i for i, kind in enumerate(kinds) if kind == "revolute"), 0)
    carried = list(kinds[slides:]).count("revolute")
    outside = slides if carried >= LEAST_CARRIED else 0
    return tuple(
        Axis(name, kind, i + 1 - (0 if i < outside else outside), i < outside)
        for i, (name, kind) in enumerate(zip(names, kinds, strict=True))
    )


LEAST_CARRIED = 4  # revolute joints of an arm that stands on a rail, and is no gantry with a wrist


def _axis(name: str, kind: Kind, place: str) -> Axis:
    """The axis of a joint at a place such as "3" or "E1".

    Raises:
        ProgramError: There is no such place.
    """
    digits = place.removeprefix("E")
    if not (digits.isdecimal() and 1 <= int(digits) <= MOST_EXTERNAL):
        message = f"axis {place!r} of joint {name}: expected 1 to 6, or E1 to E6 beside the robot"
        raise ProgramError(message)
    return Axis(name, kind, int(digits), place.startswith("E"))
