"""Plans that are carried out: in a cell, as a day with the clock, and as a robot's program."""

import numpy as np

from edtk.calibration.robot_program import WrittenProgram, load_in_words
from edtk.calibration.timetable import Day, Step
from edtk.cell.plan_check import PlanCheck
from edtk.cell.ways import Leg
from edtk.measure.pose_table import wrench_in_file_units
from edtk.programs.program import Dwell, Wait
from edtk.report.tables import text_table
from edtk.robots.frames import MM
from edtk.robots.joint import UNITS
from edtk.robots.robot import Robot
from edtk.study.tables_of_measurement import SPEED_DEG, SPEED_MM
from edtk.system.typing import Array

MOST_NAMED = 5  # legs without a free way that are named one by one
MINUTE, HOUR = 60, 3600  # [s]
SEVERAL = {"warm-up": "warm-ups", "visit": "visits", "load change": "load changes"}
CONVERTED = 1e-9  # [deg or mm]: below that it is the conversion to SI units and back


def day_text(result: Day) -> str:
    """What the day is made of, and a line for each step."""
    return "\n".join([*day_lines(result), text_table(*_steps(result))])


def day_lines(day: Day) -> list[str]:
    """How long the day takes, and whether its ways are free."""
    if not day.is_timed:
        visits = sum(step.what == "visit" for step in day.steps)
        driving = f"the arm drives for {in_words(day.driving)} in {visits} visits"
        return [f"{driving}, at {_default_speeds(day.robot)}", *_ways(day)]
    parts = [f"{in_words(day.driving)} of driving"]
    for what, several in SEVERAL.items():
        own = [step for step in day.steps if step.what == what]
        if own:
            stay = own[0].end - own[0].start - own[0].driving
            many = len(own) > 1
            number = f"{len(own)} {several}" if many else f"a {what}"
            parts.append(f"{number} of {in_words(stay)}{' each' if many else ''}")
    lines = [f"the day takes {in_words(day.seconds)}: {', '.join(parts)}"]
    return [*lines, *_ways(day)] if day.in_a_cell else lines


def _default_speeds(robot: Robot) -> str:
    """How fast joints are where a study does not say it."""
    kinds = {joint.kind for joint in robot.joints}
    speeds = {"revolute": f"{SPEED_DEG:g} deg/s", "prismatic": f"{SPEED_MM:g} mm/s"}
    own = " and ".join(speed for kind, speed in speeds.items() if kind in kinds)
    return f"the default speed of {own}"


def _ways(day: Day) -> list[str]:
    """How near bodies come on the ways, and the legs without a free way."""
    ways = [step.way for step in day.steps if step.way is not None]
    lines = []
    if ways:
        by = sum(len(way.via) > 0 for way in ways)
        all_of = "all" if not day.blocked else "other"
        told = f"{all_of} ways are free, {by} of {len(ways)} by via poses"
        least = min((leg for way in ways for leg in way.legs), key=lambda leg: leg.clearance)
        bodies = " - ".join(least.pair or ())
        told += f"; least clearance {1e3 * least.clearance:.1f} mm, {bodies}" if bodies else ""
        lines.append(told)
    lines += blocked_in_words(day)
    return lines


def blocked_in_words(day: Day) -> list[str]:
    """A line on poses in which something touches, and one for each leg without a free way."""
    touching = sorted({_place(step) for step in day.steps if step.touches})
    lines = []
    if touching:
        lines.append(f"no way leads to where something touches: {', '.join(touching)}")
    legs = {}
    for before, step in zip((None, *day.steps[:-1]), day.steps, strict=True):
        leg = step.blocked
        if leg is None or step.touches or (before is not None and before.touches):
            continue
        ends = ("home" if before is None else _place(before), _place(step))
        found = f"its direct leg {leg.verdict}" + (f", {nearest(leg)}" if leg.pair else "")
        legs[tuple(sorted(ends))] = f"no free way was found from {ends[0]} to {ends[1]}: {found}"
    named = list(legs.values())
    more = len(named) - MOST_NAMED
    lines += named[:MOST_NAMED]
    return lines if more <= 0 else [*lines, f"and {more} more legs without a free way"]


def _place(step: Step) -> str:
    """Where a step is, in words."""
    return "home" if step.row is None else f"row {step.row + 1} of the plan"


def nearest(leg: Leg) -> str:
    """The least clearance of a leg, and between which bodies."""
    bodies = " - ".join(leg.pair or ())
    return f"clearance {1e3 * leg.clearance:.1f} mm at {100 * leg.t:.0f} % of it, {bodies}"


def _steps(day: Day) -> tuple[list[str], list[list[str]]]:
    """Header and rows: when each step begins, what it is, and how the arm gets there."""
    header = ["", "step", "visit", "plan row", "load", "driving [s]"]
    header += ["via poses", "clearance [mm]", "nearest"] if day.in_a_cell else []
    rows = []
    for step in day.steps:
        row = [
            clock(step.start),
            step.what,
            "" if step.visit is None else str(step.visit),
            "" if step.row is None else str(step.row + 1),
            load_in_words(_in_file_units(step.load)),
            f"{step.driving:.1f}",
        ]
        if day.in_a_cell:
            leg = step.nearest
            row += [
                "none found" if step.blocked is not None else str(step.via),
                "" if leg is None else f"{1e3 * leg.clearance:.1f}",
                "" if leg is None else " - ".join(leg.pair or ()),
            ]
        rows.append(row)
    return header, rows


