"""Robots, what they are for a calibration, and how their controllers count."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.fit.controller.find_controller import FoundController
from edtk.fit.controller.ways_to_count import Counted
from edtk.measure.pose_table import pose_factors
from edtk.report.draw.arm import COLOURS, TRIAD, arm, joint_labels
from edtk.report.figures import BLUE, GREY, ORANGE
from edtk.report.show.page import ShownPage
from edtk.report.show.stage import stage_of_robot
from edtk.report.shown import plain
from edtk.report.tables import text_table
from edtk.robots.compensator import compensator_in_words
from edtk.robots.joint import UNITS
from edtk.robots.robot import Robot, motors_in_words, shown_limits
from edtk.robots.robot_overview import NOTHING, Parts, RobotOverview
from edtk.study.study_toml import inline
from edtk.system.typing import Array

MARGIN = 0.12  # around the arm, over its size
VIEW = (22.0, -58.0)  # elevation and azimuth from which it is seen [deg]
SIZE = (10.0, 5.6)  # [inch]
ROUND = 0.8  # ratio of the ways to both sides from which a reach looks alike from each
ARM = "#30343a"
QUARTER = 90.0  # [deg]
NEAR_QUARTER = 1.0  # [deg]: a zero so near to a quarter turn may be meant as that
MOST_TIMES = 1e6  # that are told; beyond it the best way leaves rounding alone


def robot_text(result: Robot) -> str:
    """A line for each joint."""
    source = f"\nsource: {result.source}" if result.source else ""
    return f"{result.name}\n{text_table(*robot_rows(result))}{source}"


def robot_rows(result: Robot) -> tuple[list[str], list[list[str]]]:
    """Header and rows: joint, kind, limits, axis, and origin relative to the joint before."""
    factors = pose_factors(result)
    rows = []
    for joint, factor, shown in zip(result.joints, factors, shown_limits(result), strict=True):
        low, high = (f"{limit / factor:g}" for limit in shown.range(joint.limits))
        axis = " ".join(f"{component:g}" for component in joint.axis.round(6) + 0.0)
        origin = " ".join(f"{1e3 * length:g}" for length in joint.origin[:3, 3].round(9) + 0.0)
        of = "" if shown.label == joint.name else f" for {shown.label}"
        limits = f"{low} .. {high} {UNITS[joint.kind]}{of}"
        rows.append([joint.name, joint.kind, limits, axis, origin])
    return ["joint", "kind", "limits", "axis", "origin [mm]"], rows


def robot_show(robot: Robot, q: ArrayLike | None = None) -> ShownPage:
    """The robot in some poses.

    Args:
        robot: The robot.
        q: Joint variables (n,) or (m, n) [rad or m]; zero, or the limit that is nearest to it,
            where they are not given.
    """
    given = np.clip(0.0, *robot.hard_limits) if q is None else np.asarray(q, dtype=float)
    return ShownPage(stage_of_robot(robot, np.atleast_2d(given)))


def robot_plot(result: Robot, ax: Any = None, q: ArrayLike | None = None) -> Any:
    """Draw the chain in space, with its joint axes.

    Args:
        result: The robot.
        ax: Axes with a 3D projection; a new figure where they are not given.
        q: Joint variables (n,) [rad or m]; defaults to zero, or the limit that is nearest to it.

    Returns:
        The axes.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(figsize=(6.4, 6.0)).add_subplot(projection="3d")
    variables = np.clip(0.0, *result.limits) if q is None else np.asarray(q, dtype=float)
    frames = result.frames(variables)
    arm(result, frames, ax)
    points = np.vstack([result.base[:3, 3], frames.origins, frames.position])
    fit_axes(points, ax)
    ax.view_init(*VIEW)
    ax.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    ax.set_title(plain(result.name), fontsize=10)
    _quiet(ax)
    _legend(result, ax)
    joint_labels(result, frames, ax)
    return ax


