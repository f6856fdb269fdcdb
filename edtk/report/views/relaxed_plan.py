"""Relaxed designs over poses."""

from dataclasses import replace
from typing import Any

from edtk.design.enclosure.prove_continuum import ProvedPlan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.draw.bars import weight_bars
from edtk.report.figures import panels
from edtk.report.shown import plain, shown_value
from edtk.report.tables import notebook_table, number_columns


def relaxed_plan_text(plan: RelaxedPlan) -> str:
    """Value, bounds and poses."""
    criterion = plan.criterion
    factor = criterion.shown[0]
    unit = f" {criterion.shown[1]}".rstrip()
    plural = "" if plan.candidates == 1 else "s"
    cell = "" if plan.without_cell is None else " with the cell"
    free = "free " if cell else ""
    proved = f"bound{cell}, proved on {plan.candidates:,} {free}candidate{plural}"
    word = "; by a solver's word" if plan.rests_on_solver else ""
    bounds = [(proved, plan.proved_bound, word)]
    if plan.searched_bound is not None:
        where = f"all {free}poses"
        bounds.append((f"bound{cell}, searched over {where}", plan.searched_bound, "; not proved"))
    if isinstance(plan, ProvedPlan):
        boxes = f"; {plan.boxes:,} boxes cover all poses{word}"
        bounds.append((f"bound, {plan.continuum_bound.kind.value}", plan.continuum_bound, boxes))
    if plan.without_cell is not None:
        beyond = plan.without_cell
        bound = replace(beyond.best_bound, gap=beyond.best_bound.gap_to(plan.cost))
        bounds.append((f"bound without the cell, {bound.kind.value}", bound, ""))
    width = max(len(label) for label, *_ in bounds)
    lines = [
        f"{criterion.name}, {criterion.title}, for a single experiment's worth of weight"
        f"{_among(plan)}; {criterion.sense}imised",
        f"  {'value':{width}}  {factor * plan.value:.7g}{unit}",
    ]
    for label, bound, proof in bounds:
        number = f"{factor * bound.value:.7g}{unit}"
        lines.append(f"  {label:{width}}  {number}  (relative gap {bound.gap:.1e}{proof})")
    return "\n".join([*lines, *_poses(plan)])


def _among(plan: RelaxedPlan) -> str:
    """Among how many experiments what is known beforehand is shared out."""
    sharing = plan.space.sharing
    plural = "" if sharing == 1 else "s"
    known = f" and of what is known beforehand, among {sharing} experiment{plural}"
    return known if sharing else ""


def _poses(plan: RelaxedPlan) -> list[str]:
    """A header, and a line for each pose, the heaviest first."""
    table = plan.to_frame()
    weights = table.pop(table.columns[-1])
    numbers = [[f"{x:.3f}" for x in row] for row in table.to_numpy()]
    header, *rows = number_columns(list(table.columns), numbers, 10)
    lines = (f"{weight:.5f} {row}" for weight, row in zip(weights, rows, strict=True))
    return [f"weight  {header}", *lines]


def relaxed_plan_notebook(plan: RelaxedPlan) -> str:
    """A row for each pose, the heaviest first, and the bounds."""
    table = plan.to_frame()
    rows = [[i + 1, *(f"{value:.6g}" for value in row)] for i, row in enumerate(table.to_numpy())]
    bounds = [plan.proved_bound]
    if plan.searched_bound is not None:
        bounds.append(plan.searched_bound)
    if isinstance(plan, ProvedPlan):
        bounds.append(plan.continuum_bound)
    notes = [
        f"bound {bound.value:.6g} ({bound.kind.value}), relative gap {bound.gap:.1e}"
        for bound in bounds
    ]
    return notebook_table(plan.headline(), ["pose", *table.columns], rows, notes)


def relaxed_plan_plot(plan: RelaxedPlan, ax: Any = None) -> Any:
    """Draw the weights by pose, with value and bound in the title.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (7.0, 3.6))[0, 0]
    names = [str(i + 1) for i in (-plan.weights).argsort(kind="stable").argsort(kind="stable")]
    weight_bars(plan.weights, names, "pose", ax)
    name = plan.criterion.label
    bound = plan.best_bound
    ax.set_title(
        f"{plain(name)} = {shown_value(name, plan.value, 5)} per experiment, "
        f"bound {shown_value(name, bound.value, 5)} ({bound.kind.value})",
        fontsize=10,
    )
    return ax
