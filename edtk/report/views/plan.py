"""Plans of a study: what they are, what they promise, and how they were found."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.bound import BoundKind, printed_form
from edtk.design.detection import ENOUGH, Detection, Separation
from edtk.design.exact.day import DayPlan, PosesByLoad
from edtk.design.exact.exact_plan import ExactPlan, Placement, TriedPlace
from edtk.design.plan import Plan
from edtk.measure.pose_table import (
    in_file_units,
    pose_columns,
    wrench_columns,
    wrench_in_file_units,
)
from edtk.report.draw.plans import joint_variables
from edtk.report.figures import panels
from edtk.report.show.page import ShownPage
from edtk.report.show.stage import by_travel, shares, stage_of_plan, stage_of_space
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, number_columns
from edtk.report.views.calibration import error_budget
from edtk.report.views.day import day_lines
from edtk.report.views.evaluation import about, load_name, rho0_of_visits, visits_by_load
from edtk.robots.frames import MM
from edtk.robots.robot import Robot
from edtk.robots.workspace import on_limits_in_words
from edtk.study.study import Study
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.calibration.geometry_plan import GeometryPlan

NO_BUDGET = "no error budget: it needs [simulation], and a plan that tells all compliances"
# Guesses at which plans are local: where they stand, and what is other if they are off.
GUESSES = {
    "springs": ("[simulation]", "are {} times as soft"),
    "compensators": ("in the robot", "pull {} times as much"),
}
AS_GOOD = 1e-6  # percent by which two plans differ that are told to be as good
CUT_OFF = 1e-3  # relative gap of a bound beyond which a person is told


def search_summary(starts: int, seconds: float, found: int, optima: int) -> str:
    """Such as "128 starts in 25.2 s ended in 4 different plans, 3 times in this one".

    Args:
        starts: Number of starts.
        seconds: How long the search took [s].
        found: How many of the plans that were refined to the end came out as the best one.
        optima: How many different plans they came out as.
    """
    times = {1: "once", 2: "twice"}.get(found, f"{found} times")
    begun = f"{starts} start{'' if starts == 1 else 's'} in {seconds:.1f} s"
    plans = f"{optima} different plans, {times} in" if optima > 1 else f"one plan, {times}:"
    return f"{begun} ended in {plans} this one"


def shown_faults(
    robot: Robot,
    detections: Sequence[Detection],
    separations: Sequence[Separation],
    unknown: str = "compliances",
) -> list[str]:
    """A line for each fault, and for each two of them, with what would help.

    Args:
        robot: The robot, which says the units of the joints.
        detections: The chances that faults are noticed.
        separations: The chances that they are told apart.
        unknown: What may take up a fault.
    """
    return [
        *(_detection(robot, detection, unknown) for detection in detections),
        *(_separation(robot, separation) for separation in separations),
    ]


def _detection(robot: Robot, found: Detection, unknown: str) -> str:
    """The chance that a fault is noticed, with the experiment that would help."""
    what = _fault(found)
    if found.never:
        return f"{what}: never noticed, {unknown} take it up"
    chance = f"{what}: noticed with {100 * found.power:.0f} %"
    if found.better is None or round(100 * found.power_with) == round(100 * found.power):
        return chance
    pose = ", ".join(f"{x:.2f}" for x in in_file_units(robot, found.better[None])[0])
    return f"{chance}, with one more experiment {100 * found.power_with:.0f} %, at {pose}"


def _fault(found: Detection) -> str:
    """A fault with its joint and size."""
    where = f" of {found.joint}" if found.joint else ""
    return f"{found.fault}{where} {found.size:g} {found.unit}"


def _separation(robot: Robot, found: Separation) -> str:
    """The chance that of two faults the right one is named, and what would help."""
    what = " or ".join(_fault(fault) for fault in found.faults)
    chance = f"{what}: told apart with {100 * found.right:.0f} %"
    if found.right >= ENOUGH:
        return chance
    if found.times is not None:
        chance += f"; {100 * ENOUGH:.0f} % if each experiment is measured {found.times} times"
    if found.better is None:
        return chance
    pose = ", ".join(f"{x:.2f}" for x in in_file_units(robot, found.better[None])[0])
    return f"{chance}; {100 * found.right_with:.0f} % with one more experiment, at {pose}"


def plan_rows(result: Plan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: pose, repetitions, joint variables [rad or m], loads that are not zero."""
    loaded = np.flatnonzero(result.wrench.any(axis=0))
    joints = [f"q{j + 1} [rad or m]" for j in range(result.q.shape[1])]
    header = ["pose", "repeats", *joints, *(wrench_columns(result.wrench)[i] for i in loaded)]
    rows = []
    for i, (q, wrench) in enumerate(zip(result.q, result.wrench, strict=True)):
        variables = [f"{value:.4f}" for value in q]
        loads = [f"{value:g}" for value in wrench_in_file_units(wrench[None])[0][loaded]]
        rows.append([str(i + 1), str(result.repeats[i]), *variables, *loads])
    return header, rows


