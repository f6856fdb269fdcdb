"""A criterion against the number of experiments."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.other_plans import other_plans
from edtk.report.palette import COLOURS, MARKERS
from edtk.report.plain import plain
from edtk.report.plans_of import plans_of
from edtk.report.run_unit import run_unit
from edtk.study.study_run import StudyRun
from edtk.system.errors import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LONGEST_LABEL = 40  # characters of a plan's name in a picture


def criterion_by_size(run: StudyRun, ax: "Axes") -> None:
    """Draw the main criterion for every kind of plan, and the bound; without a legend."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    others = [name for name in run.study.specification.optimise if name != main]
    ours = {f"optimised for {name}": plans_of(run.table, "optimised", name) for name in others}
    groups = {f"optimised for {main}": plans_of(run.table, "optimised", main)}
    groups |= other_plans(run.table) | ours
    for i, (label, group) in enumerate(groups.items()):
        plans = group.sort_values("experiments")
        if len(plans):
            ax.plot(
                plans["experiments"],
                factor * plans[main],
                label=plain(shortened(label, LONGEST_LABEL)),
                linewidth=2.0 if i == 0 else 1.0,
                linestyle=":" if label == "random" else "-",
                color=COLOURS[i % len(COLOURS)],
                marker=MARKERS[i % len(MARKERS)],
                markersize=5,
            )
    _bound(run, factor, ax)
    _scales(run, f"{plain(main)} [{unit}]", ax)


def _bound(run: StudyRun, factor: float, ax: "Axes") -> None:
    """The bound over all poses, as a line over all numbers of experiments."""
    sizes = run.study.specification.sizes
    main = run.study.main_criterion
    if main in run.relaxations:
        m = np.geomspace(min(sizes), max(sizes), 100)
        best = run.relaxations[main].best_bound
        bound = np.array([best.scaled(size).value for size in m])
    else:  # each size has a bound of its own
        m = np.sort(np.array(sizes, dtype=float))
        found = (run.bound(int(size)) for size in m)
        bound = np.array([np.nan if one is None else one.value for one in found])
    ax.plot(
        m,
        factor * bound,
        color="black",
        linestyle="--",
        linewidth=1.2,
        label="bound over all poses",
    )


def _scales(run: StudyRun, label: str, ax: "Axes") -> None:
    """Logarithmic axes with plain numbers, and a tick for each size."""
    from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

    ax.set(xscale="log", yscale="log", xlabel="number of experiments m", ylabel=label)
    ax.xaxis.set_major_locator(FixedLocator(sorted(run.study.specification.sizes)))
    ax.xaxis.set_minor_locator(NullLocator())
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    ax.set_title(plain(run.study.specification.title), fontsize=11)
    ax.grid(visible=True, which="both", alpha=0.25)
