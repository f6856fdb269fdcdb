"""Picture of a relaxation."""

from typing import Any

from edtk.design.relaxation.relaxation import Relaxation
from edtk.report.draw.weight_bars import weight_bars
from edtk.report.panels import panels
from edtk.report.plain import plain


def relaxation(found: Relaxation, ax: Any = None) -> Any:
    """Draw the weights of the candidates that carry some, with value and bound in the title.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (7.0, 3.6))[0, 0]
    names = [str(i) for i in found.support]
    weight_bars(found.weights[found.support], names, "candidate", ax)
    ax.set_title(
        f"{plain(found.criterion.label)} = {found.value:.5g}, bound {found.bound:.5g} "
        f"({found.proved_bound.kind.value})",
        fontsize=10,
    )
    return ax
