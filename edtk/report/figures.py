"""Figures of the comparison report."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

import criteria
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.study import Study
from edtk.system.atomic_file import atomic_path

# Okabe-Ito, safe for colour-blind readers; the last ones repeat with other markers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7F7F7F")
MARKERS = "osD^vPX*<>hd"


def unit_of(name: str) -> tuple[float, str]:
    """Factor and unit in which a person reads a criterion."""
    factor, unit = criteria.get(name).shown
    return (1e3 * factor, f"1e-3 {unit}") if unit else (factor, "SI")


def save(figure: Figure, path: Path) -> None:
    """Write a picture atomically, the same bytes for the same figure."""
    with atomic_path(path) as temporary:
        FigureCanvasAgg(figure)
        figure.savefig(temporary, dpi=150, metadata={"Software": None})


def by_size(study: Study, table: pd.DataFrame, relaxed: dict[str, RelaxedPlan]) -> Figure:
    """The main criterion against the number of experiments, for every kind of plan, with the bound as a line."""
    main = study.main_criterion
    factor, unit = unit_of(main)
    figure = Figure(figsize=(8.6, 4.8), layout="constrained")
    ax = figure.add_subplot()
    others = [name for name in study.specification.optimise if name != main]
    groups = [
        ("optimised", main, f"optimised for {main}"),
        ("published", "", "published"),
        ("random", "", "random"),
    ]
    groups += [("optimised", name, f"optimised for {name}") for name in others]
    for i, (kind, name, label) in enumerate(groups):
        part = table[(table["kind"] == kind) & (table["optimised_for"] == name)].sort_values(
            "experiments"
        )
        if len(part):
            ax.plot(
                part["experiments"],
                factor * part[main],
                label=label,
                linewidth=2.0 if i == 0 else 1.0,
                linestyle=":" if kind == "random" else "-",
                color=COLOURS[i % len(COLOURS)],
                marker=MARKERS[i % len(MARKERS)],
                markersize=5,
            )
    sizes = np.geomspace(min(study.specification.sizes), max(study.specification.sizes), 100)
    bound = np.array([relaxed[main].best_bound.scaled(m).value for m in sizes])
    ax.plot(
        sizes,
        factor * bound,
        color="black",
        linestyle="--",
        linewidth=1.2,
        label="bound over all poses",
    )
    ax.set(xscale="log", yscale="log", xlabel="number of experiments m", ylabel=f"{main} [{unit}]")
    ax.xaxis.set_major_locator(FixedLocator(sorted(study.specification.sizes)))
    ax.xaxis.set_minor_locator(NullLocator())
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    ax.set_title(study.specification.title, fontsize=11)
    ax.grid(visible=True, which="both", alpha=0.25)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return figure


def heat_map(names: list[str], rows: list[str], percent: np.ndarray, size: int) -> Figure:
    """Efficiencies [%] of plans (rows) under criteria (columns), with the number in every cell."""
    figure = Figure(figsize=(1.8 + 0.62 * len(names), 1.1 + 0.36 * len(rows)), layout="constrained")
    ax: Axes = figure.add_subplot()
    picture = ax.imshow(percent, cmap="viridis", vmin=0, vmax=100, aspect="auto")
    for i, row in enumerate(percent):
        for j, value in enumerate(row):
            shown = "-" if np.isnan(value) else f"{value:.0f}" if value >= 1 else f"{value:.1g}"
            ax.text(
                j,
                i,
                shown,
                ha="center",
                va="center",
                fontsize=8,
                color="black" if value > 60 else "white",
            )
    ax.set_xticks(range(len(names)), names)
    ax.set_yticks(range(len(rows)), rows)
    ax.xaxis.tick_top()
    ax.set_title(f"Efficiency of plans of {size} experiments, by criterion", fontsize=10)
    figure.colorbar(picture, ax=ax, label="% of the bound over all poses")
    return figure
