"""Targets of ABB programs: jointtarget and robtarget literals of RAPID modules."""

import re
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from edtk.programs.program import Axis
from edtk.programs.targets.brand import (
    EDGE,
    Brand,
    before_last,
    of_quaternion,
    quaternion_of,
    signed,
)
from edtk.programs.targets.reading import (
    WORD,
    Frame,
    Frames,
    Left,
    Literal,
    Number,
    Parser,
    Reading,
    Routine,
    Use,
    blanked,
    capitals,
    closing,
    numbers_in,
    pieces,
)
from edtk.robots.inverse import Posture
from edtk.system.typing import Array

HIDDEN = re.compile(r'"[^"\r\n]*"|![^\r\n]*')
TOKEN = re.compile(r"[A-Z]\w*|;|:(?!=)")
OPENS = {"FOR": "a loop", "WHILE": "a loop", "TEST": "a conditional", "IF": "a conditional"}
CLOSES = {"ENDFOR": "FOR", "ENDWHILE": "WHILE", "ENDTEST": "TEST", "ENDIF": "IF"}
HEADS = {"FOR": "DO", "WHILE": "DO", "IF": "THEN"}  # words that end the head of a block
HEAD = re.compile(r"(?:(?:PROC|MODULE)\s+\w+|FUNC\s+\w+\s+\w+|TRAP\s+\w+)\s*+(?:\([^();]*+\))?|\w+")
ROUTINES = (
    "MODULE",
    *("PROC", "FUNC", "TRAP", "ENDPROC", "ENDFUNC", "ENDTRAP", "ENDMODULE"),
)
MOVE = re.compile(r"(?:MOVE(?:J|L|C|ABSJ)|TRIGG[JLC]|ARC[LC])(?:DO|AO|GO|SYNC|START|END)?")
INNER_MOVE = re.compile(rf"\b{MOVE.pattern}(?=\s)")
DECLARED = re.compile(
    r"\s*(?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+"
    r"(ROBTARGET|JOINTTARGET|TOOLDATA|WOBJDATA)\s+(\w+)\s*+(\{[^}]*\})?\s*+(?::=\s*(.*))?",
    re.S,
)
ASSIGNED = re.compile(r"\s*+(\w++)\s*+((?:\.\w++|\{[^}]*+\})*+)\s*+:=")
WOBJ = re.compile(r"\\\s*WOBJ\s*:=\s*(\w+)")
THEN = re.compile(r"\bTHEN\b|;")
LABEL = re.compile(r"\b(\w++)\s*+:(?!=)")
SHIFTS = re.compile(r"\b(PDISPON|PDISPSET|EOFFSON|EOFFSSET)\b")
QUADRANTS = {"cf1": 0, "cf4": 3, "cf6": 5}  # joints by the names of their quadrants
UNIT = 1e-3  # by which a quaternion's length may be off one
QUARTER = np.pi / 2


