"""The steps of a program as a table (CSV), for senders of one's own."""

import csv
import io
from collections.abc import Mapping
from typing import ClassVar

from edtk.programs.program import Comment, Dwell, Move, Program, Step, Wait
from edtk.programs.writer import Writer, register
from edtk.robots.joint import UNITS

MANY = 1000  # axes


@register
class Table(Writer):
    """A row for each step: what kind it is, and what it needs."""

    name = "csv"
    title = "table of steps"
    suffixes = (".csv",)
    longest_name = 60
    robot_axes: ClassVar[tuple[int, int]] = (1, MANY)
    signal = r"[A-Za-z0-9_.\[\]]{1,60}"
    signal_words = "letters, digits and _"

    def write(self, program: Program) -> Mapping[str, str]:
        """The text of the table."""
        axes = [f"{axis.joint}_{UNITS[axis.kind]}" for axis in program.axes]
        out = io.StringIO()
        rows = csv.writer(out, lineterminator="\n")
        columns = ("step", "first_row", "last_row", "speed_percent")
        rows.writerow([*columns, *axes, "seconds", "output", "input", "text"])
        for text in program.heading:
            rows.writerow(_cells(program, Comment(text)))
        for step in program.steps:
            rows.writerow(_cells(program, step))
        return {".csv": out.getvalue()}


def _cells(program: Program, step: Step) -> list[str]:
    """The cells of one step."""
    blank = [""] * len(program.axes)
    match step:
        case Comment(text):
            return ["comment", "", "", "", *blank, "", "", "", text]
        case Move(target, rows, purpose):
            first, last = ("", "") if rows is None else map(str, rows)
            values = [f"{value:.3f}" for value in target]
            return [purpose, first, last, f"{program.speed_percent:g}", *values, "", "", "", ""]
        case Dwell(seconds):
            return ["dwell", "", "", "", *blank, f"{seconds:.3f}", "", "", ""]
        case Wait(message, signals):
            output, done = signals or ("", "")
            return ["wait", "", "", "", *blank, "", output, done, message]
