"""Designs over a region, relaxed and exact: the equivalence theorem."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.enclosure.prove_region import ProvedRegion
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.region import Region
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.report.draw.designs import draw
from edtk.report.draw.plans import design_stems
from edtk.report.figures import BLUE, panels
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, text_table
from edtk.system.errors import UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN_PART = 1e-6  # of a variable's range: what lies below is what a search leaves of a zero
CURVE = 801  # points of a curve
PICTURE = 121  # points along each axis of a map
AREA_OF_ALL = 400.0  # of the marker of a point that has all weight [square points]


def relaxed_region_text(found: RelaxedRegion) -> str:
    """Value, both bounds, and a line for each point with its weight."""
    return "\n".join(
        [
            f"{found.criterion.label} ({found.criterion.formula}): {found.value:.7g}",
            *region_bounds(found),
            text_table(*region_rows(found)),
        ]
    )


def region_bounds(found: RelaxedRegion) -> list[str]:
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


def region_rows(found: RelaxedRegion) -> tuple[list[str], list[list[str]]]:
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


def relaxed_region_notebook(result: RelaxedRegion) -> str:
    """A row for each point, and the bounds."""
    return notebook_table(result.headline(), *region_rows(result), region_bounds(result))


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


def region_plan_text(plan: RegionPlan) -> str:
    """Value, bound, and a line for each point with its number of experiments."""
    return "\n".join([plan.headline(), plan_bound(plan), text_table(*plan_rows(plan))])


def plan_bound(plan: RegionPlan) -> str:
    """The bound, what it rests on, and the search."""
    bound = plan.lower_bound
    return (
        f"bound {bound.value:.7g} over the region ({bound.kind.value}); {plan.starts} starts, "
        f"{plan.found} of them as good on the grid, {plan.seconds:.1f} s"
    )


def plan_rows(plan: RegionPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the variables of a point, and its number of experiments."""
    rows = region_points(plan.region, plan.points)
    counts = [str(count) for count in plan.counts]
    header = [*plan.region.variables, "count"]
    return header, [[*row, count] for row, count in zip(rows, counts, strict=True)]


def region_plan_notebook(result: RegionPlan) -> str:
    """A row for each point, and the bound."""
    return notebook_table(result.headline(), *plan_rows(result), [plan_bound(result)])


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
