"""What is read of a robot program: targets with the places of their numbers, and what is left.

A brand's reader finds literals, the motions that use them, and what a program computes with them;
`targets_of` decides from that, for all brands alike, which of them are the same at every run.
"""

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from heapq import heappop, heappush

import numpy as np

from edtk.programs.program import Axis
from edtk.system.typing import Array

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
WORD = re.compile(r"[A-Za-z_$][\w$]*(?:\[\d+\])?")
NUMBERED = re.compile(r"(?:TOOL_DATA|BASE_DATA|UTOOL|UFRAME|UT|UF)?\[?(\d+)\]?")
NO_FRAME = ("0", "TOOL0", "WOBJ0", "$NULLFRAME")  # names that every controller knows
DEFAULT = "DEFAULT"
ALL_LITERALS = "--all-literals corrects it"
LARGEST = 1e10  # of a number in a target; 9E9 stands for an axis that is not there
NOT_HERE = "is not declared here"
SAME = 1e-12  # [m, or of a rotation] by which two frames are one

Frame = Array | str  # a transform (4, 4) [m], or why it is not known


@dataclass(frozen=True)
class Number:
    """A number in a text.

    Attributes:
        start: Where it begins in the text.
        end: Where it ends.
        text: Its characters; a field of fixed width has its blanks, too.
    """

    start: int
    end: int
    text: str

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames that programs name.

    Attributes:
        flange: The controller's flange (4, 4), in the frame in which the study gives tools [m].
        world: The controller's world (4, 4), in the world of the robot's model [m].
        tools: Tools (4, 4) by name, in the controller's flange [m].
        bases: Bases (4, 4) by name, in the controller's world [m].
    """

    flange: Array = field(default_factory=lambda: np.eye(4))
    world: Array = field(default_factory=lambda: np.eye(4))
    tools: Mapping[str, Array] = field(default_factory=dict)
    bases: Mapping[str, Array] = field(default_factory=dict)

    def tool(self, name: str) -> Frame:
        """A tool by name, or why it is not known."""
        return _named(name, self.tools, "tool")

    def base(self, name: str) -> Frame:
        """A base by name, or why it is not known."""
        return _named(name, self.bases, "base")

    def first(self, which: str) -> Frame:
        """What holds before a program states a tool or a base."""
        table = self.tools if which == "tool" else self.bases
        return _named(DEFAULT, table, which, f"no {which} is stated before it")


def _named(name: str, table: Mapping[str, Array], which: str, why: str = "") -> Frame:
    key = _plain(name)
    for other, frame in table.items():
        if _plain(other) == key:
            return frame
    if key in NO_FRAME:
        return np.eye(4)
    why = why or f"{which} {name} is not known"
    return f"{why}; expected it in the program, or as frames.{which}.{_shown(key)} of the study"


def _plain(name: str) -> str:
    """A name as it is compared: "TOOL_DATA[1]", "UT 1" and "1" are the same."""
    found = "".join(name.split()).upper()
    numbered = NUMBERED.fullmatch(found)
    return numbered[1] if numbered else found


def _shown(key: str) -> str:
    return "default" if key == DEFAULT else key


@dataclass(frozen=True, eq=False)
class Literal:
    """Numbers that may be a target.

    Attributes:
        line: Its line, counted from 1.
        name: Of its variable; empty where it stands in a motion.
        joints: Its numbers by axis, "1" to "6" and "E1" to "E6"; empty of a pose.
        pose: Its numbers of position, then of orientation, in the brand's order; empty of joints.
        branch: Numbers, or words, that tell the branch, by the brand's names.
        problem: Why it is none; empty if it is one.
        start: Where it begins in the text.
        frames: Tool and base that are stated beside it; None where the motions state them.
    """

    line: int
    name: str
    joints: Mapping[str, Number] = field(default_factory=dict)
    pose: tuple[Number, ...] = ()
    branch: Mapping[str, Number] = field(default_factory=dict)
    problem: str = ""
    start: int = 0
    frames: tuple[Frame, Frame] | None = None


@dataclass(frozen=True, eq=False)
class Target:
    """A literal that is the same at every run, with the frames of its motions.

    Attributes:
        literal: The numbers.
        tool: Tool (4, 4) in the controller's flange [m]; the identity for joints.
        base: Base (4, 4) in the controller's world [m]; likewise.
    """

    literal: Literal
    tool: Array
    base: Array


@dataclass(frozen=True)
class Left:
    """What is left as it is.

    Attributes:
        line: Its line, counted from 1.
        reason: Why.
        name: Of its variable; empty without one.
    """

    line: int
    reason: str
    name: str = ""

    @property
    def text(self) -> str:
        """One line."""
        return f"line {self.line}: " + (f"{self.name}: " if self.name else "") + self.reason


Opened = tuple[int, int, str]  # where a block begins, its line, and what it is in words


@dataclass(eq=False)
class Routine:
    """What holds in the lines of one routine: blocks, and the tools and bases that it sets.

    It is asked when all of it is read.

    Attributes:
        first: Tool and base where it begins.
        blocks: Conditionals and loops: begin, end, and what they are in words; no words for lines
            that are somewhere else, as functions inside of others.
        sets: What is set where: position in the text, "tool" or "base", the frame.
    """

    first: dict[str, Frame]
    blocks: list[tuple[int, int, str]] = field(default_factory=list)
    sets: list[tuple[int, str, Frame]] = field(default_factory=list)

    def close(self, opened: Opened, end: int) -> None:
        """A conditional or a loop ends."""
        start, line, words = opened
        self.blocks.append((start, end, f"{words} (line {line})"))

    def jump(self, line: int, at: int, target: int, word: str = "GOTO") -> None:
        """What lies between a jump and its label may be done often, or not at all."""
        reach = f"the reach of the {word} of line {line}"
        self.blocks.append((min(at, target), max(at, target), reach))

    def block(self, at: int) -> str:
        """What conditional or loop a position is in, in words; empty for none."""
        places, words = self._words
        return words[bisect_right(places, at)]

    @cached_property
    def _words(self) -> tuple[list[int], list[str]]:
        """Places at which the words of `block` change, and the words between them.

        Of the blocks around a place the one that was noted first counts.
        """
        begin: dict[int, list[int]] = {}
        for order, (start, _, words) in enumerate(self.blocks):
            if words:
                begin.setdefault(start, []).append(order)
        places = sorted({edge for start, end, _ in self.blocks for edge in (start, end)})
        found = [""]
        around: list[int] = []  # a heap of those that have begun
        for place in places:
            for order in begin.get(place, ()):
                heappush(around, order)
            while around and self.blocks[around[0]][1] <= place:
                heappop(around)
            found.append(self.blocks[around[0]][2] if around else "")
        return places, found

    def frame(self, which: str, at: int) -> Frame:
        """The tool or base at a position.

        One that is set in a conditional or a loop is known if it is the one before: else it is not,
        neither there nor behind.
        """
        places, states = self._states[which]
        return states[bisect_left(places, at)]

    @cached_property
    def _states(self) -> dict[str, tuple[list[int], list[Frame]]]:
        """Places behind which another tool or base holds, and those between them."""
        found: dict[str, tuple[list[int], list[Frame]]] = {
            which: ([], [state]) for which, state in self.first.items()
        }
        outer = _outermost([(start, end) for start, end, _ in self.blocks])
        begins = [start for start, _ in outer]
        for place, which, frame in self.sets:
            places, states = found[which]
            start, end = outer[bisect_right(begins, place) - 1] if outer else (0, 0)
            if not start <= place < end:
                places.append(place)
                states.append(frame)
            elif not same_frame(states[-1], frame):
                places.append(start)
                states.append(f"the {which} is set in a conditional or a loop before it")
        return found


def _outermost(blocks: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Blocks in order, those that overlap as one."""
    merged: list[tuple[int, int]] = []
    for start, end in sorted(blocks):
        if merged and start < merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def same_frame(one: Frame, other: Frame) -> bool:
    """Whether two frames are the same, or unknown for the same reason."""
    if isinstance(one, str) or isinstance(other, str):
        return isinstance(one, str) and isinstance(other, str) and one == other
    return bool(np.abs(one - other).max() <= SAME)