def plan_plot(result: Plan, ax: Any = None, robot: Robot | None = None) -> Any:
    """Draw the joint variables by pose.

    Args:
        result: The plan.
        ax: Where to draw; a new figure where it is not given.
        robot: Gives joints their names and units; without it they are numbered, in rad or m.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.0, 4.2))[0, 0]
    joint_variables(result, robot, ax)
    ax.set_title(plain(result.headline()), fontsize=10)
    return ax


def plan_show(result: Plan, study: Study) -> ShownPage:
    """The poses of a plan for a study, in the order in which its sheet has them."""
    return ShownPage(stage_of_plan(study, result))


def exact_plan_show(found: ExactPlan) -> ShownPage:
    """The poses, all of them, with the share of the information that hangs on each."""
    space = found.relaxed.space
    plan = by_travel(space.model.robot, found.whole)
    before = 0.0 if space.prior is None else plan.experiments * space.prior
    bare = replace(space, prior=None)
    shade = shares(lambda some: bare.information(some) + before, found.relaxed.criterion, plan)
    return ShownPage(stage_of_space(space, plan, shade))


def exact_plan_text(found: ExactPlan) -> str:
    """Value, bound, how the search went, and the poses."""
    whole = found.whole
    promised = [*_budget(found), *([] if found.expected is None else [str(found.expected)])]
    lines = search_lines(
        found,
        f"{whole.experiments} experiments in {len(whole.q)} poses",
        "the prior tells",
        promised,
        "compliances",
    )
    return "\n".join([*lines, *experiments(found), *on_limits(found)])


def search_lines(
    found: ExactPlan, made: str, known: str, promised: Sequence[str], unknown: str
) -> list[str]:
    """Value, bound, what a plan promises, what the day costs, and how the search went.

    Args:
        found: The plan.
        made: How many experiments there are.
        known: What is known beside them, where anything is.
        promised: What the plan promises, a line each.
        unknown: What faults are told apart from.
    """
    criterion = found.relaxed.criterion
    kept = "" if found.kept is None else f", {found.kept.experiments} of them there already"
    beside = f", beside what {known}" if found.with_prior else ""
    return [
        f"{criterion.name}, {criterion.title}; {made}{kept}{beside}",
        f"  value       {found.relaxed.printed(found.value)}",
        f"  bound       {found.relaxed.printed(found.bound)}  ({reach(found)})",
        f"  efficiency  {100 * found.efficiency:.2f} %{among(found)}",
        *without_cell(found),
        *seen(found),
        *placed(found),
        *on_candidates(found),
        *exchanged(found),
        *off_guess(found),
        *promised,
        *costs_of_day(found),
        *([] if found.timetable is None else day_lines(found.timetable)),
        *shown_faults(found.robot, found.detections, found.separations, unknown),
        search_summary(found.starts, found.seconds, found.found, found.optima),
    ]


def without_cell(found: ExactPlan) -> list[str]:
    """The bound over all poses, free or not, and how free the plan is; nothing without a cell."""
    check = found.in_cell
    if check is None or check.cell is None:
        return []
    beyond = found.certified
    bound = found.relaxed.printed(beyond.bound)
    lines = [
        f"  without the cell the bound is {bound} ({reach(beyond)}), the efficiency "
        f"{100 * beyond.efficiency:.2f} %"
    ]
    if not check.clearance.pairs:
        return [*lines, "  clearance   the cell has nothing to look at"]
    i = check.nearest
    first, second = check.clearance.names(i) or ("", "")
    room = MM * float(check.clearance.least[i])
    margin = f"beyond the margin of {MM * check.cell.margin:g} mm"
    return [
        *lines,
        f"  clearance   {room:.1f} mm or more {margin}; {first} and {second} in row {i + 1}"
        + ("" if check.free else f": {check.headline()}"),
    ]


def seen(found: ExactPlan) -> list[str]:
    """How many markers are read, and a line for each pose that hides some."""
    what = found.seen
    if what is None:
        return []
    rows = [f"              {line}" for line in what.hiding()]
    return [f"  seen        {what.headline()}", *rows]


def placed(found: ExactPlan) -> list[str]:
    """Where tracker and reflectors are to be, and what the other listed places would bring."""
    one = found.placement
    if one is None:
        return []
    place = f"  {'mounts' if one.position is None else 'tracker':10}  {_set_up(one)}"
    number = len(one.tried)
    kind = "setup" if one.normals else "place"
    listed = f"{number} listed {kind}{'s' * (number > 1)}"
    if one.source == "box":
        beside = f", better than {listed}" if one.tried else ""
        lines = [
            f"{place}, searched in the box{beside}",
            "              the bound is for this place: none is known for all of the box",
        ]
    else:
        searched = ", and of a search in the box" * bool(one.looked)
        lines = [f"{place}, the best of {listed}{searched}"]
    if one.bound is not None:
        bound = found.relaxed.printed(one.bound.value)
        share = 100 * one.bound.efficiency(found.cost)
        lines += [
            f"              {bound} bounds plans at any listed {kind}: the best of the bounds of "
            "each",
            f"              {share:.2f} % efficiency among plans at all of them",
        ]
    return [*lines, *_listed_places(found)]


def _set_up(one: Placement | TriedPlace) -> str:
    """Place and mounts as people write them."""
    looks = [f"{name} looks to {_numbers(normal)}" for name, normal in one.normals.items()]
    place = [] if one.position is None else [f"at {_numbers(1e3 * one.position)} mm"]
    return "; ".join([*place, *looks])


def _numbers(vector: Array) -> str:
    """A vector as people write it."""
    return ", ".join(f"{x:.6g}" for x in np.round(vector, 3) + 0.0)


def _listed_places(found: ExactPlan) -> list[str]:
    """A line for each listed place: the value of the best plan there, and its bound."""
    assert found.placement is not None
    lines = []
    for one in found.placement.tried:
        where = f"              {_set_up(one)}"
        if one.bound is None or one.cost is None:
            lines.append(f"{where}: no plan, {one.why}")
            continue
        value = found.relaxed.printed(printed_form(one.cost, one.bound.sense))
        lines.append(f"{where}: {value}, bound {found.relaxed.printed(one.bound.value)}")
    return lines


def on_candidates(found: ExactPlan) -> list[str]:
    """What is proved about all plans on candidates, and where this plan is beside it."""
    one = found.on_candidates
    if one is None:
        return []
    best, bound = (found.relaxed.printed(x) for x in (one.value, one.bound.value))
    free = "" if found.in_cell is None else "free "
    plans = (
        f"all plans of {found.plan.experiments} experiments on these {one.candidates:,} "
        f"{free}candidates"
    )
    if one.proved:
        lines = [f"  exact       {best}, proved: the best of {plans}"]
    else:
        gap = 100 * one.bound.gap_to(one.best)
        lines = [
            f"  exact       {bound}, proved: none of {plans} is better",
            f"              the best that is known of them has {best}, {gap:.2g} % from that",
        ]
    beside = 100 * (found.cost / one.best - 1)
    if abs(beside) < AS_GOOD:
        return [*lines, "              this plan is as good as that"]
    how = "worse" if beside > 0 else "better, off the candidates"
    return [*lines, f"              this plan is {abs(beside):.2g} % {how}"]


def exchanged(found: ExactPlan) -> list[str]:
    """What the plan gives up for a second criterion, and what that brings."""
    one = found.compromise
    if one is None:
        return []
    factor, other = one.shown
    without = found.relaxed.printed(one.value_alone)
    values = f"{factor * one.second_value:.4g} {other}".rstrip()
    before = f"{factor * one.second_alone:.4g} {other}".rstrip()
    allowed = f"{100 * one.allowed:g} %"
    if not one.weight:
        found_in = "in this time " if found.ended in ("budget", "interrupted") else ""
        plans = f"{found_in}no plan within {allowed} was better for {one.second}"
        return [f"  given up    nothing: {plans}"]
    return [
        f"  given up    {100 * one.given_up:.2f} % of {allowed} allowed: {without} without that",
        f"  gained      {one.second} = {values} instead of {before}, as by {one.times:.3g} times "
        "as many experiments",
    ]


def off_guess(found: ExactPlan) -> list[str]:
    """How good the plan is where springs are not as guessed, if that matters."""
    lines = []
    for of, (where, what) in GUESSES.items():
        own = [one for one in found.off_guess if one.of == of]
        each = " and ".join(
            one.why or f"{100 * one.efficiency:.1f} % if they {what.format(f'{one.factor:g}')}"
            for one in own
        )
        if own:
            lines.append(f"  guess       of the {of}, {where}; the plan's efficiency is {each}")
    return lines


def on_limits(found: ExactPlan) -> list[str]:
    """Which joints stand on their limits, where one does."""
    words = on_limits_in_words(found.on_limits)
    return [words] if words else []


def _budget(found: ExactPlan) -> list[str]:
    """The error budget, or why there is none where a task asks for it."""
    if found.error_budget is not None:
        return [error_budget(found.error_budget)]
    return [] if found.expected is None else [NO_BUDGET]


def among(found: ExactPlan) -> str:
    """What the efficiency is among, where that is not all poses."""
    if found.lower_bound.kind in (BoundKind.SEARCHED, BoundKind.PROVED):
        return ""
    return " of the best on these poses; other poses may be better"


def reach(found: ExactPlan) -> str:
    """Which plans the bound speaks of."""
    kinds = {
        BoundKind.PROVED: "proved for all poses",
        BoundKind.SEARCHED: "searched over all poses, not proved",
    }
    reach = kinds.get(
        found.lower_bound.kind,
        "over the candidates and these poses alone, for want of time to search all poses",
    )
    if found.relaxed.without_cell is not None:
        reach += ", with the cell"
    if found.bound_gap <= CUT_OFF:
        return reach
    too_good = "too optimistic by an unknown amount"
    if np.isfinite(found.bound_gap):
        too_good = f"up to {100 * found.bound_gap:.2g} % too optimistic"
    return f"{reach}; its search was stopped early: it may be {too_good}"


def costs_of_day(found: ExactPlan) -> list[str]:
    """What the day costs, and what other loads would have brought; nothing where nobody said."""
    costs = found.costs if isinstance(found, DayPlan) else None
    if costs is None or not isinstance(found, DayPlan):
        return []
    unit = f" {costs.unit}".rstrip()
    changes = costs.changes_of(found.plan.wrench)
    plural = "" if changes == 1 else "s"
    limit = "" if costs.budget is None else f" of {costs.budget:g}{unit}"
    what = "experiments, each without its load and with it," if costs.paired else "visits"
    lines = [
        f"costs {found.spent:g}{unit}{limit}: {found.plan.experiments} {what} and {changes} load "
        f"change{plural} of {costs.change:g}{unit}"
    ]
    for loads, cost in found.tried.items():
        names = " and ".join(_load_names(found.wrenches)[i] for i in loads)
        efficiency = 100 * found.lower_bound.efficiency(cost) if np.isfinite(cost) else None
        told = "cannot be better" if efficiency is None else f"efficiency {efficiency:.2f} %"
        lines.append(f"  with {names} alone: {told}")
    return lines


def _load_names(wrenches: Array | None) -> list[str]:
    """What the loads (s, 6) of a day are called: no load, and the others by their numbers."""
    loaded = [] if wrenches is None else [bool(W.any()) for W in wrenches]
    several = sum(loaded) > 1
    return [
        "no load" if not own else f"load {sum(loaded[: i + 1])}" if several else "load"
        for i, own in enumerate(loaded)
    ]


def experiments(found: ExactPlan) -> list[str]:
    """A header, and a line for each pose."""
    # Not by `to_frame`: pandas would take a tenth of the time that a person waits for a plan.
    whole = found.whole
    names = list(pose_columns(found.robot))
    columns = in_file_units(found.robot, whole.q)
    if found.shows_loads:
        names += wrench_columns(whole.wrench)
        columns = np.hstack([columns, wrench_in_file_units(whole.wrench)])
    kept_poses = 0 if found.kept is None else len(found.kept.q)
    numbers = [[f"{x:.3f}" for x in row] for row in columns]
    header, *rows = number_columns(names, numbers, 10)
    lines = [f"repeats {header}"]
    for i, (times, row) in enumerate(zip(whole.repeats, rows, strict=True)):
        kept = "  kept" if i < kept_poses else ""
        lines.append(f"{times:7} {row}{kept}")
    return lines


def exact_plan_notebook(found: ExactPlan) -> str:
    """A row for each pose, and the bound."""
    whole = found.whole
    table = whole.to_frame(found.relaxed.space.workspace.robot)
    kept = 0 if found.kept is None else len(found.kept.q)
    rows = [
        [f"{i + 1}{', kept' if i < kept else ''}", *(f"{value:.6g}" for value in row)]
        for i, row in enumerate(table.to_numpy())
    ]
    kind = found.lower_bound.kind.value
    value, bound = (found.relaxed.printed(number) for number in (found.value, found.bound))
    notes = [f"value {value}, and no plan of as many is better than {bound} ({kind})"]
    notes += [line.strip() for line in (*seen(found), *placed(found), *on_candidates(found))]
    if found.expected is not None:
        notes.append(str(found.expected))
    return notebook_table(found.headline(), ["pose", *table.columns], rows, notes)


def exact_plan_plot(found: ExactPlan, ax: Any = None) -> Any:
    """Draw the joint variables by pose, kept experiments first.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.0, 4.2))[0, 0]
    joint_variables(found.whole, found.relaxed.space.workspace.robot, ax)
    if found.kept is not None:
        ax.axvspan(0.5, len(found.kept.q) + 0.5, color="grey", alpha=0.15, linewidth=0)
        ax.set_xlabel(f"{ax.get_xlabel()}; grey: kept")
    ax.set_title(plain(found.headline()), fontsize=10)
    return ax


