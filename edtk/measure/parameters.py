"""Parameters of geometry and springs: words, units, scales, and which are told apart."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from edtk.robots.frames import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

AXES = "xyz"
SHIFTS = AXES
TURNS = ("rx", "ry", "rz")
COMPONENTS = (*SHIFTS, *TURNS)
# One unit in which a parameter is of order one: a millimetre, a milliradian, a soft joint.
MILLIRADIAN = 1e-3
SOFTNESS = 1e-6  # [rad/(N m), m/N]
SPREAD = 10.0  # of what is not told, in these units, or in likely sizes of a compliance
ALONG = 1 - 1e-9  # cosine beyond which a component is the one along the joint's axis
KINDS = ("zeros", "lengths", "tilts")
ALIKE = 1e-6  # relative difference of lengths of columns, that is rounding
NEGLIGIBLE = 1e-8  # length of a column beside the longest one, that is rounding
# A column of unit length, of which the others leave less than this, moves no marker in a way of its
# own. Rounding leaves 1e-14. Robots' files say angles to five digits, as 1.5708 and 3.1416: axes
# that are parallel are so to that, which tells nothing. The weakest ways of three real sheets
# (`studies/real_robots.py`) leave 1e-2 and more.
TOLD = 2e-5
# Shares of other parameters below this are left out of the words, not of the arithmetic.
SMALL_SHARE = 0.02
MOST_NAMED = 3  # other parameters that a sentence names
LINEAR = ""  # the law of a spring that turns in proportion to its torque
# Of the other laws: by which power of the torque they turn, and how people say it.
POWERS = {LINEAR: 1, "square": 2, "cubic": 3, "sign": 1, "gap": 0}
BY_LAW = {
    LINEAR: "the spring of {}",
    "square": "the spring of {} by the square of its torque",
    "cubic": "the spring of {} by the cube of its torque",
    "sign": "the difference of the spring of {} by the sign of its torque",
    "gap": "the dead zone of {}",
}


def parameter_names(joints: Sequence[str]) -> tuple[str, ...]:
    """Names of the compliances of joints: k2 for joint q2, and k_NAME for a joint of another name.

    Args:
        joints: Names of the joints.
    """
    numbered = [name[:1] == "q" and name[1:].isdigit() for name in joints]
    return tuple(
        f"k{name[1:]}" if number else f"k_{name}"
        for name, number in zip(joints, numbered, strict=True)
    )


Place = Literal["base", "joint", "tool", "compliance", "spring", "compensator"]
# What reports say of the parameters of each place, in this order.
TITLES: dict[Place, str] = {
    "joint": "Geometry: how the robot differs from its drawing",
    "compliance": "Springs of the joints",
    "spring": "Springs across the joints, and laws of springs",
    "compensator": "Compensators: how they differ from what the study states",
    "tool": "Markers: how far they are from where the study has them on the tool",
    "base": "Base: how far it is from where the drawing fits best",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter.

    Attributes:
        place: What it moves: the base, the frame before a joint, a tool, a joint by its own
            compliance, or another spring; or a compensator, one of whose numbers it is.
        of: Name of the joint or of the marker; empty for the base.
        component: x y z for a shift, rx ry rz for a turn; empty for a compliance. Of a spring the
            same in the frame before the joint, where it is not about the joint's own axis; "rx.y"
            for the entry of its matrix in that row and column.
        slides: Whether a compliance is that of a prismatic joint.
        along: Whether the component is the one along the joint's own axis: a turn of a revolute
            joint is the offset of its zero.
        likely: Size that a compliance is likely to have, in SI units; None where nobody knows.
        body: Name of the joint that moves the body that a marker is on; empty for the tool.
        law: How a spring answers its torque, see `BY_LAW`.
    """

    place: Place
    of: str = ""
    component: str = ""
    slides: bool = False
    along: bool = False
    likely: float | None = field(default=None, compare=False)
    body: str = field(default="", compare=False)
    law: str = LINEAR

    @property
    def name(self) -> str:
        """Name in files: `base.x`, `q2.rz`, `tool.A.x`, `k_q2`, `k_q2.rx`, `k_q2.cubic`."""
        if self.is_spring:
            return f"k_{'.'.join(filter(None, (self.of, self.component, self.law)))}"
        if self.place == "base":
            return f"base.{self.component}"
        if self.place == "compensator":
            return f"compensator.{self.of}.{self.component}"
        if self.place == "tool":
            return f"tool.{self.of}.{self.component}" if self.of else f"tool.{self.component}"
        return f"{self.of}.{self.component}"

    @property
    def kind(self) -> str:
        """Of which kind an error before a joint is: zeros, lengths or tilts; else its place."""
        if self.place != "joint":
            return self.place
        if self.along:
            return "zeros"
        return "tilts" if self.turns else "lengths"

    @property
    def groups(self) -> tuple[str, ...]:
        """Names by which lists of a study may mean it, the shortest list last."""
        own = (self.name,)
        if self.place == "spring":
            return (*own, "springs")
        if self.place == "compensator":
            return (*own, f"compensator.{self.of}", "compensators")
        if self.place == "joint":
            return (*own, self.of, self.kind, "geometry")
        return (*own, self.place)

    @property
    def turns(self) -> bool:
        """Whether it is an angle."""
        return self.component in TURNS

    @property
    def is_motion(self) -> bool:
        """Whether it is a part of a small rigid motion."""
        return self.place in ("base", "joint", "tool")

    @property
    def is_spring(self) -> bool:
        """Whether it says how far a load turns or shifts something."""
        return self.place in ("compliance", "spring")

    @property
    def ends(self) -> tuple[str, ...]:
        """Components of a spring: one, two of an entry off the diagonal, "" for the joint's own."""
        return tuple(self.component.split("."))

    @property
    def power(self) -> int:
        """By which power of its torque a spring turns."""
        return POWERS[self.law]

    @property
    def scale(self) -> float:
        """Size of one unit in which people read it, in SI units."""
        if self.is_spring:
            return _SIZES[self.power]
        if self.component in OF_FORCE:
            return OF_FORCE[self.component][0]
        return MILLIRADIAN if self.turns else MILLIMETRE

    @property
    def spread(self) -> float:
        """How far it may be from the drawing where nothing tells it, in its units: one std.

        A length of the drawing may be 10 mm off and an angle 10 mrad. A compliance may be ten times
        the likely one, whichever that is: those of a small arm's wrist are 1e-4 rad/(N m), and of a
        heavy arm's shoulder 1e-7.
        """
        return SPREAD if self.likely is None else SPREAD * self.likely / self.scale

    @property
    def unit(self) -> str:
        """That unit in words."""
        if self.is_spring:
            return self._unit_of_spring
        if self.component in OF_FORCE:
            return OF_FORCE[self.component][1]
        return "mrad" if self.turns else "mm"

    @property
    def _unit_of_spring(self) -> str:
        """Of a spring: what turns or shifts, over the power of what loads it."""
        slides = [end in SHIFTS if end else self.slides for end in self.ends]
        if not self.power:
            return "mm" if slides[0] else "mrad"
        load = "N" if any(slides) else "(N m)"
        over = load if self.power == 1 else f"{load}^{self.power}"
        return f"{_SIZES[self.power]:.0e} {'m' if all(slides) else 'rad'}/{over}".replace(
            "e-0", "e-"
        )

    @property
    def words(self) -> str:
        """What it is, for people."""
        axis = self.component[-1:]
        joint = self.of if self.of.startswith("joint") else f"joint {self.of}"
        if self.place == "compliance":
            return f"the compliance of {joint}"
        if self.place == "spring":
            return self._words_of_spring(joint)
        if self.place == "compensator":
            return f"the {_words_of_number(self.component)} of the compensator at {joint}"
        if self.place == "base":
            return f"the base's turn about {axis}" if self.turns else f"the base's {axis}"
        if self.place == "tool":
            named = self.of if self.of.startswith("marker") else f"marker {self.of}"
            tool = f"{named} on {self.body or 'the tool'}" if self.of else "the tool"
            return f"the turn of {tool} about {axis}" if self.turns else f"{tool} along {axis}"
        if self.along:
            return f"the zero of {joint}"
        if self.turns:
            return f"the tilt about {axis} before {joint}"
        return f"the length along {axis} before {joint}"

    @property
    def asks_for(self) -> str:
        """What would tell a spring that no load turns, for people; nothing of others."""
        if not self.is_spring:
            return ""
        joint = self.of if self.of.startswith("joint") else f"joint {self.of}"
        loads = [
            f"torque about {end[-1]}" if end in TURNS else f"force along {end}"
            for end in self.ends
            if end
        ] or [f"{'force' if self.slides else 'torque'} in {joint}"]
        before = f" before {joint}" if self.component else ""
        return (
            f": it needs a {' and a '.join(loads)}{before} that no load there makes (one beside "
            "the tool, or of another direction, may), or a marker elsewhere"
        )

    def _words_of_spring(self, joint: str) -> str:
        """A spring in words."""
        about = [f"{'about' if end in TURNS else 'along'} {end[-1]}" for end in self.ends if end]
        if len(about) > 1:
            return f"the coupling of the springs of {joint} {' and '.join(about)}"
        return BY_LAW[self.law].format(" ".join((joint, *about)))


