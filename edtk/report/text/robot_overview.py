"""Text of what a robot is for a calibration."""

from edtk.model.robot_overview import NOTHING, RobotOverview
from edtk.model.shown_limit import shown_limits
from edtk.report.text.robot import UNITS
from edtk.report.text_table import text_table
from edtk.tables.pose_table import pose_factors


def robot_overview(found: RobotOverview) -> str:
    """The joints, a line each, and sentences about reach, mass and loads."""
    robot = found.robot
    lines = [robot.name, text_table(*overview_rows(found)), ""]
    lines += [f"{tied.name} {_tie(found, tied.name)}" for tied in robot.tied]
    lines.append(f"reach    {found.reach:.3f} m from the base to the tool point")
    mass = "unknown: the file has no masses" if found.mass is None else f"{_digits(found.mass)} kg"
    lines.append(f"moves    {mass}")
    lines += overview_sentences(found)
    return "\n".join([*lines, *([f"source: {robot.source}"] if robot.source else [])])


def overview_rows(found: RobotOverview) -> tuple[list[str], list[list[str]]]:
    """Header and rows: joint, type, axis, limits, largest levers, own weight and mass.

    The lever is that of a force at the tool point; a joint that slides takes a share of the force.
    """
    robot = found.robot
    header = ["joint", "type", "axis at zero", "limits", "lever of a load", "of a vertical one"]
    factors = pose_factors(robot)
    rows = []
    axes = robot.frames([0.0] * robot.n).axes
    for j, joint in enumerate(robot.joints):
        limits = shown_limits(robot)[j]
        low, high = (f"{limit / factors[j]:g}" for limit in limits.range(joint.limits))
        of = "" if limits.label == joint.name else f" for {limits.label}"
        shown = f"{low} .. {high} {UNITS[joint.kind]}{of}"
        if joint.name in found.open:
            shown = "open"
        elif joint.continuous:
            shown = "none"
        axis = axes[robot.body_names.index(joint.name)]
        kind = "continuous" if joint.continuous else joint.kind
        row = [joint.name, kind, " ".join(f"{x:g}" for x in axis.round(3) + 0.0), shown]
        least = NOTHING * robot.reach
        for lever in (found.lever[j], found.vertical_lever[j]):
            row.append(_lever(lever, joint.kind) if lever > least else "none")
        rows.append(row)
    if found.own_weight is not None:
        header += ["own weight", "mass"]
        masses = dict(zip(robot.body_names, robot.links, strict=True))
        for row, weight, joint in zip(rows, found.own_weight, robot.joints, strict=True):
            unit = "N" if joint.kind == "prismatic" else "N m"
            mass = masses[joint.name].mass
            felt = weight > NOTHING * robot.reach * (found.mass or 0.0)
            row += [f"{_digits(weight)} {unit}" if felt else "none", f"{_digits(mass)} kg"]
    return header, rows


def overview_sentences(found: RobotOverview) -> list[str]:
    """What cannot be identified with which load, and what a study has to give."""
    names = found.robot.joint_names
    lines = []
    vertical = [name for name, x in zip(names, found.not_by_gravity, strict=True) if x]
    if vertical:
        lines.append(
            f"No vertical load turns {_listed(vertical)}: {_whose(vertical)} needs a load of "
            "another direction."
        )
    never = [name for name, x in zip(names, found.unloaded, strict=True) if x]
    if never:
        lines.append(
            f"No load at the tool point turns {_listed(never)}: {_whose(never)} needs a tool point "
            "beside the axis."
        )
    if found.open:
        lines.append(
            f"The file has no limits for {_listed(list(found.open))}; a study gives them in "
            "[joints] limits_deg or limits_mm. The rest holds for a whole turn, or a metre to "
            "either side."
        )
    return lines


def _lever(value: float, kind: str) -> str:
    """The largest load of a joint by a force, over the force."""
    return f"{100 * value:.3g} %" if kind == "prismatic" else f"{1e3 * value:.4g} mm"


def _digits(value: float) -> str:
    """Three digits, or all before the point."""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _tie(found: RobotOverview, name: str) -> str:
    """What a joint that follows does, in the units of people."""
    robot = found.robot
    tied = next(tied for tied in robot.tied if tied.name == name)
    master = robot.joints[robot.joint_names.index(tied.master)]
    unit = {"revolute": 57.29577951308232, "prismatic": 1e3}
    factor = tied.factor * unit[tied.kind] / unit[master.kind]
    offset = tied.offset * unit[tied.kind]
    per = "" if tied.kind == master.kind else f" {UNITS[tied.kind]}/{UNITS[master.kind]}"
    plus = f" {'-' if offset < 0 else '+'} {abs(offset):g} {UNITS[tied.kind]}" if offset else ""
    return f"follows {tied.master}: {factor:g}{per} {tied.master}{plus}"


def _whose(names: list[str]) -> str:
    return "its compliance" if len(names) == 1 else "each of their compliances"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
