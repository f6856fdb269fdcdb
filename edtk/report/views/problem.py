"""Problems of arrays and regions: their designs, relaxed and exact, and designs side by side."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.bound import BoundKind
from edtk.design.enclosure.prove_region import ProvedRegion
from edtk.design.exact.arranged.arranged_plan import ArrangedPlan
from edtk.design.exact.comparison import Comparison
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.report.draw.bars import heat_map
from edtk.report.draw.designs import draw
from edtk.report.draw.plans import design_stems
from edtk.report.figures import BLUE, COLOURS, new_figure, panels
from edtk.report.page import Page, paragraph, picture, section, table, verdict
from edtk.report.shown import plain
from edtk.report.tables import number, percent, text_table
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

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


def problem_plan_rows(found: ProblemPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, what it is, and its counts."""
    chosen = found.support
    columns = candidate_columns(found.problem, chosen)
    named = [*columns, "count", *found.parts]
    counts = [found.counts, *found.parts.values()]
    cells = [*columns.values(), *([str(number) for number in own[chosen]] for own in counts)]
    return named, [list(row) for row in zip(*cells, strict=True)]


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


def comparison_notes(found: Comparison) -> list[str]:
    """What the percentages are of."""
    return [f"Values, and efficiencies in parts {found.basis}:"]


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


SHOWN_PART = 1e-6  # of a variable's range: what lies below is what a search leaves of a zero
CURVE = 801  # points of a curve
PICTURE = 121  # points along each axis of a map
AREA_OF_ALL = 400.0  # of the marker of a point that has all weight [square points]


def relaxed_region_text(found: RelaxedRegion) -> str:
    """Value, both bounds, and a line for each point with its weight."""
    return "\n".join(
        [
            f"{found.criterion.label} ({found.criterion.formula}): {found.value:.7g}",
            *relaxed_region_notes(found),
            text_table(*relaxed_region_rows(found)),
        ]
    )


def relaxed_region_notes(found: RelaxedRegion) -> list[str]:
    """The bounds over the region and the one over the grid, a line each."""
    searched = found.searched_bound
    proved = found.grid_bound
    first = [continuum_bound(found)] if isinstance(found, ProvedRegion) else []
    return [
        *first,
        f"bound {searched.value:.7g} over the region ({searched.kind.value}), relative gap "
        f"{searched.gap:.1e}",
        f"bound {proved.value:.7g} over {len(found.grid)} points of a grid ({proved.kind.value}), "
        f"relative gap {proved.gap:.1e}",
    ]


def continuum_bound(found: ProvedRegion) -> str:
    """The bound over all points of the region, and what proves it."""
    bound = found.continuum_bound
    return (
        f"bound {bound.value:.10g} over the region ({bound.kind.value}), relative gap "
        f"{bound.gap:.1e}; {found.covering.boxes} boxes in {found.covering.seconds:.1f} s"
    )