# Units by the power of the torque: a heavy arm's 1e3 N m make milliradians of each.
_SIZES = {0: MILLIRADIAN, 1: SOFTNESS, 2: 1e-9, 3: 1e-12}


# Numbers of a compensator, in the order of `Compensator.numbers`, and the units of forces.
ANCHORS = {"anchor1": "first anchor", "anchor2": "second anchor"}
OF_FORCE = {"stiffness": (1e3, "N/mm"), "preload": (1e3, "kN")}
NUMBERS = (*(f"{anchor}.{axis}" for anchor in ANCHORS for axis in AXES), *OF_FORCE)


def _words_of_number(component: str) -> str:
    """A number of a compensator in words."""
    anchor, _, axis = component.partition(".")
    return f"{ANCHORS[anchor]} along {axis}" if axis else component


def compensator_names(robot: Robot) -> tuple[str, ...]:
    """Names of the compensators: that of the joint, and of others there with a number from 2 on."""
    joints = [one.joint for one in robot.compensators]
    counts = [joints[: i + 1].count(name) for i, name in enumerate(joints)]
    return tuple(
        name if count == 1 else f"{name}:{count}"
        for name, count in zip(joints, counts, strict=True)
    )


def numbers_asked(robot: Robot, asked: Sequence[str]) -> tuple[Parameter, ...]:
    """The numbers of compensators that a study asks for, in the order of `NUMBERS`.

    Args:
        robot: The robot.
        asked: A list of compensators ("q2": stiffness and preload), of groups of numbers
            ("q2.anchor1", "q2.all") and of single ones ("q2.preload", "q2.anchor2.x").

    Raises:
        ValueError: An entry names none, or one is named twice.
    """
    names = compensator_names(robot)
    found: list[Parameter] = []
    for entry in asked:
        of, _, rest = entry.partition(".")
        chosen = {"": tuple(OF_FORCE), "all": NUMBERS}.get(
            rest, tuple(one for one in NUMBERS if one == rest or one.split(".")[0] == rest)
        )
        if of not in names or not chosen:
            has = ", ".join(names) or "none"
            raise ValueError(
                f"no number {entry!r} of a compensator; this robot has compensators at: {has}; "
                "expected such a joint, or with .stiffness, .preload, .anchor1, .anchor2.x or .all"
            )
        for component in chosen:
            likely = _likely_number(robot, names.index(of), component)
            found.append(Parameter("compensator", of, component, likely=likely))
    for i, one in enumerate(found):
        if one in found[:i]:
            raise ValueError(f"{one.name} is listed twice; expected each number once")
    return tuple(sorted(found, key=lambda one: (names.index(one.of), NUMBERS.index(one.component))))