def fit_axes(points: Array, ax: Any) -> None:
    """Equal scales along all axes, and no more room than the arm needs."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    size = max(float((high - low).max()), 1e-3)
    # A flat arm needs some depth too.
    thin = np.maximum(0.0, 0.35 * size - (high - low)) / 2
    low = low - thin - MARGIN * size
    high = high + thin + MARGIN * size
    for limits, first, last in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), low, high, strict=True):
        limits(first, last)
    ax.set_box_aspect(high - low)


def _quiet(ax: Any) -> None:
    """Walls and grid behind the arm, not in front of it."""
    from matplotlib.ticker import MaxNLocator

    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.98, 1.0))
        axis.line.set_color("#b0b4b8")
        axis.set_major_locator(MaxNLocator(4))
    ax.tick_params(labelsize=7)


def _legend(result: Robot, ax: Any) -> None:
    """What each colour is."""
    from matplotlib.lines import Line2D

    kinds = {joint.kind for joint in result.joints}
    entries: dict[str, tuple[str, str]] = {
        kind: ("o" if kind == "revolute" else "s", COLOURS[kind]) for kind in sorted(kinds)
    }
    if result.tied:
        entries["follows another joint"] = ("o", GREY)
    entries |= {f"{name} of the tool": ("_", c) for name, c in zip("xyz", TRIAD, strict=True)}
    entries["tool point"] = ("o", ORANGE)
    handles = [
        Line2D([], [], marker=marker, color=colour, linestyle="", label=label)
        for label, (marker, colour) in entries.items()
    ]
    ax.legend(handles=handles, fontsize=7, frameon=False, loc="upper left")


SOURCES = {"URDF": "URDF", "typed": "the robot's file", "default": "default, about"}
LEVERS = "levers: the largest of a force at the tool point, in any direction and vertical"


def robot_overview_text(found: RobotOverview) -> str:
    """The joints, a line each, and sentences about reach, mass and loads."""
    robot = found.robot
    lines = [robot.name, text_table(*robot_overview_rows(found)), LEVERS, ""]
    lines += motors_in_words(robot)
    lines += [f"{tied.name} {_tie(found, tied.name)}" for tied in robot.tied]
    limits = {joint.name: joint.limits for joint in robot.joints}
    lines += [compensator_in_words(one, limits[one.given.joint]) for one in robot.pulls]
    lines.append(f"reach    {found.reach:.3f} m from the base to the tool point")
    mass = "unknown: the file has no masses" if found.mass is None else f"{_digits(found.mass)} kg"
    lines.append(f"moves    {mass}")
    lines += overview_sentences(found)
    lines += [] if found.parts is None else _parts_in_words(found.parts)
    return "\n".join([*lines, *([f"source: {robot.source}"] if robot.source else [])])


def robot_overview_rows(found: RobotOverview) -> tuple[list[str], list[list[str]]]:
    """Header and rows: joint, type, axis, limits, largest levers, own weight and mass.

    The lever is that of a force at the tool point; a joint that slides takes a share of the force.
    """
    robot = found.robot
    header = ["joint", "type", "axis at zero", "limits", "lever, any load", "vertical load"]
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
        header += ["by own weight", "mass"]
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
    if found.left_out:
        lines.append(
            f"The chain ends before {_listed(list(found.left_out))}: joints of the end effector. "
            "--tip names another end."
        )
    if found.open:
        lines.append(
            f"The file has no limits for {_listed(list(found.open))}; a study gives them in "
            "[joints] limits_deg or limits_mm. The rest holds for a whole turn, or a metre to "
            "either side."
        )
    return lines


def _parts_in_words(parts: Parts) -> list[str]:
    """The bodies, a line each, and the pairs that a cell does not look at."""
    if parts.unknown:
        return [f"bodies   unknown: {parts.unknown}"]
    rows = [
        [
            part.name,
            part.joint or "none: it stands",
            "1 shape" if part.shapes == 1 else f"{part.shapes} shapes",
            SOURCES[part.source],
        ]
        for part in parts.parts
    ]
    lines = ["", text_table(["body", "joint that moves it", "held by", "from"], rows), ""]
    for pairs, words in (
        (parts.adjacent, "a joint connects"),
        (parts.always, "touch in every pose, as their shapes are larger than they"),
        (parts.never, "are near each other, and their meshes never touch"),
    ):
        if pairs:
            listed = "; ".join(f"{first} - {second}" for first, second in pairs)
            lines.append(f"A cell does not look at pairs that {words}: {listed}.")
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
    unit = {"revolute": 57.29577951308232, "prismatic": 1e3}
    parts = []
    for name, factor in tied.follows:
        kind = robot.joints[robot.joint_names.index(name)].kind
        per = "" if tied.kind == kind else f" {UNITS[tied.kind]}/{UNITS[kind]}"
        parts.append(f"{factor * unit[tied.kind] / unit[kind]:g}{per} {name}")
    offset = tied.offset * unit[tied.kind]
    parts += [f"{offset:g} {UNITS[tied.kind]}"] if offset else []
    itself = " themselves" if robot.couplings else ""
    sum_of = " + ".join(parts).replace("+ -", "- ")
    return f"follows {' and '.join(tied.masters)}{itself}: {sum_of}"


def _whose(names: list[str]) -> str:
    return "its compliance" if len(names) == 1 else "each of their compliances"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def robot_overview_plot(found: RobotOverview, ax: Any = None) -> Any:
    """Draw the arm at zero, and in two views the points that its tool point reaches.

    Args:
        found: The robot.
        ax: Axes whose place is divided; a new figure where they are not given.

    Returns:
        The axes: the arm, the view from the side, the view from above.

    Raises:
        ValueError: The axes have no place in a grid that could be divided.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(figsize=SIZE, layout="constrained").subplots()
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("these axes cannot be divided; expected axes that pyplot.subplots made")
    ax.set_axis_off()
    grid = place.subgridspec(2, 2, width_ratios=[1.7, 1.0])
    figure = ax.get_figure()
    space = robot_plot(found.robot, figure.add_subplot(grid[:, 0], projection="3d"))
    space.set_title(plain(found.headline()), fontsize=10)
    side = figure.add_subplot(grid[0, 1])
    above = figure.add_subplot(grid[1, 1])
    points = found.tool_points
    # The side from which the tool point is seen to move more, or else the arm is seen.
    spread = np.ptp(points[:, :2], axis=0)
    if spread.min() > ROUND * spread.max():
        spread = np.ptp(_chain(found.robot)[:, :2], axis=0)
    widest = int(spread.round(6).argmax())
    _view(found, (widest, 2), side)
    _view(found, (0, 1), above)
    side.set(xlabel=f"{'xy'[widest]} [m]", ylabel="z [m]")
    side.set_title("reach from the side and from above")
    side.title.set_fontsize(9)
    above.set(xlabel="x [m]", ylabel="y [m]")
    return np.array([space, side, above])