def _in_file_units(wrench: Array) -> Array:
    return np.asarray(wrench_in_file_units(wrench[None])[0])


def clock(seconds: float) -> str:
    """Such as "1:05:30"."""
    whole = round(seconds)
    return f"{whole // HOUR}:{whole % HOUR // MINUTE:02d}:{whole % MINUTE:02d}"


def in_words(seconds: float) -> str:
    """Such as "1 h 5 min", "3.2 min" or "20 s"."""
    if seconds < 2 * MINUTE:
        return f"{seconds:.3g} s"
    if seconds < HOUR:
        return f"{seconds / MINUTE:.1f} min"
    minutes = round(seconds / MINUTE)
    return f"{minutes // MINUTE} h {minutes % MINUTE} min"


def plan_check_text(found: PlanCheck) -> str:
    """What was looked at, and a line for each pose and each way."""
    lines = [
        "; ".join([found.headline(), *plan_check_notes(found)]),
        text_table(*plan_check_rows(found)),
    ]
    if found.ways:
        lines += ["", text_table(*way_rows(found))]
    return "\n".join(lines)


def plan_check_notes(found: PlanCheck) -> list[str]:
    """Number of bodies and pairs, and the margin; nothing without a cell."""
    cell = found.cell
    if cell is None:
        return []
    defaults = sum(body.source == "default" for body in cell.bodies)
    typical = f" ({defaults} of them with typical sizes, not measured)" if defaults else ""
    return [
        f"{len(cell.bodies)} bodies{typical}, {len(cell.pairs)} pairs, "
        f"margin {cell.margin * MM:g} mm"
    ]


def plan_check_rows(found: PlanCheck) -> tuple[list[str], list[list[str]]]:
    """Header and rows: pose, clearance beyond the margin, what is nearest, and what is seen."""
    header = ["pose"]
    rows = [[str(i + 1)] for i in range(len(found.q))]
    if found.cell is not None:
        header += ["clearance_mm", "", "nearest"]
        clearance = found.clearance
        for i, (room, free) in enumerate(zip(clearance.least, clearance.free, strict=True)):
            pair = " - ".join(clearance.names(i) or ("nothing to look at",))
            millimetres = f"{room * MM:.1f}" if np.isfinite(room) else ""
            rows[i] += [millimetres, "free" if free else "touches", pair]
    if found.seen is not None:
        header.append("seen")
        rows = [[*row, found.seen.words(i)] for i, row in enumerate(rows)]
    return header, rows


def way_rows(found: PlanCheck) -> tuple[list[str], list[list[str]]]:
    """Header and rows: from where to where, whether it is free, and what is nearest on it."""
    rows = []
    for one in found.ways:
        start, end = ("home" if row is None else str(row + 1) for row in one.rows)
        leg = one.nearest
        by = 0 if one.way is None else len(one.way.via)
        verdict = "no free way found" if one.way is None else "free"
        if by:
            verdict = f"free by {by} via pose{'s' if by > 1 else ''}"
        room = f"{leg.clearance * MM:.1f}" if np.isfinite(leg.clearance) else ""
        pair = " - ".join(leg.pair or ("nothing to look at",))
        rows.append([f"{start} to {end}", room, verdict, pair])
    return ["leg", "clearance_mm", "", "nearest"], rows


def written_program_rows(found: WrittenProgram) -> tuple[list[str], list[tuple[str, str]]]:
    """Header and rows: what and how."""
    program = found.program
    axes = ", ".join(f"{axis.joint} = {axis.place}" for axis in program.axes)
    dwells = {step.seconds for step in program.steps if isinstance(step, Dwell)}
    rest = f"{max(dwells):g} s of rest before a reading" if dwells else "no rest before a reading"
    waits = [step for step in program.steps if isinstance(step, Wait)]
    asks = [step.signals for step in waits if step.signals is not None]
    read = "an operator starts the program again after each reading"
    if asks:
        read = f"output {asks[0][0]} asks for each reading, input {asks[0][1]} answers"
    homes = [move for move in program.moves if move.purpose == "home"]
    vias = sum(move.purpose == "via" for move in program.moves)
    return ["what", "how"], [
        ("files", ", ".join(found.files)),
        ("rows of the sheet", f"{found.rows}, in {found.visits} visits of {found.poses} poses"),
        ("axes", axes),
        ("moves", f"in step, at {program.speed_percent:g} % of the joints' speed, {rest}"),
        ("readings", read),
        ("home", "at both ends" if homes else "none: the first move begins where the arm stands"),
        ("via poses", f"{vias}" if vias else "none"),
        ("as rounded", _as_rounded(found)),
    ]


def _as_rounded(found: WrittenProgram) -> str:
    """What rounding does to the plan."""
    kinds = {axis.kind for axis in found.program.axes}
    units = " or ".join(UNITS[kind] for kind in sorted(kinds, reverse=True))
    change = (
        f"by {found.rounding:.1g} {units} at most" if found.rounding > CONVERTED else "no change"
    )
    if found.efficiency is None:
        return f"{change}; {found.criterion} is not known of this plan"
    return f"{change}; {100 * found.efficiency:.4f} % of the plan's efficiency by {found.criterion}"


def written_program_text(found: WrittenProgram) -> str:
    """A line for each fact."""
    _, facts = written_program_rows(found)
    width = max(len(what) for what, _ in facts)
    return "\n".join([found.headline(), *(f"  {what:{width}}  {how}" for what, how in facts)])
