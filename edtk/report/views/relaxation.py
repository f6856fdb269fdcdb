"""Relaxations over candidates: the equivalence theorem, or the weights alone."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.bound import VISIBLE
from edtk.design.problem import Problem
from edtk.design.problems import DescribedProblem
from edtk.design.relaxation.proof import is_normalised
from edtk.design.relaxation.relaxation import Relaxation
from edtk.report.draw.bars import weight_bars
from edtk.report.draw.designs import draw
from edtk.report.draw.plans import design_stems
from edtk.report.figures import BLUE
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, text_table
from edtk.report.views.problem import candidate_columns
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 5000  # candidates beyond which the largest sensitivity of neighbours is drawn


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


def relaxation_notebook(result: Relaxation) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *relaxation_rows(result))


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
    if not isinstance(problem, DescribedProblem):
        if x is not None:
            message = "the candidates do not come from a data frame; expected numbers"
            raise ArgumentError(message, argument="x", given=repr(x))
        return numbers, "candidate"
    columns = problem.frame.select_dtypes("number").columns
    if x is None:
        if len(columns) != 1:
            return numbers, "candidate"
        x = str(columns[0])
    if x not in columns:
        names = ", ".join(map(str, columns))
        message = f"expected a column of numbers of the frame: {names}"
        raise ArgumentError(message, argument="x", given=repr(x))
    return problem.frame[x].to_numpy(dtype=float), x


def _thinned(at: Array, shown: Array) -> tuple[Array, Array]:
    """The largest of neighbours, where there are more than a picture can show."""
    n = len(at)
    if n <= MOST:
        return at, shown
    starts = np.linspace(0, n, MOST, endpoint=False).astype(int)
    largest = np.maximum.reduceat(shown, starts)
    return at[starts], largest
