"""Picture of a plan on the candidates of a problem."""

from typing import Any

from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.report.panels import panels
from edtk.report.plain import plain


def problem_plan(found: ProblemPlan, ax: Any = None) -> Any:
    """Draw how often each candidate is measured, with the value in the title.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (7.0, 3.6))[0, 0]
    chosen = found.support
    places = range(len(chosen))
    ax.bar(places, found.counts[chosen], width=0.6)
    ax.set_xticks(places, [str(i) for i in chosen], rotation=90 if len(chosen) > 20 else 0)
    ax.set_xlabel("candidate")
    ax.set_ylabel("experiments")
    ax.yaxis.get_major_locator().set_params(integer=True)
    ax.set_title(plain(found.headline()), fontsize=10)
    return ax