class RapidTargets(Brand):
    """RAPID."""

    title = "ABB RAPID"
    suffixes = (".mod", ".prg", ".modx", ".sys")
    content = re.compile(r"^[^\S\n]*+MODULE\s++\w", re.I | re.M)
    expected = "a MODULE"
    joint_decimals: ClassVar[int] = 4
    decimals: ClassVar[tuple[int, ...]] = (3, 3, 3, 6, 6, 6, 6)

    def read(
        self, text: str, axes: Sequence[Axis], frames: Frames, beside: Mapping[str, str]
    ) -> Reading:
        """Find declarations, and moves in all routines."""
        return _Parser(text, axes, frames).parse()

    def place(self, numbers: Sequence[float]) -> Array:
        """Position [mm] and quaternion."""
        return of_quaternion(numbers[:3], numbers[3:])

    def numbers(self, place: Array, near: Sequence[float]) -> tuple[float, ...]:
        """Position [mm] and quaternion."""
        position = 1e3 * place[:3, 3]
        return (*position.tolist(), *quaternion_of(place, near[3:]).tolist())

    def pins(self, literal: Literal) -> bool:
        """The configuration data are always stated."""
        return True

    def fits(self, literal: Literal, posture: Posture | None, shown: Array) -> bool:
        """Quadrants of axes 1, 4 and 6, and sides of wrist point, elbow and axis 5."""
        if posture is None:
            return True
        for name, joint in QUADRANTS.items():
            # A joint on the edge of two quadrants is in both.
            ends = np.floor((shown[joint] + np.array([-EDGE, EDGE])) / QUARTER)
            if int(literal.branch[name].value) not in ends:
                return False
        bits = int(literal.branch["cfx"].value)
        sides = (shown[4], -posture.elbow, posture.ahead)
        return all(signed(side, bool(bits >> j & 1)) for j, side in enumerate(sides))

    def branch(self, literal: Literal, posture: Posture | None, shown: Array) -> dict[Number, str]:
        """Configuration data of the joints, where they are others."""
        if posture is None:
            return {}
        new = {name: int(np.floor(shown[joint] / QUARTER)) for name, joint in QUADRANTS.items()}
        sides = (shown[4], -posture.elbow, posture.ahead)
        new["cfx"] = sum(1 << j for j, side in enumerate(sides) if side < 0)
        return {
            number: str(new[name])
            for name, number in literal.branch.items()
            if int(number.value) != new[name]
        }

    def marked(self, text: str, words: str, end: str) -> str:
        """A comment before ENDMODULE."""
        return before_last("ENDMODULE", text, f"! corrected by {words}{end}")


