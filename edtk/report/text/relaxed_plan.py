"""Text of a relaxed plan."""

from edtk.design.relaxation.relaxed_plan import RelaxedPlan


def relaxed_plan(plan: RelaxedPlan) -> str:
    """Value, bounds and poses."""
    criterion = plan.criterion
    factor = criterion.shown[0]
    unit = f" {criterion.shown[1]}".rstrip()
    plural = "" if plan.candidates == 1 else "s"
    proved = f"bound, proved on {plan.candidates:,} candidate{plural}"
    bounds = [(proved, plan.proved_bound, "")]
    if plan.searched_bound is not None:
        bounds.append(("bound, searched over all poses", plan.searched_bound, "; not proved"))
    width = max(len(label) for label, *_ in bounds)
    lines = [
        f"{criterion.name}, {criterion.title}, for a single experiment's worth of weight; "
        f"{criterion.sense}imised",
        f"  {'value':{width}}  {factor * plan.value:.7g}{unit}",
    ]
    for label, bound, proof in bounds:
        gap = max(bound.gap_to(plan.cost), 0)  # below zero only by rounding
        number = f"{factor * bound.value:.7g}{unit}"
        lines.append(f"  {label:{width}}  {number}  (relative gap {gap:.1e}{proof})")
    return "\n".join([*lines, *_poses(plan)])


def _poses(plan: RelaxedPlan) -> list[str]:
    """A header, and a line for each pose, the heaviest first."""
    table = plan.to_frame()
    lines = ["weight   " + " ".join(f"{column:>9}" for column in table.columns[:-1])]
    for *entries, weight in table.itertuples(index=False):
        lines.append(f"{weight:.5f}  " + " ".join(f"{x:9.3f}" for x in entries))
    return lines