def relaxed_region_rows(found: RelaxedRegion) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the variables of a point, and its weight."""
    rows = region_points(found.region, found.points)
    weights = [f"{weight:.5f}" for weight in found.weights]
    header = [*found.region.variables, "weight"]
    return header, [[*row, weight] for row, weight in zip(rows, weights, strict=True)]


def region_points(region: Region, points: Array) -> list[list[str]]:
    """The variables of points (k, d), in words."""
    low, high = region.limits
    unit = SHOWN_PART * 10.0 ** np.ceil(np.log10(high - low))
    # Adding zero removes the sign of a zero.
    shown = np.round(points / unit) * unit + 0.0
    return [[f"{value:.6g}" for value in x] for x in shown]


def relaxed_region_plot(
    found: RelaxedRegion, ax: Any = None, kind: str = "theorem", **options: Any
) -> Any:
    """Draw the sensitivity over a region of one or two variables, and the points of the design.

    The sensitivity is in parts of the largest. At an optimum it is one at the design's points and
    nowhere larger. Where several multipliers prove the bound, the largest of theirs is drawn.

    Args:
        found: The design.
        ax: Axes to draw into.
        kind: "theorem", or a picture that all designs have, see `problem_plan_plot`.
        options: Further arguments of that picture.

    Returns:
        The axes.

    Raises:
        UserError: The region has more than two variables.
    """
    return draw(found, kind, {"theorem": _theorem}, ax, options)


def _theorem(found: RelaxedRegion, ax: "Axes") -> None:
    """The points of weights over their sensitivity."""
    over_region(found, found.points, found.weights, "weight", ax)
    ax.set_title(
        f"{plain(found.criterion.label)} = {found.value:.5g}, bound {found.bound:.5g} "
        f"({found.kind.value})",
        fontsize=10,
    )


def over_region(
    found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes | None"
) -> "Axes":
    """Draw points over the sensitivity of a design.

    Args:
        found: The design.
        points: Points (k, d).
        shares: Their shares (k,) of the experiments.
        label: What a share is called.
        ax: Where to draw; a new figure where it is not given.

    Raises:
        UserError: The region has more than two variables.
    """
    if found.region.size > 2:
        raise UserError(
            f"a region of {found.region.size} variables has no picture; expected one or two"
        )
    axes: Axes = panels(ax, 1, 1, (7.0, 4.0))[0, 0]
    draw = _curve if found.region.size == 1 else _map
    draw(found, points, shares, label, axes)
    return axes


def _curve(found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes") -> None:
    """The sensitivity over one variable, with a stem of its share at each point."""
    low, high = found.region.limits[:, 0]
    x = np.linspace(low, high, CURVE)
    ax.plot(x, _feasible(found, x[:, None]), color=BLUE, label="sensitivity / largest")
    design_stems(points[:, 0], shares, label, plain(found.region.variables[0]), ax)
    ax.set_ylim(0.0, 1.05)


def _map(found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes") -> None:
    """The sensitivity over two variables, with a disc of its share at each point."""
    low, high = found.region.limits
    axes = [np.linspace(a, b, PICTURE) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1)
    values = _feasible(found, grid.reshape(-1, 2)).reshape(grid.shape[:2])
    picture = ax.contourf(*axes, values, levels=np.linspace(0, 1, 11), cmap="viridis", extend="max")
    ax.scatter(
        points[:, 0],
        points[:, 1],
        s=AREA_OF_ALL * shares,
        color="w",
        edgecolor="k",
        clip_on=False,
        zorder=3,
        label=f"points, area by {label}",
    )
    first, second = (plain(name) for name in found.region.variables)
    ax.set(xlabel=first, ylabel=second)
    assert ax.figure is not None
    ax.figure.colorbar(picture, ax=ax, label="sensitivity / largest")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=9)


def _feasible(found: RelaxedRegion, x: Array) -> Array:
    """The largest sensitivity (n,) of points (n, d), nan where they are not feasible."""
    values = found.sensitivities(x).max(axis=0)
    return np.where(found.region.at(x).feasible, values, np.nan)


def region_plan_notes(plan: RegionPlan) -> list[str]:
    """The bound, what it rests on, and the search."""
    bound = plan.lower_bound
    return [
        f"bound {bound.value:.7g} over the region ({bound.kind.value}); {plan.starts} starts, "
        f"{plan.found} of them as good on the grid, {plan.seconds:.1f} s"
    ]


def region_plan_rows(plan: RegionPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the variables of a point, and its number of experiments."""
    rows = region_points(plan.region, plan.points)
    counts = [str(count) for count in plan.counts]
    header = [*plan.region.variables, "count"]
    return header, [[*row, count] for row, count in zip(rows, counts, strict=True)]


def region_plan_plot(plan: RegionPlan, ax: Any = None, kind: str = "points", **options: Any) -> Any:
    """Draw the points of a plan over the sensitivity of the relaxation that bounds it.

    Args:
        plan: The plan.
        ax: Axes to draw into.
        kind: "points", or a picture that all designs have, see `problem_plan_plot`.
        options: Further arguments of that picture.

    Returns:
        The axes.

    Raises:
        UserError: The region has more than two variables.
    """
    return draw(plan, kind, {"points": _plan_points}, ax, options)


def _plan_points(plan: RegionPlan, ax: "Axes") -> None:
    """The points of a plan over the sensitivity of the weights."""
    over_region(plan.relaxed, plan.points, plan.counts / plan.size, "share", ax)
    ax.set_title(
        f"{plan.size} experiments: {plain(plan.criterion.label)} = {plan.value:.5g}, bound "
        f"{plan.bound:.5g}",
        fontsize=10,
    )
