"""Text of an exact plan."""

import numpy as np

from edtk.design.bound import BoundKind
from edtk.design.exact.exact_plan import ExactPlan
from edtk.model.joint_margin import on_limits_in_words
from edtk.report.text.error_budget import error_budget
from edtk.report.text.search_summary import search_summary
from edtk.report.text.shown_faults import shown_faults
from edtk.report.text_table import number_columns
from edtk.tables.in_file_units import in_file_units
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS

NO_BUDGET = "no error budget: it needs [simulation], and a plan that tells all compliances"
CUT_OFF = 1e-3  # relative gap of a bound beyond which a person is told


def exact_plan(found: ExactPlan) -> str:
    """Value, bound, how the search went, and the poses."""
    criterion = found.relaxed.criterion
    whole = found.whole
    factor = criterion.shown[0]
    unit = f" {criterion.shown[1]}".rstrip()
    kept = "" if found.kept is None else f", {found.kept.experiments} of them there already"
    if found.with_prior:
        kept += ", beside what the prior tells"
    lines = [
        f"{criterion.name}, {criterion.title}; {whole.experiments} experiments "
        f"in {len(whole.q)} poses{kept}",
        f"  value       {factor * found.value:.6g}{unit}",
        f"  bound       {factor * found.bound:.6g}{unit}  ({reach(found)})",
        f"  efficiency  {100 * found.efficiency:.2f} %{among(found)}",
        *_budget(found),
        *([] if found.expected is None else [str(found.expected)]),
        *shown_faults(found.robot, found.detections, found.separations),
        search_summary(found.starts, found.seconds, found.found, found.optima),
    ]
    return "\n".join([*lines, *_experiments(found), *on_limits(found)])


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
    if found.lower_bound.kind is BoundKind.SEARCHED:
        return ""
    return " of the best on these poses; other poses may be better"


def reach(found: ExactPlan) -> str:
    """Which plans the bound speaks of."""
    searched = found.lower_bound.kind is BoundKind.SEARCHED
    reach = (
        "searched over all poses, not proved"
        if searched
        else "over the candidates and these poses alone, for want of time to search all poses"
    )
    if found.bound_gap <= CUT_OFF:
        return reach
    too_good = "too optimistic by an unknown amount"
    if np.isfinite(found.bound_gap):
        too_good = f"up to {100 * found.bound_gap:.2g} % too optimistic"
    return f"{reach}; its search was stopped early: it may be {too_good}"


def _experiments(found: ExactPlan) -> list[str]:
    """A header, and a line for each pose."""
    # Not by `to_frame`: pandas would take a tenth of the time that a person waits for a plan.
    whole = found.whole
    names = list(pose_columns(found.robot))
    columns = in_file_units(found.robot, whole.q)
    if found.shows_loads:
        names += WRENCH_COLUMNS
        columns = np.hstack([columns, whole.wrench])
    kept_poses = 0 if found.kept is None else len(found.kept.q)
    numbers = [[f"{x:.3f}" for x in row] for row in columns]
    header, *rows = number_columns(names, numbers, 10)
    lines = [f"repeats {header}"]
    for i, (times, row) in enumerate(zip(whole.repeats, rows, strict=True)):
        kept = "  kept" if i < kept_poses else ""
        lines.append(f"{times:7} {row}{kept}")
    return lines
