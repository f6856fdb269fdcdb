"""Weights of a design as bars."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from edtk.report.palette import BLUE
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 40  # bars up to which each one has a name


def weight_bars(weights: Array, names: Sequence[str], label: str, ax: "Axes") -> None:
    """Draw weights, the heaviest first.

    Args:
        weights: Shares (k,) of the experiments, in any order.
        names: Names (k,) of their poses.
        label: The meaning of the names.
        ax: Where to draw.
    """
    order = np.argsort(-weights, kind="stable")
    at = np.arange(len(order))
    ax.bar(at, weights[order], color=BLUE)
    if len(order) <= NAMED:
        ax.set_xticks(at, [names[i] for i in order])
    ax.set_xlabel(f"{label}, the heaviest first")
    ax.set_ylabel("weight [share of the experiments]")
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
