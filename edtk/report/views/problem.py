"""Problems of arrays, their plans of whole experiments, and designs side by side."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.bound import BoundKind
from edtk.design.exact.arranged.arranged_plan import ArrangedPlan
from edtk.design.exact.comparison import Comparison
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.problem import Problem
from edtk.report.draw.bars import heat_map
from edtk.report.draw.designs import draw
from edtk.report.figures import COLOURS, new_figure, panels
from edtk.report.page import Page, paragraph, picture, section, table, verdict
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, number, percent, text_table
from edtk.system.typing import Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MOST_COLUMNS = 6  # of a data frame: of wider ones the first
ENDED = {
    "starts": "as many as were asked for",
    "stagnation": "more of them brought nothing better",
    "proved": "no plan can be better",
    "interrupted": "interrupted",
    "budget": "the time was over",
    "rounding": "rounding hides which plan is the best",
}
STYLES = ("-", "--", ":", "-.")


def candidate_columns(problem: Problem | None, chosen: Indices) -> dict[str, list[str]]:
    """Columns by name: `candidate`, counted from 0 as in the problem, and those of its frame.

    Args:
        problem: The candidates; None if they are not known.
        chosen: Those (k,) that are shown.
    """
    columns = {"candidate": [str(i) for i in chosen]}
    if problem is None or problem.frame is None:
        return columns
    rows = problem.frame.iloc[chosen]
    for name in rows.columns[:MOST_COLUMNS]:
        cells = [f"{x:.6g}" if isinstance(x, float) else str(x) for x in rows[name]]
        columns.setdefault(str(name), cells)
    return columns


def problem_text(result: Problem) -> str:
    """A line for each parameter."""
    return f"{result.headline()}\n{text_table(*problem_rows(result))}"


def problem_rows(result: Problem) -> tuple[list[str], list[list[str]]]:
    """Header and rows: parameter, and its mean and largest information in a single candidate."""
    names = result.parameters
    p = len(names)
    diagonal = [result.sensitivities(np.outer(e, e)) for e in np.eye(p)]
    rows = [
        [name, f"{values.mean():.4g}", f"{values.max():.4g}"]
        for name, values in zip(names, diagonal, strict=True)
    ]
    return ["parameter", "mean information", "largest information"], rows


def problem_notebook(result: Problem) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *problem_rows(result))


def problem_plan_text(found: ProblemPlan) -> str:
    """Value, bound, search, and a line for each candidate that is measured."""
    experiments = f"{found.size} experiment{'' if found.size == 1 else 's'}"
    return _plan_text(found, experiments, *problem_plan_rows(found))


def _plan_text(found: ProblemPlan, size: str, header: list[str], rows: list[list[str]]) -> str:
    """Value, bound, search, and a table."""
    believed = found.lower_bound.kind is BoundKind.SOLVED
    proved = "by a solver's word" if believed else "proved"
    bound = (
        f"bound {found.bound:.7g} ({proved}, of {found.basis})"
        if found.lower_bound.cost
        else found.basis
    )
    costs = [] if found.spent is None else [f"{each:g}" for each in np.atleast_1d(found.spent)]
    spent = f"The new experiments cost {' and '.join(costs)}.\n" if costs else ""
    return (
        f"{found.criterion.label} ({found.criterion.formula}): {found.value:.7g}, {bound}\n"
        f"{size}; {found.found} of {found.starts} starts led to a plan as good "
        f"({ENDED[found.ended]})\n{spent}"
        f"{text_table(header, rows)}"
    )


def arranged_plan_text(found: ArrangedPlan) -> str:
    """Value, bound, search, and a line for each run in order."""
    words = f"{found.size} runs in {found.structure.errors.headline()}"
    return _plan_text(found, words, *arranged_plan_rows(found))


def arranged_plan_rows(found: ArrangedPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: run, counted from 1, the groups that it is in, and its candidate."""
    columns = candidate_columns(found.problem, found.places)
    groups = {name: [str(i) for i in own] for name, own in found.groups.items()}
    runs = [str(i + 1) for i in range(found.size)]
    cells = zip(runs, *groups.values(), *columns.values(), strict=True)
    return ["run", *groups, *columns], [list(row) for row in cells]


def arranged_plan_notebook(result: ArrangedPlan) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *arranged_plan_rows(result))