@dataclass(frozen=True, eq=False)
class Use:
    """A motion to a literal.

    Attributes:
        line: Its line, counted from 1.
        at: Its position in the text.
        routine: The routine that it is in.
        frames: Tool and base that the motion itself states; None for those of the routine.
    """

    line: int
    at: int
    routine: Routine
    frames: tuple[Frame, Frame] | None = None

    def stated(self) -> tuple[Frame, Frame]:
        """Tool and base."""
        if self.frames is not None:
            return self.frames
        return self.routine.frame("tool", self.at), self.routine.frame("base", self.at)


@dataclass(eq=False)
class Reading:
    """What a reader finds, before it is decided what is a target.

    Names are in capitals where a brand does not tell small letters from them.

    Attributes:
        literals: All of the text that is to be corrected.
        own: Motions to literals without a name, by their places.
        uses: Motions by the name of their target.
        changed: Names that get another value at run time, and the line that does it.
        computed: Names with which something is computed, and the line that does it.
        left: Lines whose targets are no literals.
        known: Names that are declared somewhere else, and where.
        first: Tool and base of literals that no motion uses.
    """

    literals: list[Literal] = field(default_factory=list)
    own: dict[int, Use] = field(default_factory=dict)
    uses: dict[str, list[Use]] = field(default_factory=dict)
    changed: dict[str, int] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    left: list[Left] = field(default_factory=list)
    known: dict[str, str] = field(default_factory=dict)
    first: tuple[Frame, Frame] = ("", "")

    def use(self, name: str, use: Use) -> None:
        """Note a motion to a name."""
        self.uses.setdefault(name, []).append(use)


