"""Text of a relaxed plan."""

from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.text_table import number_columns


def relaxed_plan(plan: RelaxedPlan) -> str:
    """Value, bounds and poses."""
    criterion = plan.criterion
    factor = criterion.shown[0]
    unit = f" {criterion.shown[1]}".rstrip()
    plural = "" if plan.candidates == 1 else "s"
    proved = f"bound, proved on {plan.candidates:,} candidate{plural}"
    word = "; by a solver's word" if plan.rests_on_solver else ""
    bounds = [(proved, plan.proved_bound, word)]
    if plan.searched_bound is not None:
        bounds.append(("bound, searched over all poses", plan.searched_bound, "; not proved"))
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
