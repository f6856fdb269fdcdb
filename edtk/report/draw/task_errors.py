"""The accuracy to expect in each of several test poses, or along a path."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.model.task_accuracy import TaskAccuracy
from edtk.report.palette import BLUE, COLOURS, GREY, MARKERS, ORANGE
from edtk.report.plain import plain
from edtk.system.errors import shortened
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LONGEST_LABEL = 40  # characters of a plan's name
FEW = 20  # poses up to which each has its number under the axis
HALF = 0.25  # width of the bar of a pose to either side


def task_errors(
    found: TaskAccuracy, label: str, others: Mapping[str, TaskAccuracy], ax: "Axes"
) -> None:
    """Draw the root mean square errors with their 95 % band, and those of other plans [mm].

    Along a path the errors are a line over its length. Poses that do not follow each other have a
    bar each. The worst pose is marked; the legend is left to the figure.

    Args:
        found: The accuracy.
        label: What it is called.
        others: Further accuracies in the same poses, by name.
        ax: Where to draw.
    """
    at = 1e3 * found.along if found.is_path else np.arange(1.0, len(found.error) + 1)
    low, high = 1e3 * found.band.T
    error = 1e3 * found.error
    band: dict[str, Any] = {
        "color": BLUE,
        "alpha": 0.18,
        "linewidth": 0,
        "label": "95 % of the errors",
    }
    if found.is_path:
        ax.fill_between(at, low, high, **band)
        ax.plot(at, error, color=BLUE, linewidth=2.0, label=plain(label))
    else:
        ax.bar(at, high - low, 2 * HALF, low, **band)
        ax.hlines(error, at - HALF, at + HALF, color=BLUE, linewidth=2.0, label=plain(label))
    if found.total is not None:
        _total(found, at, ax)
    for i, (name, other) in enumerate(others.items(), start=1):
        ax.plot(
            at,
            1e3 * other.error,
            label=plain(shortened(name, LONGEST_LABEL)),
            color=COLOURS[i % len(COLOURS)],
            marker="" if found.is_path else MARKERS[i % len(MARKERS)],
            linestyle=_line(found, name),
            linewidth=1.0,
            markersize=5,
        )
    shown = found.error if found.total is None else found.total
    mean = 1e3 * found.mean_of(shown)
    ax.axhline(mean, color=GREY, linestyle="--", linewidth=1.0, label="over all poses")
    worst = found.worst_of(shown)
    name = f"worst, pose {worst + 1}"
    ax.plot(at[worst], 1e3 * shown[worst], color="black", marker="o", linestyle="", label=name)
    _scales(found, at, ax)


def _total(found: TaskAccuracy, at: Array, ax: "Axes") -> None:
    """The error with all that else is uncertain, on top."""
    assert found.total is not None
    total = 1e3 * found.total
    if found.is_path:
        ax.plot(at, total, color=ORANGE, linewidth=2.0, label="total error")
    else:
        ax.hlines(total, at - HALF, at + HALF, color=ORANGE, linewidth=2.0, label="total error")


def _line(found: TaskAccuracy, name: str) -> str:
    """The line of another plan; poses that do not follow each other have none between them."""
    if not found.is_path:
        return ""
    return ":" if name == "random" else "-"


def _scales(found: TaskAccuracy, at: Array, ax: "Axes") -> None:
    """Names of the axes; errors begin at zero."""
    ax.set_ylim(bottom=0)
    ax.set_ylabel("error of the tool point [mm]")
    if found.is_path:
        ax.set_xlim(at[0], at[-1] if at[-1] > at[0] else at[0] + 1)
        ax.set_xlabel("length along the path [mm]")
    else:
        ax.set_xlabel("test pose")
        if len(at) <= FEW:
            ax.set_xticks(at)
    ax.grid(alpha=0.3)
    ax.set_axisbelow(True)