@dataclass(eq=False)
class Parser:
    """What the readers of all brands begin with: one file.

    Attributes:
        text: The file.
        axes: The robot's axes.
        frames: Frames that it may name.
        reading: What is found.
        clean: The file without comments and strings.
    """

    text: str
    axes: Sequence[Axis]
    frames: Frames
    reading: Reading = field(default_factory=Reading, kw_only=True)
    clean: str = field(default="", init=False)

    @cached_property
    def starts(self) -> list[int]:
        """Where each line begins."""
        return [at for _, at, _ in lines_of(self.text)]

    def line(self, at: int) -> int:
        """The line of a position, from 1."""
        return bisect_right(self.starts, at)

    def note(self, line: int, start: int, end: int) -> None:
        """Names that something is computed with."""
        for one in WORD.finditer(self.clean, start, end):
            self.reading.computed.setdefault(one[0].partition("[")[0], line)

    def first(self) -> tuple[Frame, Frame]:
        """Tool and base that hold before the program states others."""
        return self.frames.first("tool"), self.frames.first("base")

    def new_routine(self) -> Routine:
        """A routine that begins with them."""
        tool, base = self.first()
        return Routine({"tool": tool, "base": base})


def targets_of(reading: Reading, every: bool) -> tuple[list[Target], list[Left]]:
    """Decide which literals are targets that are the same at every run.

    Args:
        reading: What was found.
        every: Whether literals count that stand in conditionals and loops, or that something is
            computed with.

    Returns:
        The targets in the order of the text, and what is left, in the order of its lines.
    """
    targets: list[Target] = []
    left = list(reading.left)
    names = {literal.name for literal in reading.literals}
    for literal in sorted(reading.literals, key=lambda one: one.start):
        found = _target(reading, literal, every)
        if isinstance(found, str):
            left.append(Left(literal.line, found, literal.name))
        else:
            targets.append(found)
    for name, uses in reading.uses.items():
        if name not in names:
            where = reading.known.get(name)
            reason = f"is declared in {where}; correct that file, too" if where else NOT_HERE
            if name in reading.changed:
                reason = f"line {reading.changed[name]} computes it at run time"
            left.append(Left(uses[0].line, reason, name))
    return targets, sorted(left, key=lambda one: one.line)