@dataclass(eq=False)
class _Parser(Parser):
    """One module, statement by statement."""

    data: dict[str, Frame] = field(default_factory=dict)
    tools: set[str] = field(default_factory=set)
    statements: list[tuple[int, int, Routine]] = field(default_factory=list)
    shifted: str = ""

    def parse(self) -> Reading:
        """Read everything."""
        self.clean = capitals(blanked(self.text, HIDDEN))
        self._split()
        rest = [one for one in self.statements if not self._declaration(*one[:2])]
        for start, end, _ in rest:
            self._frame_change(start, end)
        for start, end, routine in rest:
            self._statement(start, end, routine)
        self.reading.first = self.first()
        return self.reading

    def _split(self) -> None:
        """Statements, and the blocks of each routine."""
        routine = Routine({})
        open_: list[tuple[str, int]] = []
        head = ""  # the word that ends the head of a block
        short = -1  # begin of an IF with one statement
        begin = 0
        jumps: list[tuple[str, int]] = []
        for token in TOKEN.finditer(self.clean):
            word, at = token[0], token.start()
            if word in (";", ":"):
                self.statements.append((begin, at, routine))
                if word == ";" and short >= 0:
                    routine.close((short, self.line(short), OPENS["IF"]), at)
                    short = -1
                begin, head = token.end(), ""
            elif word in ROUTINES:
                self._jumps(routine, jumps)
                routine, jumps, open_ = Routine({}), [], []
                head_of = HEAD.match(self.clean, at)
                begin = token.end() if head_of is None else head_of.end()
            elif word in OPENS and not (word == "TEST" and self.clean[begin:at].strip()):
                if word == "IF" and not self._has_then(token.end()):
                    short = at if short < 0 else short
                else:
                    open_.append((word, at))
                    head = HEADS.get(word, "")
                begin = at
            elif word in CLOSES:
                while open_ and open_[-1][0] != CLOSES[word]:
                    open_.pop()
                if open_:
                    opened, start = open_.pop()
                    routine.close((start, self.line(start), OPENS[opened]), at)
                begin = token.end()
            elif word in (head, "THEN", "DO", "ELSE"):
                self.statements.append((begin, at, routine))
                begin, head = token.end(), ""
            elif word == "GOTO":
                jumps.append((self.clean[token.end() : token.end() + 40], at))
        self._jumps(routine, jumps)

    def _has_then(self, at: int) -> bool:
        """Whether an IF has THEN before its first statement ends."""
        first = bisect_left(self.ends_of_if, (at, ""))
        following = self.ends_of_if[first : first + 1]
        return bool(following) and following[0][1] == "THEN"

    @cached_property
    def ends_of_if(self) -> list[tuple[int, str]]:
        """Each THEN and each end of a statement, with its place."""
        return [(found.start(), found[0]) for found in THEN.finditer(self.clean)]

    def _jumps(self, routine: Routine, jumps: list[tuple[str, int]]) -> None:
        """GOTOs with their labels."""
        for rest, at in jumps:
            name = WORD.match(rest.strip())
            to = self.labels.get(name[0], 0) if name else 0
            routine.jump(self.line(at), at, to)

    @cached_property
    def labels(self) -> dict[str, int]:
        """Where each label stands first."""
        return {found[1]: found.start() for found in [*LABEL.finditer(self.clean)][::-1]}

    def _declaration(self, start: int, end: int) -> bool:
        """Read a declaration of data; whether it is one."""
        found = DECLARED.match(self.clean, start, end)
        if found is None:
            return False
        kind, name = found[1], found[2]
        if kind == "TOOLDATA":
            self.tools.add(name)
        if found[4] is None:
            if kind in ("TOOLDATA", "WOBJDATA"):
                self.data[name] = f"{name} has no value here"
            return True
        first, last = found.start(4), found.start(4) + len(found[4].rstrip())
        line = self.line(found.start(2))
        if kind in ("ROBTARGET", "JOINTTARGET"):
            shown = self.text[found.start(2) : found.end(2)]
            if found[3]:
                self.reading.left.append(Left(line, "is an array of targets", shown))
                self.reading.known[name] = "an array"
            else:
                literal = self._literal(line, name, first, last, kind == "ROBTARGET")
                self.reading.literals.append(literal)
        else:
            self.data[name] = self._frame(name, first, last, kind == "TOOLDATA")
        return True

    def _literal(self, line: int, name: str, first: int, last: int, pose: bool) -> Literal:
        """The numbers of a target."""
        parts = self._parts(first, last)
        groups = [numbers_in(self.text, *part) for part in parts]
        sizes = [0 if group is None else len(group) for group in groups]
        expected = [3, 4, 4, 6] if pose else [6, 6]
        if sizes != expected:
            return Literal(line, name, problem="is computed at run time", start=first)
        numbers = [group for group in groups if group is not None]
        if pose:
            size = float(np.linalg.norm([one.value for one in numbers[1]]))
            problem = "" if abs(size - 1) < UNIT else "its quaternion has not the length 1"
            branch = dict(zip(("cf1", "cf4", "cf6", "cfx"), numbers[2], strict=True))
            whole = (*numbers[0], *numbers[1])
            return Literal(line, name, pose=whole, branch=branch, problem=problem, start=first)
        joints = {
            axis.place: numbers[1 if axis.external else 0][axis.number - 1] for axis in self.axes
        }
        return Literal(line, name, joints=joints, start=first)

    def _parts(self, first: int, last: int) -> list[tuple[int, int]]:
        """Parts of a value in brackets; empty of any other value."""
        if first >= last or self.clean[first] != "[":
            return []
        if closing(self.clean, first, last) != last - 1:
            return []
        return pieces(self.clean, first + 1, last - 1)

    def _frame(self, name: str, first: int, last: int, tool: bool) -> Frame:
        """The frame of a tool or a work object."""
        parts = self._parts(first, last)
        words = [self.clean[start:end] for start, end in parts]
        why = f"{'tool' if tool else 'work object'} {name} is computed at run time"
        if tool and len(parts) == 3:
            if words[0] != "TRUE":
                return f"tool {name} stands still (robhold is FALSE)"
            return self._pose_of(*parts[1], why)
        if not tool and len(parts) == 5:
            if words[0] != "FALSE":
                return f"the robot holds work object {name} (robhold is TRUE)"
            if words[1] != "TRUE":
                return f"work object {name} is moved by a mechanical unit (ufprog is FALSE)"
            user, own = self._pose_of(*parts[3], why), self._pose_of(*parts[4], why)
            return why if isinstance(user, str) or isinstance(own, str) else user @ own
        return why

    def _pose_of(self, first: int, last: int, why: str) -> Frame:
        """The transform of position and quaternion in brackets."""
        groups = [numbers_in(self.text, *part) for part in self._parts(first, last)]
        found = [group for group in groups if group is not None]
        if [len(group) for group in found] != [3, 4]:
            return why
        values = [[one.value for one in group] for group in found]
        if abs(float(np.linalg.norm(values[1])) - 1) > UNIT:
            return f"{why.split(' is ')[0]} has a quaternion that has not the length 1"
        return of_quaternion(*values)

    def _frame_change(self, start: int, end: int) -> None:
        """A tool or work object that gets another value, or a displacement of all targets."""
        found = ASSIGNED.match(self.clean, start, end)
        if found is not None and found[1] in self.data:
            line = self.line(found.start(1))
            self.data[found[1]] = f"line {line} changes {found[1]} at run time"
        shift = SHIFTS.search(self.clean, start, end)
        if shift is not None:
            line = self.line(shift.start())
            self.shifted = f"line {line} displaces all targets ({shift[1]})"

    def _statement(self, start: int, end: int, routine: Routine) -> None:
        """A move, an assignment, or anything else that names a target."""
        word = WORD.search(self.clean, start, end)
        if word is None:
            return
        line = self.line(word.start())
        found = ASSIGNED.match(self.clean, start, end)
        if word[0] == "IF" and (move := INNER_MOVE.search(self.clean, start, end)):
            self.note(line, word.end(), move.start())
            word = move
        if MOVE.fullmatch(word[0]):
            self._move(line, word.start(), word.end(), end, word[0], routine)
            return
        if found is not None:
            self.reading.changed.setdefault(found[1], line)
            start = found.end()
        self.note(line, start, end)

    def _move(self, line: int, at: int, start: int, end: int, word: str, routine: Routine) -> None:
        """The targets of a move."""
        parts = pieces(self.clean, start, end)
        if parts and self.clean[slice(*parts[0])].startswith("\\"):
            parts = parts[1:]
        count = 2 if word.startswith(("MOVEC", "TRIGGC", "ARCC")) else 1
        use = Use(line, at, routine, self._stated(parts[count:]))
        for first, last in parts[:count]:
            part = self.clean[first:last]
            name = part.partition("\\")[0].strip()
            if part.startswith("["):
                end_of = first + len(name)
                literal = self._literal(line, "", first, end_of, "ABSJ" not in word)
                self.reading.literals.append(literal)
                self.reading.own[first] = use
            elif re.fullmatch(r"\w+", name):
                self.reading.use(name, use)
                self.note(line, first + len(part.partition("\\")[0]), last)
            else:
                self.reading.left.append(Left(line, "is computed at run time"))
                self.note(line, first, last)
        for first, last in parts[count:]:
            self.note(line, first, last)

    def _stated(self, parts: Sequence[tuple[int, int]]) -> tuple[Frame, Frame]:
        """Tool and work object of a move."""
        words = [self.clean[start:end] for start, end in parts]
        if self.shifted:
            return self.shifted, self.shifted
        wobj = next((found for word in words if (found := WOBJ.search(word))), None)
        name = "WOBJ0" if wobj is None else wobj[1]
        base = self.data[name] if name in self.data else self.frames.base(name)
        names = [word.partition("\\")[0].strip() for word in words]
        carries = [one for one, word in zip(names, words, strict=True) if "WOBJ" in word]
        named = [one for one in names if re.fullmatch(r"[A-Z]\w*", one)]
        known = [one for one in named if one in self.tools or self._is_tool(one)]
        tool = next(iter([*known, *carries, *named[-1:]]), "")
        stated = self.data[tool] if tool in self.data else self.frames.tool(tool)
        return stated, base

    def _is_tool(self, name: str) -> bool:
        """Whether the study knows a tool of that name."""
        return not isinstance(self.frames.tool(name), str)
