"""Programs of FANUC controllers: a listing (.ls) with the blocks /PROG, /ATTR, /MN and /POS."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

from edtk.programs.program import Axis, Comment, Dwell, Move, Program, Step, Wait, said
from edtk.programs.writer import Writer, folded, plain, register
from edtk.robots.joint import UNITS

REMARK = 32  # characters of a remark
LONGEST_MESSAGE = 24  # characters of a message
Target = tuple[float, ...]
TITLE = 16  # characters of a comment of the program, or of a pose
ATTRIBUTES = """\
OWNER\t\t= MNEDITOR;
COMMENT\t\t= "{title}";
PROTECT\t\t= READ_WRITE;
TCD:  STACK_SIZE\t= 0,
      TASK_PRIORITY\t= 50,
      TIME_SLICE\t= 0,
      BUSY_LAMP_OFF\t= 0,
      ABORT_REQUEST\t= 0,
      PAUSE_REQUEST\t= 0;
DEFAULT_GROUP\t= 1,*,*,*,*;
CONTROL_CODE\t= 00000000 00000000;"""


@register
class FanucLs(Writer):
    """A FANUC listing: joint moves to positions in joint representation."""

    name = "fanuc_ls"
    title = "FANUC TP listing"
    suffixes = (".ls",)
    longest_name = 36
    external_axes = 3
    keywords: ClassVar[frozenset[str]] = frozenset({"con", "prn", "aux", "nul"})
    signal = r"[1-9]\d{0,3}"
    signal_words = "a number from 1 to 9999, as of DO and DI"
    longest_dwell = 327.67

    def write(self, program: Program) -> Mapping[str, str]:
        """The text of the listing."""
        name = program.name.upper()
        heading = [Comment(text) for text in program.heading]
        steps = (*heading, *program.steps)
        numbers = {target: number for number, target in enumerate(program.targets, 1)}
        lines = [line for step in steps for line in _lines(program, step, numbers)]
        numbered = [f"{number:4d}:{line} ;" for number, line in enumerate(lines, 1)]
        attributes = ATTRIBUTES.format(title="edtk")
        blocks = [f"/PROG  {name}", "/ATTR", attributes, "/MN", *numbered]
        return {".ls": "\n".join([*blocks, "/POS", *_positions(program), "/END", ""])}


def _lines(program: Program, step: Step, numbers: Mapping[Target, int]) -> Iterator[str]:
    """The lines of one step, without number and end; positions have numbers from 1."""
    match step:
        case Comment(text):
            yield from (f"  !{line}" for line in folded(text, REMARK))
        case Move(target, rows):
            if rows is not None:
                yield f"  !{said(rows)}"
            yield f"J P[{numbers[target]}] {max(round(program.speed_percent), 1)}% FINE"
        case Dwell(seconds):
            yield f"  WAIT {seconds:6.2f}(sec)"
        case Wait(message, None):
            yield from (f"  MESSAGE[{line}]" for line in folded(message, LONGEST_MESSAGE))
            yield "  PAUSE"
        case Wait(message, (output, done)):
            yield from (f"  !{line}" for line in folded(message, REMARK))
            yield f"  DO[{output}]=ON"
            yield f"  WAIT DI[{done}]=ON"
            yield f"  DO[{output}]=OFF"
            yield f"  WAIT DI[{done}]=OFF"


def _positions(program: Program) -> Iterator[str]:
    """The positions, in whatever frame and tool are chosen: joint values do not depend on them."""
    for number, (target, name) in enumerate(program.targets.items(), 1):
        yield f'P[{number}:"{plain(name, TITLE)}"]{{'
        yield "   GP1:"
        values = [_value(axis, value) for axis, value in _in_order(program.axes, target)]
        threes = (values[i : i + 3] for i in range(0, len(values), 3))
        yield "\tUF : F, UT : F,"
        yield ",\n".join("\t" + ",\t".join(three) for three in threes)
        yield "};"


def _in_order(axes: tuple[Axis, ...], target: tuple[float, ...]) -> list[tuple[Axis, float]]:
    pairs = zip(axes, target, strict=True)
    return sorted(pairs, key=lambda pair: (pair[0].external, pair[0].number))


def _value(axis: Axis, value: float) -> str:
    """Such as "J1=   -12.345 deg"."""
    place = axis.place if axis.external else f"J{axis.number}"
    return f"{place}= {value:9.3f} {UNITS[axis.kind]}"