def _target(reading: Reading, literal: Literal, every: bool) -> Target | str:
    """A literal as a target, or why it is none."""
    name = literal.name
    uses = reading.uses.get(name, []) if name else [reading.own[literal.start]]
    if literal.problem:
        return literal.problem
    if name in reading.changed:
        return f"line {reading.changed[name]} changes it at run time"
    if name in reading.computed and not every:
        return f"line {reading.computed[name]} computes with it; {ALL_LITERALS}"
    blocks = list(filter(None, (use.routine.block(use.at) for use in uses)))
    if blocks and not every:
        return f"its motion stands in {blocks[0]}; {ALL_LITERALS}"
    if literal.joints:
        return Target(literal, np.eye(4), np.eye(4))
    stated = [use.stated() for use in uses] or [reading.first]
    if literal.frames is not None:
        stated = [literal.frames]
    for other in stated[1:]:
        if not all(map(same_frame, stated[0], other)):
            return "motions with different tools or bases go there"
    tool, base = stated[0]
    if isinstance(tool, str) or isinstance(base, str):
        return tool if isinstance(tool, str) else str(base)
    return Target(literal, tool, base)


def lines_of(text: str) -> Iterator[tuple[int, int, str]]:
    """The lines of a text with any line ends: number from 1, position, and content."""
    start = 0
    for number, line in enumerate(re.split(r"(\r\n|\n|\r)", text)[::2], 1):
        yield number, start, line
        start += len(line)
        start += 2 if text.startswith("\r\n", start) else 1


def blanked(text: str, pattern: re.Pattern[str]) -> str:
    """A text of the same length, with blanks for comments and strings."""
    return pattern.sub(lambda found: " " * len(found[0]), text)


def capitals(text: str) -> str:
    """A text of the same length whose letters of ASCII are large."""
    return "".join(sign.upper() if sign.isascii() else sign for sign in text)


def pieces(
    text: str, start: int, end: int, opening: str = "([{", closing: str = ")]}"
) -> list[tuple[int, int]]:
    """Parts of a text between commas that no bracket holds: begin and end, without blanks."""
    found = []
    depth = 0
    first = start
    for at in range(start, end + 1):
        sign = text[at] if at < end else ","
        depth += (sign in opening) - (sign in closing)
        if at == end or (sign == "," and depth == 0):
            part = text[first:at]
            found.append((first + len(part) - len(part.lstrip()), first + len(part.rstrip())))
            first = at + 1
    return found


def closings(text: str) -> dict[int, int]:
    """Positions of brackets, and of those that close them; without those that nothing closes."""
    pairs = {"(": ")", "[": "]", "{": "}"}
    found: dict[int, int] = {}
    waiting: list[tuple[int, str]] = []
    for place, sign in enumerate(text):
        if sign in pairs:
            waiting.append((place, pairs[sign]))
        elif waiting and sign == waiting[-1][1]:
            found[waiting.pop()[0]] = place
    return found


def closing(text: str, at: int, end: int) -> int:
    """Position of the bracket that closes the one at a position; -1 without one before an end."""
    return at + closings(text[at:end]).get(0, -1 - at)


def number_at(text: str, start: int, end: int) -> Number | None:
    """The number that a part of a text is; None if it is anything else, or far too large."""
    part = text[start:end]
    if NUMBER.fullmatch(part) is None or abs(float(part)) > LARGEST:
        return None
    return Number(start, end, part)


def numbers_in(text: str, start: int, end: int) -> tuple[Number, ...] | None:
    """The numbers of a list in brackets between two positions; None if it has anything else."""
    if start >= end or text[start] != "[" or closing(text, start, end) != end - 1:
        return None
    found = [number_at(text, *part) for part in pieces(text, start + 1, end - 1)]
    return None if None in found else tuple(one for one in found if one is not None)


def written(number: Number, value: float, least: int) -> str:
    """A number's new text, with as many decimals as before, and `least` at least.

    A number that does not move by what these decimals can say keeps its text.
    """
    old = number.text.strip()
    digits = old.partition(".")[2]
    decimals = max(least, len(digits) if "e" not in old.lower() else 0)
    new = f"{round(value, decimals) + 0.0:.{decimals}f}"
    if float(new) == round(float(old), decimals):
        return number.text
    sign = "+" if old.startswith("+") and not new.startswith("-") else ""
    # In a field with blanks before it a number keeps its place.
    return (sign + new).rjust(len(number.text) if number.text != old else 0)