def geometry_plan_show(found: "GeometryPlan") -> ShownPage:
    """The visits in the order of their sheet, with the share of the information of each."""
    question = found.question
    criterion = found.relaxed.criterion
    stage = stage_of_plan(
        question.study, found.whole, lambda plan: shares(question.information, criterion, plan)
    )
    return ShownPage(stage)


def geometry_plan_text(found: "GeometryPlan") -> str:
    """Value, bound, what is identified, what the day costs, and the poses with their visits."""
    poses = found.poses
    lines = search_lines(
        found,
        f"{found.whole.experiments} visits of {len(poses.q)} poses",
        "is known before",
        [
            *_identified(found),
            *rho0_of_visits(found),
            *_loads(found, poses),
        ],
        "the parameters",
    )
    table = experiments(found) if found.question.chooses_forces else _visits(found, poses)
    return "\n".join([*lines, *table, *on_limits(found)])


def _loads(found: "GeometryPlan", poses: PosesByLoad) -> list[str]:
    """What loads the visits of each column, or each visit."""
    if not found.question.chooses_forces:
        return visits_by_load(poses)
    return [f"each visit under {found.question.study.specification.describe_load()}"]


def _identified(found: "GeometryPlan") -> list[str]:
    """How many parameters a plan tells, and what no plan of this study does."""
    question = found.question
    lines = [f"{question.model.p} parameters can be told apart"]
    if question.model.p < question.structural.p:
        lines[0] += f" of {question.structural.p} that any poses would tell"
    lines += [f"not told by feasible poses: {words}" for words in question.untold]
    return [*lines, *about(question)]


def _visits(found: "GeometryPlan", poses: PosesByLoad) -> list[str]:
    """A header, and a line for each pose: its visits without and under each load, its joints."""
    names = list(pose_columns(found.robot))
    numbers = [[f"{x:.3f}" for x in row] for row in in_file_units(found.robot, poses.q)]
    header, *rows = number_columns(names, numbers, 10)
    if len(poses.wrenches) == 1:
        heads = ["visits"]
    elif len(poses.wrenches) == 2:
        heads = ["unloaded", "loaded"]
    else:
        heads = ["no load", *(load_name(poses, i) for i in range(1, len(poses.wrenches)))]
    lines = [f"{' '.join(f'{head:>8}' for head in heads)} {header}"]
    kept = found.poses_kept
    for own, row, times in zip(poses.visits, rows, kept, strict=True):
        counts = " ".join(f"{number or '-':>8}" for number in own)
        there = f"  {times} of them kept" if times else ""
        lines.append(f"{counts} {row}{there}")
    return lines