def _likely_number(robot: Robot, which: int, component: str) -> float | None:
    """A tenth of what is stated of a force: a tenth of how far it may be off."""
    stated = robot.compensators[which].numbers()[NUMBERS.index(component)]
    return abs(stated) / SPREAD if component in OF_FORCE and stated else None


def own_direction(robot: Robot, joint: str, component: str) -> int:
    """1 or -1 where a component of the frame before a free joint is the joint's own motion, or 0.

    It is none of a joint whose drive moves others too: its spring turns all of them.

    Args:
        robot: The rigid robot.
        joint: Name of a joint of its chain.
        component: x y z rx ry rz.
    """
    if joint not in robot.joint_names:
        return 0
    j = robot.joint_names.index(joint)
    if robot.ties is not None and np.count_nonzero(robot.ties.matrix[:, j]) > 1:
        return 0
    own = robot.joints[j]
    cosine = float(own.axis[COMPONENTS.index(component) % 3])
    same = (own.kind == "revolute") == (component in TURNS)
    return int(np.sign(cosine)) if same and abs(cosine) > ALONG else 0


SpringsAsked = Literal["joints", "lateral", "all"] | Sequence[str]


def springs_asked(robot: Robot, asked: SpringsAsked) -> tuple[Parameter, ...]:
    """The springs that a study asks for: those of the joints first, then the others.

    Args:
        robot: The rigid robot.
        asked: "joints" for those of all free joints, "lateral" for the turns across them too, "all"
            for the matrices of all frames before joints, of 21 numbers each; or a list of springs:
            "q2", "q3.rx", "q3.rx.y" for an entry off the diagonal, "q2.cubic" and other laws,
            "q2.lateral" and "q2.all" for all of one joint.

    Raises:
        ValueError: An entry names no spring, or one is named twice.
    """
    entries = (asked,) if isinstance(asked, str) else tuple(asked)
    found: dict[str, Parameter] = {}
    named: dict[str, str] = {}
    for entry in entries:
        springs = _springs_of(robot, entry)
        if len(springs) == 1:
            name = springs[0].name
            if name in named:
                same = "" if named[name] == entry else f", which is {named[name]!r}"
                raise ValueError(f"{entry!r} is listed twice{same}; expected each spring once")
            named[name] = entry
        found |= {one.name: one for one in springs}
    every = sorted(found.values(), key=lambda one: one.place == "spring")
    return tuple(every)