def problem_plan_rows(found: ProblemPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, what it is, and its counts."""
    chosen = found.support
    columns = candidate_columns(found.problem, chosen)
    named = [*columns, "count", *found.parts]
    counts = [found.counts, *found.parts.values()]
    cells = [*columns.values(), *([str(number) for number in own[chosen]] for own in counts)]
    return named, [list(row) for row in zip(*cells, strict=True)]


def problem_plan_notebook(result: ProblemPlan) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *problem_plan_rows(result))


def problem_plan_plot(
    found: ProblemPlan, ax: Any = None, kind: str = "counts", **options: Any
) -> Any:
    """Draw how often each candidate is measured, or what the plan tells.

    Args:
        found: The plan.
        ax: Axes to draw into.
        kind: "counts", or a picture that all designs have, see `KINDS`: "fds" for the fraction of
            design space, "variance" of predictions over one factor or two, "power", "correlation",
            "alias", "efficiencies" under other criteria, "sizes" for other numbers of experiments.
        options: Further arguments of the picture, such as `factors=("dose", "time")`.

    Returns:
        The axes.

    Raises:
        ArgumentError: There is no such picture.
    """
    return draw(found, kind, {"counts": _draw_counts}, ax, options)


def _draw_counts(found: ProblemPlan, ax: Any) -> None:
    """A bar for each candidate that is measured."""
    chosen = found.support
    places = range(len(chosen))
    ax.bar(places, found.counts[chosen], width=0.6)
    ax.set_xticks(places, [str(i) for i in chosen], rotation=90 if len(chosen) > 20 else 0)
    ax.set_xlabel("candidate")
    ax.set_ylabel("experiments")
    ax.yaxis.get_major_locator().set_params(integer=True)


def comparison_text(found: Comparison) -> str:
    """The headline, and a line for each design."""
    return "\n".join([found.headline(), _of(found), text_table(*comparison_rows(found))])


def comparison_notebook(found: Comparison) -> str:
    """The same table."""
    return notebook_table(found.headline(), *comparison_rows(found), [_of(found)])


def _of(found: Comparison) -> str:
    """What the percentages are of."""
    return f"Values, and efficiencies in parts {found.basis}:"


def comparison_rows(found: Comparison) -> tuple[list[str], list[list[str]]]:
    """Header and rows: design, experiments, and value with efficiency under each criterion."""
    header = ["design", "experiments"]
    for label in found.criteria:
        header += [label, "efficiency"]
    rows = []
    for i, name in enumerate(found.names):
        size = found.experiments[i]
        row = [name, "weights" if np.isnan(size) else f"{size:.0f}"]
        for value, share in zip(found.values[i], found.efficiencies[i], strict=True):
            row += [number(value), percent(share)]
        rows.append(row)
    return header, rows


def comparison_plot(found: Comparison, ax: Any = None) -> Any:
    """Draw the efficiencies of designs (rows) under criteria (columns).

    Returns:
        The axes.
    """
    height = 1.4 + 0.4 * len(found.names)
    ax = panels(ax, 1, 1, (2.6 + 0.9 * len(found.criteria), height))[0, 0]
    label = f"% {found.basis}".replace(" of each", "\nof each").replace(" of these", "\nof these")
    heat_map(100 * found.efficiencies, list(found.names), list(found.criteria), ax, label)
    return ax


def comparison_page(found: Comparison) -> str:
    """The text of an HTML file: the table, efficiencies, and fractions of design space."""
    figure = new_figure(2.6 + 0.9 * len(found.criteria), 1.4 + 0.4 * len(found.names))
    comparison_plot(found, figure.add_subplot())
    parts = [
        verdict("good", [found.headline()]),
        section(
            "Under each criterion",
            paragraph(f"Efficiencies are in parts {found.basis}."),
            table(*comparison_rows(found), full=True),
            picture(figure, "Efficiencies of designs (rows) under criteria (columns)"),
        ),
    ]
    if found.designs:
        curves = new_figure(7.0, 4.0)
        _fractions(found, curves.add_subplot())
        words = (
            "Fraction of design space: variances of predictions at all places in order, times the "
            "number of experiments"
        )
        parts.append(section("How well they predict", picture(curves, words)))
    return Page("Designs side by side", tuple(parts)).html()


def _fractions(found: Comparison, ax: "Axes") -> None:
    """Variances of predictions of each design in order, for one experiment."""
    places = found.designs[0].places.rows
    fraction = (np.arange(len(places)) + 0.5) / len(places)
    for i, (name, design) in enumerate(zip(found.names, found.designs, strict=True)):
        variances = np.sort((design.size or 1) * design.variances(places))
        style = STYLES[i // len(COLOURS) % len(STYLES)]
        ax.plot(fraction, variances, style, color=COLOURS[i % len(COLOURS)], label=plain(name))
    ax.set_xlabel("fraction of the places")
    ax.set_ylabel("variance of prediction x experiments /\nvariance of noise")
    ax.set_xlim(0, 1)
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, fontsize=9)
