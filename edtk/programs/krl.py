"""Programs of KUKA controllers: a .src file with the steps, a .dat file with the poses."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

from edtk.programs.program import Comment, Dwell, Move, Program, Step, Wait, said
from edtk.programs.writer import LINE, Writer, folded, register

HEADER = ("&ACCESS RVP", "&REL 1")
WORDS = """
    and anin anout b_and b_exor b_not b_or bas bool brake case cast_from cast_to char circ circ_rel
    const continue copen cread cwrite decl def defdat deffct default delay digin do else end enddat
    endfct endfor endif endloop endspline endswitch endwhile enum exit exor ext extfct false for
    frame global goto halt if import in int interrupt is joint lin lin_rel loop maximum minimum not
    off on or out pos ptp ptp_rel public pulse real repeat resume return sec sig signal slin spline
    sptp sread struc swrite switch then to trigger true until wait when while with
"""


@register
class Krl(Writer):
    """KRL: joint moves to E6AXIS variables, of which the .dat file has the angles."""

    name = "krl"
    title = "KUKA KRL"
    suffixes = (".src", ".dat")
    longest_name = 24
    keywords: ClassVar[frozenset[str]] = frozenset(WORDS.split())
    signal = r"[1-9]\d{0,3}"
    signal_words = "a number from 1 to 9999, as of $OUT and $IN"

    def write(self, program: Program) -> Mapping[str, str]:
        """The text of both files."""
        return {".src": _steps(program), ".dat": _poses(program)}


def _steps(program: Program) -> str:
    lines = [*HEADER, f"DEF {program.name} ( )"]
    lines += [f"  ; {line}" for text in program.heading for line in folded(text, LINE)]
    lines += ["  BAS (#INITMOV,0 )", f"  BAS (#VEL_PTP,{program.speed_percent:g} )"]
    lines += [f"  {line}" for step in program.steps for line in _lines(program, step)]
    return "\n".join([*lines, "END", ""])


def _lines(program: Program, step: Step) -> Iterator[str]:
    """The lines of one step."""
    match step:
        case Comment(text):
            yield from (f"; {line}" for line in folded(text, LINE))
        case Move(target, rows):
            if rows is not None:
                yield f"; {said(rows)}"
            yield f"PTP X_{program.targets[target].upper()}"
        case Dwell(seconds):
            yield f"WAIT SEC {seconds:.3f}"
        case Wait(message, None):
            # The pendant shows the lines around the one at which the program stands.
            yield from (f"; {line}" for line in folded(message, LINE))
            yield "HALT"
        case Wait(message, (output, done)):
            yield from (f"; {line}" for line in folded(message, LINE))
            yield f"$OUT[{output}]=TRUE"
            yield f"WAIT FOR $IN[{done}]"
            yield f"$OUT[{output}]=FALSE"
            yield f"WAIT FOR NOT $IN[{done}]"


def _poses(program: Program) -> str:
    """Values of the axes, degrees of joints that turn and millimetres of those that slide."""
    places = [f"{'' if axis.external else 'A'}{axis.place}" for axis in program.axes]
    lines = [*HEADER, f"DEFDAT {program.name}", "  EXT BAS (BAS_COMMAND :IN,REAL :IN )"]
    for target, name in program.targets.items():
        pairs = zip(places, target, strict=True)
        values = ",".join(f"{place} {value:.3f}" for place, value in sorted(pairs))
        lines.append(f"  DECL E6AXIS X_{name.upper()}={{{values}}}")
    return "\n".join([*lines, "ENDDAT", ""])