def _springs_of(robot: Robot, entry: str) -> list[Parameter]:
    """The springs that an entry of a list means."""
    if entry == "joints":
        return [_spring(robot, name) for name in robot.joint_names]
    if entry in ("lateral", "all"):
        return [one for name in robot.body_names for one in _springs_of(robot, f"{name}.{entry}")]
    fitting = [name for name in robot.body_names if f"{entry}.".startswith(f"{name}.")]
    name = max(fitting, key=len, default="")
    parts = entry[len(name) + 1 :].split(".") if len(entry) > len(name) else []
    own = (
        [_spring(robot, name)] if parts in (["lateral"], ["all"]) and _has_own(robot, name) else []
    )
    if parts == ["lateral"]:
        return own + [_spring(robot, name, (end,)) for end in _across(robot, name)]
    if parts == ["all"]:
        is_own = any(own_direction(robot, name, end) for end in COMPONENTS)
        ends = COMPONENTS if is_own else _but_own(robot, name)
        pairs = ((a, b) for i, a in enumerate(ends) for b in ends[i:])
        matrix = [_spring(robot, name, (a, b) if a != b else (a,)) for a, b in pairs]
        return matrix if is_own else own + matrix
    law = parts.pop() if parts and parts[-1] in BY_LAW else LINEAR
    strange = [part for part in parts if part not in COMPONENTS]
    if not name or strange or len(parts) > 2 or (len(parts) == 2 and law):
        raise ValueError(
            f"no spring {entry!r}; expected one of the joints {', '.join(robot.body_names)}, with "
            "axes of the frame before it (q2.rx, q2.rx.y) or a law (q2.square, q2.cubic, q2.sign, "
            "q2.gap), or 'joints', 'lateral' or 'all'"
        )
    return [_spring(robot, name, tuple(parts) or ("",), law)]


def _across(robot: Robot, joint: str) -> tuple[str, ...]:
    """Turns about the axes of the frame before a joint, but the joint's own."""
    return tuple(end for end in TURNS if end in _but_own(robot, joint))


def _has_own(robot: Robot, joint: str) -> bool:
    """Whether a joint has a spring of its own: one that follows another has none."""
    return joint in robot.joint_names


def _but_own(robot: Robot, joint: str) -> tuple[str, ...]:
    """Components of the frame before a joint, but those along its own axis."""
    own = robot.chain[robot.body_names.index(joint)]
    first = len(SHIFTS) if own.kind == "revolute" else 0
    along = [abs(cosine) > ALONG for cosine in own.axis]
    return tuple(
        end
        for i, end in enumerate(COMPONENTS)
        if not (first <= i < first + len(SHIFTS) and along[i % 3])
    )


