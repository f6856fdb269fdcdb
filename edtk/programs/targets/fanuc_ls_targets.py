"""Targets of FANUC programs: positions of the /POS section of an .ls file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from edtk.programs.program import Axis
from edtk.programs.targets.brand import Brand, of_rpy, rpy_of, signed
from edtk.programs.targets.reading import (
    Frame,
    Frames,
    Left,
    Literal,
    Number,
    Opened,
    Parser,
    Reading,
    Use,
    blanked,
    lines_of,
    number_at,
)
from edtk.robots.inverse import Posture
from edtk.system.typing import Array

HIDDEN = re.compile(r'"[^"\r\n]*"|![^\r\n]*')
SECTION = re.compile(r"(?m)^[ \t]*/(\w+)")
POSITION = re.compile(r"P\[\s*+(\d++)\s*+(?::[^\]]{0,200})?\]\s*+\{")
GROUP = re.compile(r"GP(\d+)\s*:")
FRAME = {"tool": re.compile(r"\bUT\s*:\s*(\w+)"), "base": re.compile(r"\bUF\s*:\s*(\w+)")}
CONFIG = re.compile(r"CONFIG\s*:\s*'([^']*)'")
FIELD = r"\b{}\s*+=([^,\r\n}}]{{0,60}}?)\s*+(?:deg|mm)\b"
POSE = ("X", "Y", "Z", "W", "P", "R")
LINE = r"^\s*+\d*+\s*+:?+\s*+"
NAME = r"([^\]:]{0,60}+)(?::[^\]]{0,200})?\]"  # with blanks, and a comment after it
MOTION = re.compile(rf"{LINE}([JLCAS])\s++(P|PR)\[{NAME}(.*)$")
POINT = re.compile(rf"\b(P|PR)\[\s*+(?:GP\d++:)?{NAME}")
SECOND = re.compile(rf"^\s*+:?+\s*+(P|PR)\[{NAME}(.*)$")
OF_TWO = re.compile(rf"{LINE}[CA]\s")
SHIFTED = re.compile(r"\b(?:Tool_)?Offset\b|\bINC\b|\bVOFFSET\b", re.I)
OPENS = re.compile(rf"{LINE}(?:(IF)\s*+\(.*\)\s*+THEN\b|(FOR)\b)")
CLOSES = re.compile(rf"{LINE}(?:ENDIF|ENDFOR)\b")
LABEL = re.compile(rf"{LINE}LBL\[\s*+(\w+)")
JUMP = re.compile(r"\bJMP\s++LBL\[([^\]]{0,60}+)\]")
HALF = np.pi


class FanucTargets(Brand):
    """The LS format of FANUC."""

    title = "FANUC LS"
    suffixes = (".ls",)
    content = re.compile(
        r"\A" + "".join(rf"(?>.*?^[^\S\n]*+/{name}\b)" for name in ("PROG", "MN", "POS")),
        re.M | re.S,
    )
    expected = "/PROG, /MN and /POS"
    joint_decimals: ClassVar[int] = 3
    decimals: ClassVar[tuple[int, ...]] = (3,) * 6

    def read(
        self, text: str, axes: Sequence[Axis], frames: Frames, beside: Mapping[str, str]
    ) -> Reading:
        """Find positions in /POS, and motions in /MN."""
        return _Parser(text, axes, frames).parse()

    def place(self, numbers: Sequence[float]) -> Array:
        """X, Y, Z [mm] and W, P, R [deg]: turns about the fixed x, y and z."""
        return of_rpy(numbers[:3], numbers[3:])

    def numbers(self, place: Array, near: Sequence[float]) -> tuple[float, ...]:
        """X, Y, Z, W, P, R."""
        x, y, z = (1e3 * place[:3, 3]).tolist()
        return (x, y, z, *rpy_of(place, near[3]))

    def fits(self, literal: Literal, posture: Posture | None, shown: Array) -> bool:
        """Elbow up or down, arm toward or back; the wrist is on the side that is nearest."""
        if any(abs(shown[j]) > HALF for j in (0, 3, 5)):
            return False
        if posture is None:
            return True
        words = set(literal.branch["CONFIG"].text.split(",")[0].replace(" ", "").upper())
        up = signed(posture.elbow, "D" in words)
        ahead = signed(posture.ahead, "B" in words)
        return up and ahead

    def marked(self, text: str, words: str, end: str) -> str:
        """A comment as the last line of /MN, and the number of lines in the head."""
        body = re.search(r"(?ms)^[ \t]*/MN\b[^\r\n]*(?:\r\n|\n|\r)(.*?)(?=^[ \t]*/POS\b)", text)
        if body is None:
            return text
        count = len(re.findall(r"(?m)^[^\S\n]*+\d++\s*+:", body[1])) + 1
        marked = f"{text[: body.end()]}{count:4d}:  !{words} ;{end}{text[body.end() :]}"
        return re.sub(
            r"(LINE_COUNT\s*=\s*)(\d+)", lambda one: f"{one[1]}{int(one[2]) + 1}", marked, count=1
        )


@dataclass(eq=False)
class _Parser(Parser):
    """One file: its positions, then its motions."""

    def parse(self) -> Reading:
        """Read everything."""
        self.clean = blanked(self.text, HIDDEN)
        self.routine = self.new_routine()
        sections = list(SECTION.finditer(self.clean))
        spans = {
            one[1].upper(): (one.end(), after.start() if after else len(self.text))
            for one, after in zip(sections, [*sections[1:], None], strict=True)
        }
        if "MN" in spans:
            self._motions(*spans["MN"])
        if "POS" in spans:
            self._positions(*spans["POS"])
        self.reading.first = self.first()
        return self.reading

    def _motions(self, start: int, end: int) -> None:
        """Motions with their conditionals and jumps."""
        open_: list[Opened] = []
        labels: dict[str, int] = {}
        jumps: list[tuple[str, int, int]] = []
        before = ""
        for number, at, line in lines_of(self.clean):
            if not start <= at < end:
                continue
            opens = OPENS.match(line)
            if opens is not None:
                open_.append((at, number, "a conditional" if opens[1] else "a loop"))
            elif CLOSES.match(line) and open_:
                self.routine.close(open_.pop(), at)
            label = LABEL.match(line)
            if label is not None:
                labels[label[1]] = at
            jumps += [(one[1].strip(), number, at) for one in JUMP.finditer(line)]
            self._motion(number, at, line, before)
            before = line if MOTION.match(line) else before
        for name, number, at in jumps:
            self.routine.jump(number, at, labels.get(name, start), "JMP")

    def _motion(self, number: int, at: int, line: str, before: str) -> None:
        """The target of one line, and positions that it computes with."""
        found = MOTION.match(line)
        kind, name, rest = "", "", line
        if found is not None:
            kind, name, rest = found[2], found[3].strip(), found[4]
        elif (second := SECOND.match(line)) and OF_TWO.match(before):
            kind, name, rest = second[1], second[2].strip(), second[3]
        if kind == "PR":
            self.reading.left.append(Left(number, "is a register, which the program does not hold"))
        elif kind and not name.isdecimal():
            self.reading.left.append(Left(number, "is chosen at run time"))
        elif kind:
            point = f"P[{int(name)}]"
            self.reading.use(point, Use(number, at, self.routine))
            if SHIFTED.search(rest):
                self.reading.computed.setdefault(point, number)
                self.reading.left.append(Left(number, "is displaced at run time", point))
        for one in POINT.finditer(rest):
            if one[1] == "P" and one[2].strip().isdecimal():
                self.reading.computed.setdefault(f"P[{int(one[2])}]", number)

    def _positions(self, start: int, end: int) -> None:
        """All positions."""
        place = start
        while (found := POSITION.search(self.text, place, end)) is not None:
            last = self.text.find("}", found.end(), end)
            last = end if last < 0 else last
            groups = list(GROUP.finditer(self.text, found.end(), last))
            first = groups[0].end() if groups else found.end()
            stop = groups[1].start() if len(groups) > 1 else last
            self.reading.literals.append(self._literal(found, first, stop))
            place = last

    def _literal(self, found: re.Match[str], start: int, end: int) -> Literal:
        """One position of the robot, which is the first group."""
        name = f"P[{int(found[1])}]"
        line = self.line(found.start())
        place = found.start()
        joints = {axis.place: self._number(_joint(axis), start, end) for axis in self.axes}
        if all(joints.values()):
            known = {key: one for key, one in joints.items() if one is not None}
            return Literal(line, name, joints=known, start=place)
        pose = [self._number(key, start, end) for key in POSE]
        config = CONFIG.search(self.text, start, end)
        if not all(pose) or config is None:
            return Literal(line, name, problem="has not all its numbers", start=place)
        problem = ""
        if set(re.findall(r"-?\d+", config[1])) - {"0"}:
            problem = "has turn numbers other than 0, which are not told here"
        return Literal(
            line,
            name,
            pose=tuple(one for one in pose if one is not None),
            branch={"CONFIG": Number(config.start(1), config.end(1), config[1])},
            problem=problem,
            start=place,
            frames=(self._frame("tool", start, end), self._frame("base", start, end)),
        )

    def _number(self, key: str, start: int, end: int) -> Number | None:
        """The number of a field, with the blanks before it."""
        found = re.compile(FIELD.format(re.escape(key))).search(self.text, start, end)
        if found is None or number_at(found[1].strip(), 0, len(found[1].strip())) is None:
            return None
        return Number(found.start(1), found.end(1), found[1])

    def _frame(self, which: str, start: int, end: int) -> Frame:
        """The user tool or frame of a position."""
        found = FRAME[which].search(self.text, start, end)
        if found is None or not found[1].isdecimal():
            return f"states no {which}; it has the one that is chosen at run time"
        return self.frames.tool(found[1]) if which == "tool" else self.frames.base(found[1])


def _joint(axis: Axis) -> str:
    """The field of an axis."""
    return axis.place if axis.external else f"J{axis.place}"
