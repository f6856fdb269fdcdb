"""Efficiencies of plans under criteria, in colour."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.draw.name_ticks import name_ticks
from edtk.report.plain import plain
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BRIGHT = 60  # per cent beyond which a cell is so bright that its number is black


def heat_map(percent: Array, plans: list[str], names: list[str], ax: "Axes") -> None:
    """Draw efficiencies [%] of plans (rows) under criteria (columns), each with its number."""
    image = ax.imshow(percent, cmap="viridis", vmin=0, vmax=100, aspect="auto")
    for i, row in enumerate(percent):
        for j, value in enumerate(row):
            colour = "black" if value > BRIGHT else "white"
            ax.text(j, i, _cell(value), ha="center", va="center", fontsize=8, color=colour)
    name_ticks(ax, names, top=True)
    ax.set_yticks(range(len(plans)), [plain(name) for name in plans])
    ax.figure.colorbar(image, ax=ax, label="% of the bound over all poses")


def _cell(value: float) -> str:
    """A number of per cent, short enough for a cell."""
    if np.isnan(value):
        return "-"
    return f"{value:.0f}" if value >= 1 else f"{value:.1g}"
