"""Shares of sheets whose fault is found and named, and the targets that they miss."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from fault_answers import Judged
from faults import FAULTS, Fault

from edtk.system.typing import Array

GOOD = FAULTS[0]
EXPERIMENTS = 12
REFERENCE = "KR 270, 2500 N"  # the robot whose detection before causes were named is known
PLANS = ("optimal", "random")

# What is asked. Shares in percent.
MOST_FALSE = 2.0  # good sheets in which a cause is named
MOST_ALARMS = 3.0  # good sheets with p < 0.01
LEAST_RIGHT = 80.0  # detected faults whose cause is named first
LEAST_DETECTED = 5  # sheets of which a share named is worth anything
ERRORS = 2.0  # standard errors by which a share may miss, as it is one of so many sets


@dataclass(frozen=True)
class Cell:
    """A place of the tables.

    Attributes:
        robot: Name of the robot.
        fault: Number of the fault.
        poses: Poses (p, n) of the plan; None for random ones, new ones for each sheet.
        size: Number of experiments.
        repeats: How often each is measured.
    """

    robot: str
    fault: int
    poses: Array | None
    size: int
    repeats: int


@dataclass(frozen=True)
class Shares:
    """Shares of sheets [%] in one place of the tables.

    Attributes:
        sets: Number of sheets.
        detected: Whose verdict is not good.
        right: Of the detected ones, those whose cause is named first; NaN if none was detected.
        wrong: In which another cause is named first.
        joint: Of those named right, those whose joint is named too.
        unlikely: Whose residuals have p < 0.01.
        among: Of the detected ones, those whose cause is named first or second; NaN if none was
            detected.
    """

    sets: int
    detected: float
    right: float
    wrong: float
    joint: float
    unlikely: float
    among: float

    @classmethod
    def of(cls, sheets: Sequence[Judged]) -> "Shares":
        """Count."""
        found = [sheet for sheet in sheets if sheet.detected]
        right = [sheet for sheet in found if sheet.right]
        return cls(
            sets=len(sheets),
            detected=_percent(len(found), len(sheets)),
            right=_percent(len(right), len(found)),
            wrong=_percent(sum(sheet.wrong for sheet in sheets), len(sheets)),
            joint=_percent(sum(sheet.joint for sheet in right), len(right)),
            unlikely=_percent(sum(sheet.unlikely for sheet in sheets), len(sheets)),
            among=_percent(sum(sheet.among for sheet in found), len(found)),
        )


def _percent(part: int, whole: int) -> float:
    """A share [%]; NaN of nothing."""
    return 100 * part / whole if whole else float("nan")


def misses(table: Sequence[tuple[Cell, Shares]]) -> list[tuple[str, ...]]:
    """Places that miss a target by more than chance: where, what is asked, what is."""
    found = []
    for cell, shares in table:
        fault = FAULTS[cell.fault]
        known = cell.robot == REFERENCE
        enough = shares.sets * shares.detected >= 100 * LEAST_DETECTED
        asked = [
            ("cause named in good data", shares.wrong, MOST_FALSE, fault is GOOD),
            ("p < 0.01 in good data", shares.unlikely, MOST_ALARMS, fault is GOOD),
            (
                "named first, of detected",
                -shares.right,
                -LEAST_RIGHT,
                fault.cause_is_seen and enough,
            ),
            ("detected", -shares.detected, -today(cell, fault), cell.repeats == 1 and known),
        ]
        for what, value, most, applies in asked:
            share = abs(most) / 100
            count = max(shares.sets * (shares.detected / 100 if "of detected" in what else 1), 1)
            slack = ERRORS * 100 * np.sqrt(share * (1 - share) / count)
            if applies and value > most + slack:
                found.append((*where(cell), what, f"{abs(most):.0f} %", f"{abs(value):.0f} %"))
    return found


def false_alarms(table: Sequence[tuple[Cell, Shares]]) -> float:
    """Share of good sheets [%], over all places, whose verdict is not good."""
    good = [shares for cell, shares in table if FAULTS[cell.fault] is GOOD]
    return sum(one.sets * one.detected for one in good) / sum(one.sets for one in good)


def today(cell: Cell, fault: Fault) -> float:
    """Detection before causes were named [%]; zero where it is not known."""
    words = fault.today.split(" / ")
    word = words[cell.poses is None] if len(words) == len(PLANS) else "-"
    return float(word) if word != "-" else 0.0


def where(cell: Cell) -> tuple[str, str, str]:
    """Robot, fault and plan in words."""
    kind = "random" if cell.poses is None else "optimal"
    times = "once" if cell.repeats == 1 else f"{cell.repeats} times"
    return cell.robot, FAULTS[cell.fault].title, f"{kind} {cell.size}, {times}"
