"""Targets of Universal Robots' programs: lists of joints and poses in URScript."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from edtk.programs.program import Axis
from edtk.programs.targets.brand import Brand, of_vector, vector_of
from edtk.programs.targets.reading import (
    DEFAULT,
    Frame,
    Frames,
    Left,
    Literal,
    Opened,
    Parser,
    Reading,
    Use,
    blanked,
    closing,
    closings,
    lines_of,
    numbers_in,
    pieces,
)
from edtk.system.typing import Array

HIDDEN = re.compile(r'"[^"\r\n]*"|#[^\r\n]*')
OPENS = re.compile(r"\s*(if|while|for|thread|def|sec)\b")
WORDS = {"if": "a conditional", "while": "a loop", "for": "a loop", "thread": "a thread"}
END = re.compile(r"\s*end\s*$")
CALL = re.compile(r"\b(movej|movel|movep|movec|set_tcp)\s*\(")
ASSIGNED = re.compile(r"\s*+(?:(?:global|local)\s++)?(\w++)\s*+((?:\[[^\]]*\])?)\s*+=(?!=)\s*")
KEYWORD = re.compile(r"[A-Za-z_]\w*\s*=(?!=)\s*")
POSE = 6


class UrTargets(Brand):
    """URScript."""

    title = "URScript"
    suffixes = (".script", ".urscript")
    content = re.compile(r"^[^\S\n]*+def\s++\w++\s*+\(|\bmove[jlpc]\s*+\(", re.M)
    expected = "a def or a move"
    joint_decimals: ClassVar[int] = 6
    decimals: ClassVar[tuple[int, ...]] = (6,) * 6
    radians: ClassVar[bool] = True

    def read(
        self, text: str, axes: Sequence[Axis], frames: Frames, beside: Mapping[str, str]
    ) -> Reading:
        """Find lists in moves, and in variables of moves."""
        return _Parser(text, axes, frames).parse()

    def place(self, numbers: Sequence[float]) -> Array:
        """Position [m] and rotation vector [rad]."""
        return of_vector(numbers[:3], numbers[3:])

    def numbers(self, place: Array, near: Sequence[float]) -> tuple[float, ...]:
        """Position [m] and rotation vector [rad]."""
        return (*place[:3, 3].tolist(), *vector_of(place, near[3:]).tolist())

    def marked(self, text: str, words: str, end: str) -> str:
        """A comment behind the last line."""
        between = "" if not text or text.endswith(("\n", "\r")) else end
        return f"{text}{between}# corrected by {words}{end}"


@dataclass(eq=False)
class _Parser(Parser):
    """One file, line by line."""

    maybe: dict[str, list[Literal]] = field(default_factory=dict)
    open: list[Opened] = field(default_factory=list)
    done: int = 0  # where the last call ends, which may have several lines

    def parse(self) -> Reading:
        """Read all lines."""
        self.clean = blanked(self.text, HIDDEN)
        self.closings = closings(self.clean)
        self.routine = self.new_routine()
        for number, begin, whole in lines_of(self.clean):
            at = max(begin, min(self.done, begin + len(whole)))
            line = whole[at - begin :]
            opens = OPENS.match(line)
            if END.match(line):
                self._close(at)
                continue
            if opens is not None:
                if opens[1] in ("def", "sec") and not self.open:
                    self.routine = self.new_routine()
                self.open.append((at, number, opens[1]))
            self._line(number, at, line)
        while self.open:
            self._close(len(self.text))
        for name, values in self.maybe.items():
            if name in self.reading.uses:
                self.reading.literals += values
        self.reading.first = self.first()
        return self.reading

    def first(self) -> tuple[Frame, Frame]:
        """Tool and base of the start; the robot's own base where the study has no default."""
        tool, base = super().first()
        has_base = any(name.upper() == DEFAULT for name in self.frames.bases)
        return tool, base if has_base else self.frames.base("0")

    def _close(self, at: int) -> None:
        """The end of a block."""
        if self.open:
            start, line, word = self.open.pop()
            if word in WORDS:
                self.routine.close((start, line, WORDS[word]), at)
            elif self.open:  # a function inside of another one runs where it is called
                self.routine.blocks.append((start, at, ""))

    def _line(self, number: int, at: int, line: str) -> None:
        """Moves, tools and values of a line."""
        end = at + len(line)
        value = ASSIGNED.match(line)
        if value is not None:
            self._value(number, at, line, value)
            return
        place = at
        while (call := CALL.search(self.clean, place, end)) is not None:
            self.note(number, place, call.start())
            last = self.closings.get(call.end() - 1, end)
            self._call(number, call[1], call.start(), call.end(), last)
            place = self.done = max(last, call.end())
        self.note(number, place, end)

    def _value(self, number: int, at: int, line: str, found: re.Match[str]) -> None:
        """A variable gets a list, or anything else."""
        name = found[1]
        first, last = at + found.end(), at + len(line.rstrip())
        literal = None if found[2] else self._list(number, name, first, last)
        if literal is not None and not literal.problem:
            self.maybe.setdefault(name, []).append(literal)
        else:
            self.reading.changed.setdefault(name, number)
            self.note(number, first, last)

    def _list(self, number: int, name: str, first: int, last: int) -> Literal | None:
        """A list of joints or a pose; None of anything else."""
        is_pose = self.clean.startswith("p[", first)
        begin = first + is_pose
        if begin >= last or self.clean[begin] != "[":
            return None
        if closing(self.clean, begin, last) != last - 1:
            return None
        numbers = numbers_in(self.text, begin, last)
        if numbers is None:
            return Literal(number, name, problem="is computed at run time", start=first)
        if len(numbers) != (POSE if is_pose else len(self.axes)):
            problem = f"has {len(numbers)} numbers; expected {POSE if is_pose else len(self.axes)}"
            return Literal(number, name, problem=problem, start=first)
        if is_pose:
            return Literal(number, name, pose=numbers, start=first)
        joints = {axis.place: one for axis, one in zip(self.axes, numbers, strict=True)}
        return Literal(number, name, joints=joints, start=first)

    def _call(self, number: int, word: str, at: int, start: int, end: int) -> None:
        """A move, or a tool."""
        parts = pieces(self.clean, start, end)
        count = 2 if word == "movec" else 1
        for first, last in parts[count:]:
            key = KEYWORD.match(self.clean, first, last)
            self.note(number, key.end() if key else first, last)
        for first, last in parts[:count]:
            key = KEYWORD.match(self.clean, first, last)
            begin = key.end() if key else first
            part = self.clean[begin:last]
            literal = self._list(number, "", begin, last)
            if word == "set_tcp":
                self.routine.sets.append((at, "tool", self._tool(part, literal)))
            elif literal is not None:
                self.reading.literals.append(literal)
                self.reading.own[begin] = Use(number, at, self.routine)
            elif re.fullmatch(r"[A-Za-z_]\w*", part):
                self.reading.use(part, Use(number, at, self.routine))
            else:
                self.reading.left.append(Left(number, "is computed at run time"))
                self.note(number, begin, last)

    def _tool(self, part: str, literal: Literal | None) -> Frame:
        """The tool that is set."""
        named = [one for one in self.maybe.get(part, ()) if one.pose]
        if literal is None and len(named) == 1 and part not in self.reading.changed:
            literal = named[0]
        if literal is not None and literal.pose:
            values = [one.value for one in literal.pose]
            return of_vector(values[:3], values[3:])
        if re.fullmatch(r"[A-Za-z_]\w*", part):
            return self.frames.tool(part)
        return "the tool is computed at run time"
