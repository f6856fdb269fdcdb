"""Text of a plan on the candidates of a problem."""

from edtk.design.bound import BoundKind
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.report.text.candidate_columns import candidate_columns
from edtk.report.text_table import text_table

ENDED = {
    "starts": "as many as were asked for",
    "stagnation": "more of them brought nothing better",
    "proved": "no plan can be better",
    "interrupted": "interrupted",
}


def problem_plan(found: ProblemPlan) -> str:
    """Value, bound, search, and a line for each candidate that is measured."""
    believed = found.lower_bound.kind is BoundKind.SOLVED
    proved = "by a solver's word" if believed else "proved"
    bound = (
        f"bound {found.bound:.7g} ({proved}, of {found.basis})"
        if found.lower_bound.cost
        else found.basis
    )
    experiments = f"{found.size} experiment{'' if found.size == 1 else 's'}"
    spent = "" if found.spent is None else f"The new experiments cost {found.spent:g}.\n"
    return (
        f"{found.criterion.label} ({found.criterion.formula}): {found.value:.7g}, {bound}\n"
        f"{experiments}; {found.found} of {found.starts} starts led to a plan as good "
        f"({ENDED[found.ended]})\n{spent}"
        f"{text_table(*problem_plan_rows(found))}"
    )


def problem_plan_rows(found: ProblemPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, what it is, and its counts."""
    chosen = found.support
    columns = candidate_columns(found.problem, chosen)
    named = [*columns, "count", *found.parts]
    counts = [found.counts, *found.parts.values()]
    cells = [*columns.values(), *([str(number) for number in own[chosen]] for own in counts)]
    return named, [list(row) for row in zip(*cells, strict=True)]