def _spring(
    robot: Robot, joint: str, ends: tuple[str, ...] = ("",), law: str = LINEAR
) -> Parameter:
    """The spring of a joint along some components, the joint's own under its own name.

    Raises:
        ValueError: A joint that follows another one has no spring of its own.
    """
    kinds = {one.name: one.kind == "prismatic" for one in robot.joints}
    if len(ends) == 2 and ends[0] == ends[1]:
        ends = ends[:1]
    if len(ends) == 2:
        ends = tuple(sorted(ends, key=COMPONENTS.index))
        return Parameter("spring", joint, ".".join(ends), law=law)
    is_own = not ends[0] or own_direction(robot, joint, ends[0]) != 0
    if is_own and joint not in kinds:
        raise ValueError(
            f"joint {joint!r} follows another one and has no spring of its own; expected an axis "
            f"of the frame before it, such as '{joint}.{_across(robot, joint)[0]}'"
        )
    if not is_own:
        return Parameter("spring", joint, ends[0], law=law)
    place: Place = "spring" if law else "compliance"
    return Parameter(place, joint, slides=kinds[joint], law=law)


def all_parameters(
    robot: Robot,
    markers: Sequence[str],
    geometry: Literal["all"] | Sequence[str] = "all",
    compliance: Sequence[str] = (),
    base: bool = True,
    tool: bool = True,
    pose: bool | Collection[str] = False,
    likely: Mapping[str, float] | None = None,
    bodies: Mapping[str, str] | None = None,
    others: Sequence[Parameter] = (),
) -> tuple[Parameter, ...]:
    """List the parameters that a calibration asks for, whether they can be told apart or not.

    Args:
        robot: The drawing.
        markers: Names of the markers, each of which has a place of its own.
        geometry: "all", or a list of joints ("q2": all six before it), of kinds ("zeros" of the
            joints, "lengths" and "tilts") and of single parameters ("q2.rx").
        compliance: Names of free joints with unknown springs.
        base: Whether the place of the robot is unknown.
        tool: Whether the places of the markers on the tool are.
        pose: Whether rotations are measured, so that the tool has three angles too; or names of
            the markers of which they are.
        likely: Compliances that joints are likely to have, by name [rad/(N m)]; none by default.
        bodies: Names of the joints whose bodies markers are on, by marker; the others are on the
            tool.
        others: Springs besides.

    Returns:
        Base, tools, joints from base to tip, springs.

    Raises:
        ValueError: The chain has no such joint, kind or parameter.
    """
    slides = {joint.name: joint.kind == "prismatic" for joint in robot.joints}
    of_joints = _chosen(_of_joints(robot), geometry)
    turned = (markers if pose else ()) if isinstance(pose, bool) else pose
    on = bodies or {}
    of_base = [Parameter("base", "", c) for c in COMPONENTS if base]
    of_tools = [
        Parameter("tool", n, c, body=on.get(n, ""))
        for n in markers
        for c in (COMPONENTS if n in turned else SHIFTS)
        if tool
    ]
    springs = [
        Parameter("compliance", n, slides=slides[n], likely=(likely or {}).get(n))
        for n in compliance
    ]
    return (*of_base, *of_tools, *of_joints, *springs, *others)


def _of_joints(robot: Robot) -> list[Parameter]:
    """Six before each joint of the chain, that along its axis marked."""
    found = []
    for joint in robot.chain:
        turns = joint.kind == "revolute"
        for i, component in enumerate(COMPONENTS):
            own = abs(joint.axis[i % 3]) > ALONG and (i >= len(SHIFTS)) == turns
            found.append(Parameter("joint", joint.name, component, along=bool(own)))
    return found


def _chosen(every: list[Parameter], geometry: Literal["all"] | Sequence[str]) -> list[Parameter]:
    """Those of the list.

    Raises:
        ValueError: An entry names none.
    """
    if isinstance(geometry, str):
        if geometry != "all":
            raise ValueError(f"geometry {geometry!r}; expected 'all' or a list")
        return every
    chosen: set[str] = set()
    for entry in geometry:
        named = {one.name for one in every if entry in (one.name, one.of, one.kind)}
        if not named:
            joints = ", ".join(dict.fromkeys(one.of for one in every))
            raise ValueError(
                f"no parameter {entry!r}; expected 'all', or some of {', '.join(KINDS)}, of the "
                f"joints {joints}, or of their components such as {every[-1].name}"
            )
        chosen |= named
    return [one for one in every if one.name in chosen]


@dataclass(frozen=True, eq=False)
class Identifiable:
    """A minimal set of parameters, and how the others hang on them.

    Attributes:
        kept: Indices (rank,) of the parameters that are kept, in their order.
        left: Indices of the others, in their order.
        shares: How much of each kept parameter moves the markers as one unit of each other does
            (rank, others), both in units of the parameters.
        words: One sentence for each of the others.
    """

    kept: Indices
    left: Indices
    shares: Array
    words: tuple[str, ...]

    @property
    def rank(self) -> int:
        """Number of parameters that can be told apart."""
        return len(self.kept)