def _chain(arm: Robot) -> Array:
    """Points (n + 2, 3) from the base to the tool, at zero or the limits nearest to it [m]."""
    frames = arm.frames(np.clip(0.0, *arm.limits))
    return np.vstack([arm.base[:3, 3], frames.origins, frames.position])


def _view(found: RobotOverview, axes: tuple[int, int], ax: Any) -> None:
    """Tool points of all poses as two of the world's axes show them, before them the arm."""
    chain = _chain(found.robot)[:, list(axes)]
    ax.plot(
        *found.tool_points[:, list(axes)].T,
        ".",
        markersize=1.2,
        color=BLUE,
        alpha=0.35,
        rasterized=True,
    )
    ax.plot(*chain.T, color=ARM, linewidth=2.0, marker="o", markersize=3)
    ax.plot(*chain[-1:].T, "o", markersize=4.5, color=ORANGE)
    ax.set_aspect("equal", adjustable="datalim")
    ax.tick_params(labelsize=7)
    ax.grid(alpha=0.25, linewidth=0.5)


UPSIDE_DOWN = np.deg2rad(1.0)


def found_controller_text(found: FoundController) -> str:
    """Fit, a line for each joint, what is not told, and a table to paste."""
    markers = f"{len(found.markers)} marker{'s' if len(found.markers) > 1 else ''}"
    lines = [
        f"{found.robot}: {found.poses} poses, {markers}, {found.coordinates} coordinates, "
        f"{found.unknowns} unknowns",
        f"the best way to count leaves {_mm(found.best.rms)} (root mean square); {_second(found)}",
        text_table(*_rows(found)),
        *(f"{name}: {why}" for name, why in found.untold.items()),
    ]
    if found.same:
        lines.append("the same arm, which no positions tell apart (limits and small zeros chose):")
        lines += [f"  {_difference(one, found.best)}" for one in found.same]
    if found.others:
        lines.append("these ways to count fit nearly as well:")
        lines += [f"  {_difference(one, found.best)}: {_mm(one.rms)}" for one in found.others]
    return "\n".join([*lines, "", *_table(found.best)])


