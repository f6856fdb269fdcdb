"""Designs side by side: a table, a picture, and a page."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.exact.comparison import Comparison
from edtk.report.draw.bars import heat_map
from edtk.report.figures import COLOURS, new_figure, panels
from edtk.report.page import Page, paragraph, picture, section, table, verdict
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, number, percent, text_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLES = ("-", "--", ":", "-.")


def comparison_text(found: Comparison) -> str:
    """The headline, and a line for each design."""
    return "\n".join([found.headline(), _of(found), text_table(*comparison_rows(found))])


def comparison_notebook(found: Comparison) -> str:
    """The same table."""
    return notebook_table(found.headline(), *comparison_rows(found), [_of(found)])


def _of(found: Comparison) -> str:
    """What the percentages are of."""
    return f"Values, and efficiencies in parts {found.basis}:"


def comparison_rows(found: Comparison) -> tuple[list[str], list[list[str]]]:
    """Header and rows: design, experiments, and value with efficiency under each criterion."""
    header = ["design", "experiments"]
    for label in found.criteria:
        header += [label, "efficiency"]
    rows = []
    for i, name in enumerate(found.names):
        size = found.experiments[i]
        row = [name, "weights" if np.isnan(size) else f"{size:.0f}"]
        for value, share in zip(found.values[i], found.efficiencies[i], strict=True):
            row += [number(value), percent(share)]
        rows.append(row)
    return header, rows


def comparison_plot(found: Comparison, ax: Any = None) -> Any:
    """Draw the efficiencies of designs (rows) under criteria (columns).

    Returns:
        The axes.
    """
    height = 1.4 + 0.4 * len(found.names)
    ax = panels(ax, 1, 1, (2.6 + 0.9 * len(found.criteria), height))[0, 0]
    label = f"% {found.basis}".replace(" of each", "\nof each").replace(" of these", "\nof these")
    heat_map(100 * found.efficiencies, list(found.names), list(found.criteria), ax, label)
    return ax


def comparison_page(found: Comparison) -> str:
    """The text of an HTML file: the table, efficiencies, and fractions of design space."""
    figure = new_figure(2.6 + 0.9 * len(found.criteria), 1.4 + 0.4 * len(found.names))
    comparison_plot(found, figure.add_subplot())
    parts = [
        verdict("good", [found.headline()]),
        section(
            "Under each criterion",
            paragraph(f"Efficiencies are in parts {found.basis}."),
            table(*comparison_rows(found), full=True),
            picture(figure, "Efficiencies of designs (rows) under criteria (columns)"),
        ),
    ]
    if found.designs:
        curves = new_figure(7.0, 4.0)
        _fractions(found, curves.add_subplot())
        words = (
            "Fraction of design space: variances of predictions at all places in order, times the "
            "number of experiments"
        )
        parts.append(section("How well they predict", picture(curves, words)))
    return Page("Designs side by side", tuple(parts)).html()


def _fractions(found: Comparison, ax: "Axes") -> None:
    """Variances of predictions of each design in order, for one experiment."""
    places = found.designs[0].places.rows
    fraction = (np.arange(len(places)) + 0.5) / len(places)
    for i, (name, design) in enumerate(zip(found.names, found.designs, strict=True)):
        variances = np.sort((design.size or 1) * design.variances(places))
        style = STYLES[i // len(COLOURS) % len(STYLES)]
        ax.plot(fraction, variances, style, color=COLOURS[i % len(COLOURS)], label=plain(name))
    ax.set_xlabel("fraction of the places")
    ax.set_ylabel("variance of prediction x experiments /\nvariance of noise")
    ax.set_xlim(0, 1)
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, fontsize=9)
