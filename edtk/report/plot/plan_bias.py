"""Picture of a plan's bias."""

from typing import Any

from edtk.calibration.plan_bias import PlanBias
from edtk.report.draw.name_ticks import name_ticks
from edtk.report.palette import BLUE
from edtk.report.panels import panels


def plan_bias(found: PlanBias, ax: Any = None) -> Any:
    """Draw the bias of each compliance in standard deviations; the grey band is one of them.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.4, 3.6))[0, 0]
    p = len(found.parameters)
    ax.axhspan(-1, 1, color="grey", alpha=0.15, linewidth=0)
    ax.axhline(0, color="black", linewidth=0.8)
    ax.bar(range(p), found.bias.in_std, color=BLUE)
    name_ticks(ax, found.parameters)
    ax.set_xlabel("parameter")
    ax.set_ylabel("bias [standard deviations]")
    ax.set_title(f"Bias of the linear model, {found.experiments} experiments", fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    return ax
