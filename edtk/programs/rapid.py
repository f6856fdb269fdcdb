"""Programs of ABB controllers: a module of RAPID."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

from edtk.programs.program import Axis, Comment, Dwell, Move, Program, Step, Wait, said
from edtk.programs.writer import LINE, Writer, folded, plain, register

LONGEST_TEXT = 80  # characters of a text on the pendant
NO_AXIS = "9E+09"  # of an axis beside the robot that is not there
OPENING = "run_"  # of the procedure: a module and a procedure must not have one name
WORDS = """
    alias and backward case connect const default div do else elseif endfor endfunc endif endmodule
    endproc endrecord endtest endtrap endwhile error exit false for from func goto if inout local
    mod module nostepin not noview or pers proc raise readonly record retry return step sysmodule
    test then to trap true trynext undo var viewonly while with xor
"""


@register
class Rapid(Writer):
    """RAPID: MoveAbsJ to a jointtarget for each pose."""

    name = "rapid"
    title = "ABB RAPID"
    suffixes = (".mod",)
    longest_name = 32 - len(OPENING)
    keywords: ClassVar[frozenset[str]] = frozenset(WORDS.split())
    signal = r"[A-Za-z][A-Za-z0-9_]{0,31}"
    signal_words = "the name of a signal, such as do_ready"

    def write(self, program: Program) -> Mapping[str, str]:
        """The text of the module."""
        lines = [f"MODULE {program.name}"]
        lines += [f"  ! {line}" for text in program.heading for line in folded(text, LINE)]
        for target, name in program.targets.items():
            value = _target(program.axes, target)
            lines.append(f"  LOCAL CONST jointtarget {name} := {value};")
        lines += ["", f"  PROC {OPENING}{program.name}()"]
        # Speeds of joint moves are percents of vmax, at which the joints go as fast as they can.
        lines.append(f"    VelSet {program.speed_percent:g}, 5000;")
        lines += [f"    {line}" for step in program.steps for line in _lines(program, step)]
        return {".mod": "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])}


def _target(axes: tuple[Axis, ...], target: tuple[float, ...]) -> str:
    """A jointtarget: six axes of the robot, and six beside it."""
    robot = ["0"] * 6
    beside = [NO_AXIS] * 6
    for axis, value in zip(axes, target, strict=True):
        (beside if axis.external else robot)[axis.number - 1] = f"{value:.3f}"
    return f"[[{','.join(robot)}],[{','.join(beside)}]]"


def _lines(program: Program, step: Step) -> Iterator[str]:
    """The lines of one step."""
    match step:
        case Comment(text):
            yield from (f"! {line}" for line in folded(text, LINE))
        case Move(target, rows):
            if rows is not None:
                yield f"! {said(rows)}"
            yield f"MoveAbsJ {program.targets[target]}\\NoEOffs, vmax, fine, tool0;"
        case Dwell(seconds):
            yield f"WaitTime\\InPos, {seconds:.3f};"
        case Wait(message, None):
            yield from _shown(message)
            yield "Stop;"
        case Wait(message, (output, done)):
            yield from _shown(message)
            yield f"SetDO {output}, 1;"
            yield f"WaitDI {done}, 1;"
            yield f"SetDO {output}, 0;"
            yield f"WaitDI {done}, 0;"


def _shown(message: str) -> Iterator[str]:
    """What the pendant shows; a backslash would begin an escape."""
    for line in folded(message, LONGEST_TEXT):
        text = plain(line, LONGEST_TEXT).replace("\\", "/")
        yield f'TPWrite "{text}";'