def identifiable(
    scaled: Array,
    parameters: Sequence[Parameter],
    stages: Sequence[Sequence[int]] = (),
    least: float | Array = 0.0,
) -> Identifiable:
    """Choose a minimal set of parameters by QR with column pivots.

    Columns are scaled to the parameters' units and then to unit length, so that neither a metre nor
    the number of rows decides. They are taken by stages: a column of a later stage is kept only if
    no combination of earlier ones does what it does. Within a stage that with the largest part
    orthogonal to those already kept comes first (Businger and Golub 1965).

    Args:
        scaled: Regressor (rows, p) in units of the parameters.
        parameters: What the columns are (p,).
        stages: Indices by stage; the rest are the last stage.
        least: A column is kept only if what earlier ones leave of it is longer than this (or than
            its own, (p,)), in the units of the rows: shorter ones are known worse than noise /
            least units.
    """
    order = _ordered(len(parameters), stages)
    length = np.linalg.norm(scaled, axis=0)
    largest = length.max(initial=0.0)
    unit = np.divide(scaled, length, out=np.zeros_like(scaled), where=length > NEGLIGIBLE * largest)
    # The rows are compressed first: what follows is of p rows, however long the sheet is.
    remaining: Array = np.array(np.linalg.qr(unit, mode="r"))
    floor = np.maximum(TOLD, least / np.where(length > 0, length, 1.0))
    kept: list[int] = []
    for stage in order:
        waiting = list(stage)
        while waiting:
            sizes = np.linalg.norm(remaining[:, waiting], axis=0)
            sizes = np.where(sizes > floor[waiting], sizes, 0.0)
            # Shifts along parallel axes do the same: rounding is not to choose one of them.
            best = int(np.argmax(sizes >= (1 - ALIKE) * sizes.max()))
            if not sizes[best]:
                break
            pivot = waiting.pop(best)
            kept.append(pivot)
            direction = remaining[:, pivot] / sizes[best]
            # Twice is enough: one pass leaves rounding of the size of what it removes.
            for _ in range(2):
                remaining -= np.outer(direction, direction @ remaining)
            remaining[:, pivot] = 0.0
    chosen = np.array(sorted(kept), dtype=int)
    left = np.array([i for i in range(len(parameters)) if i not in set(kept)], dtype=int)
    shares = _shares(unit, length, chosen, left)
    words = tuple(
        _words(parameters, chosen, int(one), shares[:, i], length[one] > NEGLIGIBLE * largest)
        for i, one in enumerate(left)
    )
    return Identifiable(chosen, left, shares, words)


def _ordered(p: int, stages: Sequence[Sequence[int]]) -> list[list[int]]:
    """The stages, and what is in none of them."""
    named = {i for stage in stages for i in stage}
    return [*(list(stage) for stage in stages), [i for i in range(p) if i not in named]]


def _shares(unit: Array, length: Array, kept: Indices, left: Indices) -> Array:
    """How the left columns combine the kept ones, in units of the parameters."""
    if not len(left) or not len(kept):
        return np.zeros((len(kept), len(left)))
    Q, R = np.linalg.qr(unit[:, kept])
    found = np.linalg.solve(R, Q.T @ unit[:, left])
    return found * length[left] / length[kept, None]


def _words(
    parameters: Sequence[Parameter],
    kept: Indices,
    left: int,
    shares: Array,
    moves: bool,
) -> str:
    """One sentence on a parameter that is not kept."""
    own = parameters[left].words
    if not moves:
        return f"{own} moves no marker in these poses{parameters[left].asks_for}"
    # Of shares that differ by rounding alone the first parameter comes first.
    sizes = np.round(np.abs(shares) / np.abs(shares).max() / ALIKE) * ALIKE
    large = np.flatnonzero(sizes > SMALL_SHARE)
    ordered = large[np.argsort(-sizes[large], kind="stable")]
    names = [parameters[kept[i]].words for i in ordered[:MOST_NAMED]]
    more = len(ordered) - len(names)
    listed = ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]
    rest = f" (with {more} more)" if more else ""
    return f"{own} cannot be told from {listed}{rest}"