def _second(found: FoundController) -> str:
    """How clear the answer is."""
    if found.second is None:
        return "there is no other"
    clear = "the answer is clear" if found.clear else "that is not clear enough"
    times = found.second.rms / max(found.best.rms, 1e-300)
    more = f", {times:.3g} times as much" if times < MOST_TIMES else ""
    return f"the second best {_mm(found.second.rms)}{more}: {clear}"


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"


def _rows(found: FoundController) -> tuple[list[str], list[list[str]]]:
    """A row for each joint."""
    rows = []
    best = found.best
    for j, name in enumerate(best.names):
        zero = f"{best.zero[j]:g} +- {found.zero_std[j]:.2g}"
        remark = _near(best, j)
        if name in found.untold:
            zero = f"{best.zero[j]:g}"
            remark = "not told, see below"
        unit = "mm" if best.kinds[j] == "prismatic" else "deg"
        rows.append([name, f"{best.way.sign[j]:+g}", f"{zero} {unit}", remark])
    follows = best.way.follows
    if follows is not None:
        rows[follows.joint][3] += (
            f"{', ' if rows[follows.joint][3] else ''}follows {best.names[follows.leader]} with "
            f"factor {follows.factor:g}"
        )
    return ["joint", "sign", "zero", ""], rows


def _near(best: Counted, j: int) -> str:
    """The quarter turn that a zero may be meant as."""
    nearest = QUARTER * round(best.zero[j] / QUARTER)
    off = abs(best.zero[j] - nearest)
    is_near = best.kinds[j] != "prismatic" and 0 < off <= NEAR_QUARTER
    return f"{nearest:g} by the maker?" if is_near else ""


def _difference(one: Counted, best: Counted) -> str:
    """In what a way to count differs from the best one."""
    parts = []
    for j, name in enumerate(best.names):
        signed = one.way.sign[j] != best.way.sign[j]
        moved = one.zero[j] != best.zero[j]
        if signed or moved:
            sign = f"sign {one.way.sign[j]:+g}" if signed else ""
            zero = f"zero {one.zero[j]:g}" if moved else ""
            parts.append(f"{name} {' and '.join(filter(None, (sign, zero)))}")
    if one.way.follows != best.way.follows:
        own = one.way.follows
        names = one.names
        parts.append(
            "no joint follows another"
            if own is None
            else f"{names[own.joint]} follows {names[own.leader]} with factor {own.factor:g}"
        )
    if one.tilt > UPSIDE_DOWN:
        parts.append(f"the base turned over by {np.rad2deg(one.tilt):.3g} deg")
    if one.outside:
        parts.append(f"a joint beyond its limits {one.outside} times")
    return ", ".join(parts)


def _table(best: Counted) -> list[str]:
    """The table to paste."""
    table = best.table()
    if not table:
        return ["the controller counts as the robot's file: no table [controller] is needed"]
    return ["[controller]", *(f"{key} = {inline(value)}" for key, value in table.items())]
