"""Relaxations over candidates or poses: the equivalence theorem, or the weights alone."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.bound import VISIBLE
from edtk.design.enclosure.prove_continuum import ProvedPlan
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import is_normalised
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.measure.pose_table import (
    in_file_units,
    pose_columns,
    wrench_columns,
    wrench_in_file_units,
)
from edtk.report.draw.bars import weight_bars
from edtk.report.draw.designs import draw
from edtk.report.draw.plans import design_stems
from edtk.report.figures import BLUE, panels
from edtk.report.shown import plain
from edtk.report.tables import MOST_LINES, notebook_table, number_columns, text_table
from edtk.report.views.problem import candidate_columns
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OF_WEIGHTS = 7  # digits of a value of weights
NUMBERED = "candidate"  # the axis of candidates that have numbers alone
MANY_CANDIDATES = 5000  # candidates beyond which the largest sensitivity of neighbours is drawn


def relaxation_text(found: Relaxation) -> str:
    """Value, bound, and a line for each candidate with weight, the heaviest first."""
    proved = "by a solver's word" if found.rests_on_solver else "proved"
    number = f"{found.value:.7g}, bound {found.bound:.7g} ({proved}, relative gap {found.gap:.1e})"
    lines = [f"{found.criterion.label} ({found.criterion.formula}): {number}"]
    if found.accuracy > VISIBLE:
        lines.append(
            f"the model is ill-conditioned: rounding may change these numbers by "
            f"{found.accuracy:.0e}, "
            "relatively; centre or scale the regressors for more digits"
        )
    return "\n".join([*lines, text_table(*relaxation_rows(found))])


def relaxation_rows(found: Relaxation) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, what it is, and weight."""
    support = found.support
    order = support[np.argsort(-found.weights[support], kind="stable")]
    columns = candidate_columns(found.problem, order)
    weights = [f"{found.weights[i]:.5f}" for i in order]
    rows = [list(row) for row in zip(*columns.values(), weights, strict=True)]
    return [*columns, "weight"], rows


def relaxation_plot(
    found: Relaxation,
    ax: Any = None,
    x: ArrayLike | str | None = None,
    kind: str = "theorem",
    **options: Any,
) -> Any:
    """Draw the sensitivities of all candidates, and a stem of its weight at each that has some.

    Sensitivities are in parts of the largest. By the equivalence theorem an optimal design has
    weight only where its sensitivity is one, the largest; where several multipliers prove the
    bound, the largest of theirs is drawn. A relaxation that does not hold its candidates, as within
    one over poses, has its weights as bars.

    Args:
        found: The relaxation.
        ax: Axes to draw into; a new figure where they are not given.
        x: What to draw over: a number for each candidate (n,), or the name of a column of the data
            frame that the candidates came from. Defaults to its only column of numbers, or else to
            the candidates' numbers from zero.
        kind: "theorem", or a picture that all designs have, see `problem_plan_plot`.
        options: Further arguments of that picture.

    Returns:
        The axes.

    Raises:
        ArgumentError: x is not such.
    """
    given = options if x is None else {"x": x, **options}
    return draw(found, kind, {"theorem": _theorem}, ax, given)


def _theorem(found: Relaxation, ax: "Axes", x: ArrayLike | str | None = None) -> None:
    """The sensitivities with the weights, or the weights alone."""
    if found.problem is None:
        names = [str(i) for i in found.support]
        weight_bars(found.weights[found.support], names, "candidate", ax)
    else:
        _sensitivities(found, found.problem, x, ax)
    ax.set_title(
        f"{plain(found.criterion.label)} = {found.value:.5g}, bound {found.bound:.5g} "
        f"({found.proved_bound.kind.value})",
        fontsize=10,
    )


