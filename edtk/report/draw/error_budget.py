"""The parts of an error budget beside their total."""

from typing import TYPE_CHECKING

from edtk.model.error_budget import ErrorBudget
from edtk.report.palette import BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 4.0  # below the largest error that are shown
ROOM = 0.3  # for the numbers at the right, as a share of the axis up to the largest error


def error_budget(found: ErrorBudget, ax: "Axes") -> None:
    """Draw each part [mm] as a bar, and lines at the total and at the error without compensation.

    The axis is logarithmic, as parts differ by powers of ten; a part far below the largest error
    has no bar, but its number at the right. The largest part comes first.
    """
    order = sorted(found.parts, key=lambda name: -found.parts[name])
    size = {name.replace("_", " "): 1e3 * found.parts[name] for name in order}
    total = 1e3 * found.total
    without = 1e3 * found.uncompensated
    # An error of nothing at all would leave the axis without a scale.
    largest = max(total, without) or 1.0
    shown = [part for part in (*size.values(), total) if part > largest / 10**DECADES]
    left = min(shown, default=largest / 10) / 2
    right = ax.get_yaxis_transform()
    for row, part in enumerate(size.values()):
        ax.barh(row, max(part - left, 0.0), left=left, height=0.6, color=BLUE)
        text = f"{part:.2g}"
        ax.text(0.99, row, text, transform=right, ha="right", va="center", fontsize=9)
    ax.axvline(total, color=ORANGE, label=f"total {total:.2g} mm")
    label = f"without compensation {without:.2g} mm"
    ax.axvline(without, color=GREY, linestyle="--", label=label)
    ax.set_xscale("log")
    ax.set_xlim(left, largest * (largest / left) ** ROOM)
    ax.set_yticks(range(len(size)), list(size))
    ax.set_ylim(len(size) - 0.5, -0.5)
    ax.set_xlabel("root mean square error in the task [mm]")
    ax.grid(axis="x", alpha=0.3)
    ax.legend(fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
