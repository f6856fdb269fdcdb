"""Programs of Universal Robots: a function of URScript."""

from collections.abc import Iterator, Mapping, Sequence
from math import pi
from typing import ClassVar

import numpy as np

from edtk.programs.program import (
    FULL_SPEED,
    Axis,
    Comment,
    Dwell,
    Move,
    Program,
    ProgramError,
    Step,
    Wait,
    said,
)
from edtk.programs.writer import DECIMALS, LINE, Writer, folded, register
from edtk.system.typing import Array

RADIANS = 8  # decimals: they keep each digit of three decimals of a degree
FASTEST = 2 * pi / 3  # [rad/s]: base and shoulder of the larger arms turn 120 degrees a second
ACCELERATION = 1.4  # [rad/s^2], the controller's own default
WORDS = """
    and break continue def elif else end false for global halt if join kill local not or return run
    sec then thread true while xor
"""


@register
class UrScript(Writer):
    """URScript: movej to lists of joint angles in radians."""

    name = "urscript"
    title = "Universal Robots URScript"
    suffixes = (".script",)
    longest_name = 60
    robot_axes = (6, 6)
    external_axes = 0
    keywords: ClassVar[frozenset[str]] = frozenset(WORDS.split())
    signal = r"[0-7]"
    signal_words = "a standard signal from 0 to 7"

    def taken(self, shown: Array, axes: Sequence[Axis]) -> Array:
        """Degrees whose radians have the digits that are written."""
        radians = np.round(np.deg2rad(np.round(shown, DECIMALS)), RADIANS)
        return np.asarray(np.rad2deg(radians) + 0.0)

    def require(self, program: Program) -> None:
        """Check that it is one of six joints that turn, besides what all programs are checked for.

        Raises:
            ProgramError: It is not.
        """
        super().require(program)
        slides = [axis.joint for axis in program.axes if axis.kind != "revolute"]
        if slides:
            raise ProgramError(f"joint {slides[0]} slides; {self.name} takes joints that turn")

    def write(self, program: Program) -> Mapping[str, str]:
        """The text of the function."""
        order = sorted(range(len(program.axes)), key=lambda i: program.axes[i].number)
        lines = [f"# {line}" for text in program.heading for line in folded(text, LINE)]
        lines.append(f"def {program.name}():")
        lines += [f"  {line}" for step in program.steps for line in _lines(program, step, order)]
        return {".script": "\n".join([*lines, "end", ""])}


def _lines(program: Program, step: Step, order: list[int]) -> Iterator[str]:
    """The lines of one step."""
    match step:
        case Comment(text):
            yield from (f"# {line}" for line in folded(text, LINE))
        case Move(target, rows):
            yield f"# {program.targets[target] if rows is None else said(rows)}"
            radians = np.deg2rad([target[i] for i in order])
            values = ", ".join(f"{value + 0.0:.{RADIANS}f}" for value in radians.round(RADIANS))
            speed = FASTEST * program.speed_percent / FULL_SPEED
            yield f"movej([{values}], a={ACCELERATION}, v={speed:.4f})"
        case Dwell(seconds):
            yield f"sleep({seconds:.3f})"
        case Wait(message, None):
            text = " ".join(folded(message, LINE))
            yield f'popup("{text}", title="edtk", warning=False, error=False, blocking=True)'
        case Wait(message, (output, done)):
            yield f'textmsg("{" ".join(folded(message, LINE))}")'
            yield f"set_standard_digital_out({output}, True)"
            yield from _until(done, "False")
            yield f"set_standard_digital_out({output}, False)"
            yield from _until(done, "True")


def _until(done: str, before: str) -> Iterator[str]:
    """Wait while an input is as before."""
    yield f"while (get_standard_digital_in({done}) == {before}):"
    yield "  sync()"
    yield "end"