def _sensitivities(
    found: Relaxation, problem: Problem, x: ArrayLike | str | None, ax: "Axes"
) -> None:
    """The sensitivities over x, and the weights."""
    at, label = _places(problem, x)
    rows = found.sensitivities(problem)
    top = rows.max(axis=1, keepdims=True)
    # At unit trace a multiplier may have any multiple of the identity besides: the least is zero.
    low = rows.min(axis=1, keepdims=True) if is_normalised(found.criterion) else 0.0
    span = top - low
    relative = ((rows - low) / np.where(span > 0, span, 1.0)).max(axis=0)
    order = np.argsort(at, kind="stable")
    shown_at, shown = _thinned(at[order], relative[order])
    once = len(np.unique(at)) == len(at)  # a line through several values at one x would jump
    ax.plot(shown_at, shown, "-" if once else ".", color=BLUE, label="sensitivity / largest")
    support = found.support
    design_stems(at[support], found.weights[support], "weight", plain(label), ax)
    ax.set_ylim(min(0.0, float(relative.min())), 1.05)
    if label == NUMBERED:
        from matplotlib.ticker import MaxNLocator

        ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def _places(problem: Problem, x: ArrayLike | str | None) -> tuple[Array, str]:
    """What the candidates are drawn over (n,), and its name."""
    numbers = np.arange(problem.n, dtype=float)
    if not isinstance(x, str) and x is not None:
        at = np.asarray(x, dtype=float)
        if at.shape != numbers.shape or not np.isfinite(at).all():
            raise ArgumentError(
                f"expected a number for each of {problem.n} candidates", argument="x"
            )
        return at, "x"
    if problem is None or problem.frame is None:
        if x is not None:
            message = "the candidates do not come from a data frame; expected numbers"
            raise ArgumentError(message, argument="x", given=repr(x))
        return numbers, NUMBERED
    columns = problem.frame.select_dtypes("number").columns
    if x is None:
        if len(columns) != 1:
            return numbers, NUMBERED
        x = str(columns[0])
    if x not in columns:
        names = ", ".join(map(str, columns))
        message = f"expected a column of numbers of the frame: {names}"
        raise ArgumentError(message, argument="x", given=repr(x))
    return problem.frame[x].to_numpy(dtype=float), x


def _thinned(at: Array, shown: Array) -> tuple[Array, Array]:
    """The largest of neighbours, where there are more than a picture can show."""
    n = len(at)
    if n <= MANY_CANDIDATES:
        return at, shown
    starts = np.linspace(0, n, MANY_CANDIDATES, endpoint=False).astype(int)
    largest = np.maximum.reduceat(shown, starts)
    return at[starts], largest


def relaxed_plan_text(plan: RelaxedPlan) -> str:
    """Value, bounds and poses."""
    criterion = plan.criterion
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
        f"  {'value':{width}}  {plan.printed(plan.value, OF_WEIGHTS)}",
    ]
    for label, bound, proof in bounds:
        number = plan.printed(bound.value, OF_WEIGHTS)
        lines.append(f"  {label:{width}}  {number}  (relative gap {bound.gap:.1e}{proof})")
    return "\n".join([*lines, *_poses(plan)])


def _among(plan: RelaxedPlan) -> str:
    """Among how many experiments what is known beforehand is shared out."""
    sharing = plan.space.sharing
    plural = "" if sharing == 1 else "s"
    known = f" and of what is known beforehand, among {sharing} experiment{plural}"
    return known if sharing else ""


def _poses(plan: RelaxedPlan) -> list[str]:
    """A header, and a line for each pose, the heaviest first; what was cut off has many."""
    robot, shown = plan.space.workspace.robot, plan.plan
    columns, numbers = list(pose_columns(robot)), in_file_units(robot, shown.q)
    if plan.space.load.limits.size:
        columns += wrench_columns(shown.wrench)
        numbers = np.hstack([numbers, wrench_in_file_units(shown.wrench)])
    weights = np.sort(plan.weights)[::-1]
    rest = weights[MOST_LINES:]
    texts = [[f"{x:.3f}" for x in row] for row in numbers[:MOST_LINES]]
    header, *rows = number_columns(columns, texts, 10)
    lines = [f"{weight:.5f} {row}" for weight, row in zip(weights[:MOST_LINES], rows, strict=True)]
    if len(rest):
        lines.append(f"... and {len(rest)} more, {rest.sum():.2f} together, in --json or --out")
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
        f"bound {plan.printed(bound.value, OF_WEIGHTS)} ({bound.kind.value}), "
        f"relative gap {bound.gap:.1e}"
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
        f"{plain(name)} = {plan.printed(plan.value, 5)} per experiment, "
        f"bound {plan.printed(bound.value, 5)} ({bound.kind.value})",
        fontsize=10,
    )
    return ax
