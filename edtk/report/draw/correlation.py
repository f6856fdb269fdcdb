"""A correlation matrix with its numbers."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.draw.name_ticks import name_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DARK = 0.6  # correlation beyond which a cell is so dark that its number is white
# Black takes the colour of a page's text, which is white in the dark; a bright cell stays bright.
INK = "#111111"


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
