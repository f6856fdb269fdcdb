"""Names beside axes; matrices, intervals, weights and budgets as bars and colours."""

from collections.abc import Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np

from edtk.fit.identify import Identification
from edtk.measure.expected_error import ErrorBudget
from edtk.report.figures import BLUE, GREY, ORANGE
from edtk.report.shown import plain
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_SIGNS = 18  # signs of a name
LEAST_SHARED = 4  # signs that all names begin or end with, before these are left out
DOTS = "…"
LEVEL = 7  # signs of a line up to which names stand beside each other
SLOPE = 40  # of longer ones [deg]
LETTER = 0.055  # height of a sign of a sloping name [inch]
DARK = 0.6  # correlation beyond which a cell is so dark that its number is white
# Black takes the colour of a page's text, which is white in the dark; a bright cell stays bright.
INK = "#111111"
BRIGHT = 60  # per cent beyond which a cell is so bright that its number is black
NAMED_BARS = 40  # bars up to which each one has a name
DECADES = 4.0  # below the largest error that are shown
# For the numbers at the right, as a share of the axis up to the largest error.
ROOM_FOR_NUMBERS = 0.3


def short_names(names: Sequence[str]) -> list[str]:
    """Shorten names that are too long for a picture; names that differ still do.

    If one is, all lose the words that they begin and end with alike, as names of ROS joints do.
    Then the middle of a name that is still too long is left out.
    """
    if max(map(len, names), default=0) <= MOST_SIGNS:
        return list(names)
    first = _shared(names)
    last = _shared([name[first:][::-1] for name in names])
    before = DOTS if first else ""
    after = DOTS if last else ""
    parts = [f"{before}{name[first : len(name) - last]}{after}" for name in names]
    short = [_without_middle(part) for part in parts]
    return short if len(set(short)) == len(set(names)) else parts


def _shared(names: Sequence[str]) -> int:
    """Number of signs in the words that all names begin with, none of which is left empty."""
    if len(names) < 2:
        return 0
    words = [name.split("_") for name in names]
    alike = takewhile(lambda position: len(set(position)) == 1, zip(*words, strict=False))
    length = sum(len(position[0]) + 1 for position in alike)
    return length if LEAST_SHARED <= length < min(map(len, names)) else 0


def _without_middle(name: str) -> str:
    if len(name) <= MOST_SIGNS:
        return name
    end = (MOST_SIGNS - len(DOTS)) // 2
    return f"{name[: MOST_SIGNS - len(DOTS) - end]}{DOTS}{name[-end:]}"


def room_for(names: Sequence[str]) -> float:
    """Room that sloping names need beside a picture, beyond that of short ones [inch]."""
    return LETTER * max(0, max(map(len, short_names(names)), default=0) - LEVEL)


def name_ticks(ax: "Axes", x: Sequence[str] = (), y: Sequence[str] = (), top: bool = False) -> None:
    """Write names at the whole numbers from zero on, so that none covers another.

    Args:
        ax: Where to draw.
        x: Names along the horizontal axis; they slope where they are long.
        y: Names along the vertical axis.
        top: Whether the horizontal ones are above the picture.
    """
    if x:
        # A second line, such as a unit, is short.
        lines = [name.partition("\n") for name in x]
        first = short_names([line for line, *_ in lines])
        names = [
            f"{plain(name)}{end}{more}" for name, (_, end, more) in zip(first, lines, strict=True)
        ]
        ax.set_xticks(range(len(names)), names)
        if top:
            ax.xaxis.tick_top()
        if max(map(len, first)) > LEVEL:
            side = "left" if top else "right"
            ax.tick_params(axis="x", rotation=SLOPE)
            for label in ax.get_xticklabels():
                label.set(horizontalalignment=side, rotation_mode="anchor")
    if y:
        ax.set_yticks(range(len(y)), list(map(plain, short_names(y))))


def correlation(matrix: np.ndarray, parameters: tuple[str, ...], ax: "Axes") -> None:
    """Draw correlations (p, p) in colour, each with its number."""
    p = len(matrix)
    image = ax.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for i in range(p):
        for j in range(p):
            colour = "white" if abs(matrix[i, j]) > DARK else INK
            number = f"{matrix[i, j]:.2f}"
            ax.text(j, i, number, ha="center", va="center", fontsize=9, color=colour)
    name_ticks(ax, parameters, parameters)
    ax.figure.colorbar(image, ax=ax, label="correlation")


def heat_map(
    percent: Array,
    plans: list[str],
    names: list[str],
    ax: "Axes",
    label: str = "% of the bound over all poses",
) -> None:
    """Draw efficiencies [%] of plans (rows) under criteria (columns), each with its number."""
    image = ax.imshow(percent, cmap="viridis", vmin=0, vmax=100, aspect="auto")
    for i, row in enumerate(percent):
        for j, value in enumerate(row):
            colour = "black" if value > BRIGHT else "white"
            ax.text(j, i, _cell(value), ha="center", va="center", fontsize=8, color=colour)
    name_ticks(ax, names, top=True)
    ax.set_yticks(range(len(plans)), [plain(name) for name in plans])
    ax.figure.colorbar(image, ax=ax, label=label)


def _cell(value: float) -> str:
    """A number of per cent, short enough for a cell."""
    if np.isnan(value):
        return "-"
    return f"{value:.0f}" if value >= 1 else f"{value:.1g}"


def intervals(
    fit: Identification, parameters: tuple[str, ...], units: tuple[str, ...], ax: "Axes"
) -> None:
    """Draw the 95 % intervals of `Identification.interval`, relative to the estimates [%].

    An interval that reaches to zero is as wide as its estimate, and would leave no room for the
    others: it is written out, in the parameter's unit.

    Args:
        fit: The fit.
        parameters: Names (p,).
        units: Units (p,) of the parameters.
        ax: Where to draw.
    """
    low, high = fit.interval
    at = np.arange(len(fit.k))
    known = (low > 0) & (fit.k > 0)
    scale = 100 / fit.k[known]
    middle = scale * (high - low)[known] / 2
    centre = scale * (high + low)[known] / 2 - 100
    ax.errorbar(centre, at[known], xerr=middle, fmt="none", color=BLUE, capsize=4)
    ax.plot(np.zeros(known.sum()), at[known], linestyle="", marker="o", color=BLUE)
    across = ax.get_yaxis_transform()
    for i in at[~known]:
        text = f"0 to {high[i]:.2g} {units[i]}"
        ax.axhspan(i - 0.4, i + 0.4, color="grey", alpha=0.15, linewidth=0)
        ax.text(0.5, i, text, transform=across, ha="center", va="center", fontsize=9)
    if not known.any():
        ax.set_xlim(-100, 100)
    name_ticks(ax, y=parameters)
    ax.set_ylim(len(at) - 0.5, -0.5)
    ax.set_xlabel("deviation from the estimate [%]")
    ax.grid(axis="x", alpha=0.3)


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
    if len(order) <= NAMED_BARS:
        ax.set_xticks(at, [names[i] for i in order])
    ax.set_xlabel(f"{label}, the heaviest first")
    ax.set_ylabel("weight [share of the experiments]")
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)


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
    ax.set_xlim(left, largest * (largest / left) ** ROOM_FOR_NUMBERS)
    ax.set_yticks(range(len(size)), list(size))
    ax.set_ylim(len(size) - 0.5, -0.5)
    ax.set_xlabel("root mean square error in the task [mm]")
    ax.grid(axis="x", alpha=0.3)
    ax.legend(fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
