"""Fig. 7 as a drawing."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from edtk.system.files import Content, write_files
from paper_figures.simulated import Errors

DOTS = 30  # a plan
UNIT = 1e-6  # 1e-3 mm
HEADROOM = 1.03  # so that the highest dot is whole
# Colours of Okabe and Ito, which colour-blind readers can tell apart, darkened for thin lines.
COLOURS = ("#595959", "#0072B2", "#C44E00", "#00805E", "#B0558A", "#946B00")
TITLES = {
    "clipped": "(a) $\\max(\\mathbf{A}_0, 0)$: agrees with print in Table 6",
    "true": "(b) $\\mathbf{A}_0$ itself, as in Eq. (23)",
}
NAMES = ("random", "2 × 6", "3 × 4", "4 × 3", "6 × 2", "12 × 1")
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "mathtext.fontset": "dejavusans",
    "svg.hashsalt": "paper_figures",  # without it every drawing has other ids
}


def draw(errors: Sequence[Errors]) -> Figure:
    """Dots, mean lines, exact means and printed expectations, one panel per A0, in 1e-3 mm."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for ax, (target, title) in zip(axes, TITLES.items(), strict=True):
        _panel(ax, [e for e in errors if e.target == target])
        ax.set_title(title, pad=34)
    highest = max(float(e.distances[:DOTS].max()) for e in errors) / UNIT
    axes[0].set_ylim(0, HEADROOM * highest)
    axes[0].set_ylabel("compensation error $|\\mathbf{A}_0(\\hat{k} - k_0)|$  [10$^{-3}$ mm]")
    figure.legend(handles=_legend(errors), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(ax: Axes, errors: Sequence[Errors]) -> None:
    """One column per plan; the dots stand side by side in the order in which they were drawn."""
    for column, (e, colour) in enumerate(zip(errors, COLOURS, strict=True)):
        x = column + np.linspace(-0.3, 0.3, DOTS)
        ax.plot(x, e.distances[:DOTS] / UNIT, "o", ms=3.2, mew=0, alpha=0.6, color=colour)
        ends = (column - 0.4, column + 0.4)
        ax.plot(ends, [e.printed / UNIT] * 2, color="black", lw=1.3, ls=(0, (3, 2)), zorder=4)
        ax.plot(ends, [e.mean / UNIT] * 2, color=colour, lw=2.4, solid_capstyle="butt", zorder=3)
        ax.plot(column, e.exact_mean / UNIT, "D", ms=4.2, mfc="white", mec="black", mew=1, zorder=5)
        _write_mean(ax, column, e, colour)
        ax.plot(column, e.rho0 / UNIT, "^", ms=4.6, mfc="white", mec="black", mew=1, zorder=5)
    names = [f"({e.plan})\n{name}" for e, name in zip(errors, NAMES, strict=True)]
    ax.set_xticks(range(len(errors)), names)
    ax.set_xlim(-0.55, len(errors) - 0.35)
    ax.tick_params(axis="x", length=0)
    ax.yaxis.grid(True, color="0.9", lw=0.6)
    ax.set_axisbelow(True)


def _write_mean(ax: Axes, column: int, e: Errors, colour: str) -> None:
    """The number of a plan's mean line and its value, above the panel."""
    ax.text(
        column,
        1.01,
        f"({e.line})\n{e.mean / UNIT:.2f}",
        ha="center",
        va="bottom",
        color=colour,
        weight="bold",
        transform=ax.get_xaxis_transform(),
    )


def _legend(errors: Sequence[Errors]) -> list[Line2D]:
    """What each mark means."""
    marks: dict[str, Any] = {"mfc": "white", "mec": "black", "ls": ""}
    runs = f"{len(errors[0].distances):,}".replace(",", " ")
    mean = f"mean of {runs} simulations (value above)"
    return [
        Line2D([], [], color="0.4", lw=2.4, label=mean),
        Line2D([], [], color="black", lw=1.3, ls=(0, (3, 2)), label="printed mean"),
        Line2D([], [], marker="D", ms=4.2, label="exact mean", **marks),
        Line2D([], [], marker="^", ms=4.6, label="exact RMS, $\\rho_0$ of Eq. (20)", **marks),
    ]


def save(errors: Sequence[Errors], out: Path) -> tuple[Path, ...]:
    """Write figure_7.png (150 dpi) and figure_7.svg; the same errors give the same bytes."""
    paths = (out / "figure_7.png", out / "figure_7.svg")
    with matplotlib.rc_context(STYLE):
        figure = draw(errors)
        files: dict[Path, Content] = {}
        for path in paths:
            metadata = {"Date": None} if path.suffix == ".svg" else {}
            buffer = io.BytesIO()
            figure.savefig(buffer, format=path.suffix[1:], dpi=150, metadata=metadata)
            files[path] = buffer.getvalue()
    write_files(files)
    return paths
