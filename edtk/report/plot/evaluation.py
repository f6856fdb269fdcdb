"""Picture of an evaluation."""

from typing import Any

from edtk.report.draw.name_ticks import name_ticks
from edtk.report.palette import BLUE
from edtk.report.panels import panels
from edtk.study.evaluate import Evaluation


def evaluation(found: Evaluation, ax: Any = None) -> Any:
    """Draw the standard deviations of the compliances as bars.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.4, 3.6))[0, 0]
    units = dict.fromkeys(found.units)
    names = found.parameters
    if len(units) > 1:
        names = tuple(f"{name}\n[{unit}]" for name, unit in zip(names, found.units, strict=True))
    ax.bar(range(len(names)), found.std, color=BLUE)
    name_ticks(ax, names)
    ax.set_xlabel("parameter")
    ax.set_ylabel(f"standard deviation [{' or '.join(units)}]")
    ax.set_title(f"Standard deviations after {found.experiments} experiments", fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    return ax
