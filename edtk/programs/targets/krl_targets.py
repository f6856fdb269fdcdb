"""Targets of KUKA programs: E6AXIS and E6POS literals in .src and .dat files."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from edtk.programs.program import Axis
from edtk.programs.targets.brand import Brand, before_last, of_rpy, rpy_of, signed
from edtk.programs.targets.reading import (
    WORD,
    Frame,
    Frames,
    Left,
    Literal,
    Number,
    Opened,
    Parser,
    Reading,
    Routine,
    Use,
    blanked,
    capitals,
    closing,
    lines_of,
    number_at,
    pieces,
)
from edtk.robots.inverse import Posture
from edtk.system.typing import Array

HIDDEN = re.compile(r'"[^"\r\n]*"|;[^\r\n]*|(?m:^[ \t]*&[^\r\n]*)')
FIRST = re.compile(r"\s*(?:GLOBAL\s+)?([A-Z_$][\w$]*)")
OPENS = {"IF": "a conditional", "SWITCH": "a conditional"} | dict.fromkeys(
    ("FOR", "WHILE", "REPEAT", "LOOP"), "a loop"
)
CLOSES = ("ENDIF", "ENDSWITCH", "ENDFOR", "ENDWHILE", "UNTIL", "ENDLOOP")
MOTIONS = ("PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC", "SPL", "ASYPTP")
TWO_POINTS = ("CIRC", "SCIRC")
RELATIVE = re.compile(r"S?(?:PTP|LIN|CIRC)_REL|SPL_REL")
SET = re.compile(r"\s*((?:[A-Z]\w*\s+)*)([A-Z_$][\w$]*(?:\[[^\]]*\])?)((?:\.\w+)*)\s*=(?!=)")
BAS = re.compile(r"\s*BAS\s*\(\s*#(TOOL|BASE)\s*,\s*(\d+)\s*\)")
LABEL = re.compile(r"\s*(\w+)\s*:\s*$")
# What follows the last point of a motion; of approximations there are two at most.
TAIL = re.compile(r"(?<!\s)\s++(?:C_\w++|WITH\b.*+)(?:\s++C_\w++){0,3}+\s*+$")
TYPES = ("E6POS", "POS", "E6AXIS", "AXIS")
TOOLS = ("TOOL_DATA", "BASE_DATA", "$TOOL", "$BASE")
POSE = ("X", "Y", "Z", "A", "B", "C")
BITS = 6


class KrlTargets(Brand):
    """KRL."""

    title = "KUKA KRL"
    suffixes = (".src", ".dat")
    content = re.compile(r"^[^\S\n]*+(?:GLOBAL\s++|PUBLIC\s++)*+DEF(?:DAT|FCT)?\s", re.I | re.M)
    expected = "a DEF or a DEFDAT"
    joint_decimals: ClassVar[int] = 4

    def read(
        self, text: str, axes: Sequence[Axis], frames: Frames, beside: Mapping[str, str]
    ) -> Reading:
        """Find literals of this file; motions in the .src file beside a .dat file count, too."""
        parsers = [_Parser(text, axes, frames)]
        parsers += [_Parser(other, axes, frames, name) for name, other in beside.items()]
        types: dict[str, str] = {}
        for parser in parsers:
            parser.collect(types)
        frame_values = {name: one for parser in parsers for name, one in parser.values.items()}
        fdat = {name: one for parser in parsers for name, one in parser.fdat.items()}
        for parser in parsers:
            parser.fdat = fdat
            parser.resolve(types, frame_values)
        reading = parsers[0].reading
        for parser in parsers[1:]:
            _join(reading, parser)
        reading.first = parsers[0].first()
        used = set(reading.uses)
        reading.literals = [
            one
            for one in reading.literals
            if not one.name or one.name in used or types.get(one.name) in TYPES or one.branch
        ]
        literals = {one.name for one in reading.literals}
        for parser in parsers:
            parser.compute(literals, reading)
        return reading

    def place(self, numbers: Sequence[float]) -> Array:
        """X, Y, Z [mm] and A, B, C [deg]: turns about z, the new y and the new x."""
        return of_rpy(numbers[:3], numbers[:2:-1])

    def numbers(self, place: Array, near: Sequence[float]) -> tuple[float, ...]:
        """X, Y, Z, A, B, C."""
        roll, pitch, yaw = rpy_of(place, near[5])
        x, y, z = (1e3 * place[:3, 3]).tolist()
        return (x, y, z, yaw, pitch, roll)

    def pins(self, literal: Literal) -> bool:
        """Whether status and turn are stated."""
        return len(literal.branch) > 1

    def fits(self, literal: Literal, posture: Posture | None, shown: Array) -> bool:
        """Status S and turn T: bits of the signs of axes, and on which side wrist and elbow are."""
        turn = literal.branch.get("T")
        if turn is not None:
            bits = int(turn.value)
            if not all(signed(x, bool(bits >> j & 1)) for j, x in enumerate(shown[:BITS])):
                return False
        status = literal.branch.get("S")
        if status is None or posture is None:
            return True
        bits = int(status.value)
        sides = (posture.ahead, posture.elbow, _turned(shown[4]))
        return all(signed(side, bool(bits >> j & 1)) for j, side in enumerate(sides))

    def branch(self, literal: Literal, posture: Posture | None, shown: Array) -> dict[Number, str]:
        """S and T of the joints, where they are others."""
        if posture is None:
            return {}
        status = _bits((posture.ahead, posture.elbow, _turned(shown[4])))
        bits = {"S": (status, 3), "T": (_bits(shown[:BITS].tolist()), BITS)}
        new = {
            number: int(number.value) >> bits[name][1] << bits[name][1] | bits[name][0]
            for name, number in literal.branch.items()
        }
        return {number: str(one) for number, one in new.items() if one != int(number.value)}

    def marked(self, text: str, words: str, end: str) -> str:
        """A comment before the last END or ENDDAT."""
        return before_last(r"END(?:DAT|FCT)?", text, f"; corrected by {words}{end}")


def _bits(values: Sequence[float]) -> int:
    """A bit for each number that is negative."""
    return sum(1 << j for j, value in enumerate(values) if value < 0)


def _turned(angle: float) -> float:
    """An angle of the fifth axis between -180 and 180 deg, as the status has it."""
    return float(np.mod(angle + np.pi, 2 * np.pi) - np.pi)


def _join(reading: Reading, other: "_Parser") -> None:
    """Add what a file beside it says."""
    own = {one.name for one in reading.literals}
    for name, uses in other.reading.uses.items():
        if name in own:
            reading.uses.setdefault(name, []).extend(uses)
    reading.changed |= other.reading.changed
    reading.known |= {one.name: other.name for one in other.reading.literals if one.name}


@dataclass(eq=False)
class _Parser(Parser):
    """One file, line by line.

    Attributes:
        name: Its name; empty for the file that is corrected.
    """

    name: str = ""
    values: dict[str, Frame] = field(default_factory=dict)
    fdat: dict[str, tuple[str, str]] = field(default_factory=dict)
    words: list[tuple[str, int]] = field(default_factory=list)
    waiting: list[tuple[Routine, int, str, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.clean = capitals(blanked(self.text, HIDDEN))
        self.routines: list[tuple[str, Routine]] = []
        self.calls: list[tuple[Routine, int, str]] = []
        self.routine = self._routine()
        self.open: list[Opened] = []
        self.labels: dict[str, int] = {}
        self.jumps: list[tuple[str, int, int]] = []

    def _routine(self, name: str = "") -> Routine:
        """A routine that begins, see `routines`."""
        routine = self.new_routine()
        self.routines.append((name, routine))
        return routine

    def collect(self, types: dict[str, str]) -> None:
        """Read all lines."""
        for number, at, line in lines_of(self.clean):
            self._line(number, at, line, types)
        self._end_routine()

    def _line(self, number: int, at: int, line: str, types: dict[str, str]) -> None:
        found = FIRST.match(line)
        if found is None:
            return
        word = found[1]
        label = LABEL.fullmatch(line)
        if word in ("DEF", "DEFFCT", "DEFDAT"):
            name = WORD.findall(line.partition("(")[0])[-1]
            self._end_routine(name)
        elif word in CLOSES:
            if self.open:
                self.routine.close(self.open.pop(), at)
        elif word in OPENS:
            self.open.append((at, number, OPENS[word]))
            self._note(number, line[found.end() :])
        elif word == "GOTO":
            self.jumps.append((line[found.end() :].strip(), number, at))
        elif label is not None:
            self.labels[label[1]] = at
        elif RELATIVE.fullmatch(word):
            self.reading.left.append(Left(number, "is relative to the point before it"))
            self._note(number, line[found.end() :])
        elif word in MOTIONS:
            self._motion(number, at, at + found.end(1), at + len(line), word)
        elif (set_ := SET.match(line)) is not None:
            self._set(number, at, line, set_, types)
        else:
            self._other(number, at, line, types)

    def _other(self, number: int, at: int, line: str, types: dict[str, str]) -> None:
        """A call, a declaration without a value, or anything else."""
        bas = BAS.match(line)
        declared = re.match(r"\s*(?:GLOBAL\s+|DECL\s+)*(E6POS|POS|E6AXIS|AXIS|FRAME)\s+(.*)", line)
        if bas is not None:
            which = bas[1].lower()
            frame = self.frames.tool(bas[2]) if which == "tool" else self.frames.base(bas[2])
            self.routine.sets.append((at, which, frame))
        elif declared is not None:
            types |= dict.fromkeys(WORD.findall(declared[2]), declared[1])
        else:
            self.calls.append((self.routine, at, WORD.findall(line)[0]))
            self._note(number, line)

    def _end_routine(self, following: str = "") -> None:
        """Close what is open, turn jumps into blocks, and begin the following routine."""
        for opened in self.open:
            self.routine.close(opened, len(self.text))
        for label, number, at in self.jumps:
            self.routine.jump(number, at, self.labels.get(label, 0))
        self.open, self.jumps, self.labels = [], [], {}
        self.routine = self._routine(following)

    def _note(self, number: int, text: str) -> None:
        """Names that something is computed with."""
        self.words += [(word, number) for word in WORD.findall(text)]

    def _motion(self, number: int, at: int, start: int, end: int, word: str) -> None:
        """Targets of one motion."""
        parts = pieces(self.clean, start, end)
        for first, last in parts[: 1 + (word in TWO_POINTS)]:
            tail = TAIL.search(self.clean[first:last])
            last = first + tail.start() if tail else last
            use = Use(number, first, self.routine)
            part = self.clean[first:last].rstrip()
            if part.startswith("{") and closing(self.clean, first, last) == first + len(part) - 1:
                literal = self._aggregate(number, "", first, first + len(part))
                if literal is None:
                    self.reading.left.append(Left(number, "is no pose and no joints"))
                else:
                    self.reading.literals.append(literal)
                    self.reading.own[first] = use
            elif WORD.fullmatch(part):
                self.reading.use(part, use)
            elif part:
                self.reading.left.append(Left(number, "is computed at run time"))
                self._note(number, part)
        for first, last in parts[1 + (word in TWO_POINTS) :]:
            self._note(number, self.clean[first:last])

    def _set(
        self, number: int, at: int, line: str, found: re.Match[str], types: dict[str, str]
    ) -> None:
        """A value for a variable."""
        name = "".join(found[2].split())
        kind = next((word for word in found[1].split() if word in (*TYPES, "FRAME", "FDAT")), "")
        first = at + found.end() + len(line[found.end() :]) - len(line[found.end() :].lstrip())
        last = at + len(line.rstrip())
        value = self.clean[first:last]
        whole = value.startswith("{") and closing(self.clean, first, last) == last - 1
        if kind:
            types.setdefault(name, kind)
        if name in ("$TOOL", "$BASE") and not found[3]:
            self.waiting.append((self.routine, at, name[1:].lower(), first, last))
        elif name.startswith(TOOLS) or (name == "FDAT_ACT" and not found[3]):
            self._frame_state(at, name, found[3], whole, first, last)
        elif name == "$IPO_MODE" and "#TCP" in value:
            self._external(at)
        elif kind == "FDAT" or "TOOL_NO" in value:
            self.fdat[name] = _numbers_of(value)
        elif whole and not found[3]:
            self._literal(number, name, first, last, types)
        else:
            self.reading.changed.setdefault(name, number)
            self._note(number, value)

    def _literal(
        self, number: int, name: str, first: int, last: int, types: dict[str, str]
    ) -> None:
        """A literal of a variable: joints, a pose, or a frame."""
        literal = self._aggregate(number, name, first, last)
        if literal is None:
            return
        if types.get(name) == "FRAME":
            self.values[name] = self._frame(literal)
        elif not self.text[first + 1 : last].lstrip().upper().startswith("FRAME"):
            self.reading.literals.append(literal)
            self.values.setdefault(name, self._frame(literal))

    def _frame_state(
        self, at: int, name: str, component: str, whole: bool, first: int, last: int
    ) -> None:
        """The table of tools and bases, a component of a frame, or the frames of a taught point."""
        if name == "FDAT_ACT":
            self.waiting.append((self.routine, at, "fdat", first, last))
        elif name in ("$TOOL", "$BASE"):
            which = name[1:].lower()
            self.routine.sets.append((at, which, f"the {which} is computed at run time"))
        elif whole and not component:
            literal = self._aggregate(0, name, first, last)
            if literal is not None:
                self.values[name] = self._frame(literal)
        else:
            which = "tool" if name.startswith("TOOL") else "base"
            self.values[name] = f"the {which} {name} is computed at run time"

    def _external(self, at: int) -> None:
        """The tool stands still, and the robot moves the workpiece."""
        for which in ("tool", "base"):
            self.routine.sets.append((at, which, "the tool stands still ($IPO_MODE is #TCP)"))

    def _frame(self, literal: Literal) -> Frame:
        """The frame that a literal says."""
        if len(literal.pose) < BITS or literal.problem:
            return "the frame is computed at run time"
        return of_rpy(
            [one.value for one in literal.pose[:3]], [one.value for one in literal.pose[:2:-1]]
        )

    def _aggregate(self, number: int, name: str, first: int, last: int) -> Literal | None:
        """Joints or a pose in braces; None of anything else."""
        inside = first + 1
        kind = re.compile(r"\s*\w+\s*:").match(self.clean, inside, last)
        inside = kind.end() if kind else inside
        fields: dict[str, tuple[int, int]] = {}
        for start, end in pieces(self.clean, inside, last - 1):
            key = re.compile(r"\w+").match(self.clean, start, end)
            if key is None:
                return None
            value = start + len(key[0])
            value += len(self.clean[value:end]) - len(self.clean[value:end].lstrip())
            fields[key[0]] = (value, end)
        places = {f"{'' if axis.external else 'A'}{axis.place}": axis.place for axis in self.axes}
        is_joints = any(re.fullmatch(r"A[1-6]", key) for key in fields)
        if not is_joints and not {"X", "Y", "Z"} & set(fields):
            return None
        wanted = tuple(places) if is_joints else POSE
        numbers = {
            key: number_at(self.text, *fields[key]) for key in (*wanted, "S", "T") if key in fields
        }
        problem = ""
        missing = [key for key in wanted if key not in fields]
        computed = [key for key, one in numbers.items() if one is None]
        if computed:
            problem = f"{computed[0]} is computed at run time"
        elif missing:
            problem = f"states no {', '.join(missing)}, which are known at run time alone"
        known = {key: one for key, one in numbers.items() if one is not None}
        whole = not problem
        return Literal(
            line=number,
            name=name,
            joints={places[key]: known[key] for key in wanted} if is_joints and whole else {},
            pose=tuple(known[key] for key in POSE) if not is_joints and whole else (),
            branch={} if is_joints else {key: known[key] for key in ("S", "T") if key in known},
            problem=problem,
            start=first,
        )

    def resolve(self, types: Mapping[str, str], values: Mapping[str, Frame]) -> None:
        """Give names of frames their values, and taught points those of their FDAT."""
        for routine, at, which, first, last in self.waiting:
            if which == "fdat":
                both = self._of_fdat(self.clean[first:last], values)
                for kind, frame in zip(("tool", "base"), both, strict=True):
                    routine.sets.append((at, kind, frame))
            else:
                routine.sets.append((at, which, self._stated(which, first, last, values)))
        self._follow_calls()
        found = []
        for literal in self.reading.literals:
            partner = "F" + literal.name[1:]
            taught = literal.name.startswith("X") and partner in self.fdat
            frames = self._of_fdat(partner, values) if taught else None
            found.append(Literal(**{**vars(literal), "frames": frames}) if frames else literal)
        self.reading.literals = found

    def _follow_calls(self) -> None:
        """Tools and bases that other routines of the file set are not known behind their calls.

        Where routines set them, those that begin with none have the one of their caller.
        """
        setting = {name: {kind for _, kind, _ in one.sets} for name, one in self.routines}
        name_of = {id(one): name for name, one in self.routines}
        calls = [call for call in self.calls if call[2] in setting]
        callers: dict[str, set[str]] = {}
        for routine, _, name in calls:
            callers.setdefault(name, set()).add(name_of[id(routine)])
        waiting = list(setting)
        while waiting:  # a routine comes again when it sets more: at most once for each kind
            name = waiting.pop()
            for caller in callers.get(name, ()):
                if not setting[name] <= setting[caller]:
                    setting[caller] |= setting[name]
                    waiting.append(caller)
        for routine, at, name in calls:
            kinds = sorted(setting[name])
            routine.sets += [(at, one, f"{name} sets the {one} before it") for one in kinds]
        every = set().union(*setting.values())
        for _, routine in self.routines[2:]:  # the first one is before the first DEF
            routine.first |= {kind: f"the {kind} is that of the calling routine" for kind in every}
        for _, routine in self.routines:
            routine.sets.sort(key=lambda one: one[0])

    def _of_fdat(self, name: str, values: Mapping[str, Frame]) -> tuple[Frame, Frame]:
        """Tool and base of a taught point."""
        if name not in self.fdat:
            why = f"the frames {name} are not known here"
            return why, why
        tool, base = self.fdat[name]
        if base == "TCP":
            why = "the tool stands still (IPO_FRAME is #TCP)"
            return why, why
        return (
            values.get(f"TOOL_DATA[{tool}]", self.frames.tool(tool)),
            values.get(f"BASE_DATA[{base}]", self.frames.base(base)),
        )

    def _stated(self, which: str, first: int, last: int, values: Mapping[str, Frame]) -> Frame:
        """The frame of a value that the program gives $TOOL or $BASE."""
        name = "".join(self.clean[first:last].split())
        if name.startswith("{"):
            literal = self._aggregate(0, "", first, last)
            return "the frame is computed" if literal is None else self._frame(literal)
        if name in values:
            return values[name]
        if not WORD.fullmatch(name):
            return f"the {which} is computed at run time"
        return self.frames.tool(name) if which == "tool" else self.frames.base(name)

    def compute(self, literals: set[str], reading: Reading) -> None:
        """Note which literals something is computed with."""
        for word, number in self.words:
            if word in literals:
                reading.computed.setdefault(word, number)


def _numbers_of(value: str) -> tuple[str, str]:
    """Numbers of tool and base of an FDAT; "TCP" for the base of a tool that stands still."""
    tool = re.search(r"TOOL_NO\s+(\d+)", value)
    base = re.search(r"BASE_NO\s+(\d+)", value)
    still = re.search(r"IPO_FRAME\s+#TCP", value)
    return (tool[1] if tool else "0", "TCP" if still else base[1] if base else "0")
