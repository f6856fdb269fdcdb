"""A correlation matrix with its numbers."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.plain import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DARK = 0.6  # correlation beyond which a cell is so dark that its number is white


def correlation(matrix: np.ndarray, parameters: tuple[str, ...], ax: "Axes") -> None:
    """Draw correlations (p, p) in colour, each with its number."""
    p = len(matrix)
    image = ax.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for i in range(p):
        for j in range(p):
            colour = "white" if abs(matrix[i, j]) > DARK else "black"
            number = f"{matrix[i, j]:.2f}"
            ax.text(j, i, number, ha="center", va="center", fontsize=8, color=colour)
    ax.set_xticks(range(p), [plain(name) for name in parameters])
    ax.set_yticks(range(p), [plain(name) for name in parameters])
    ax.figure.colorbar(image, ax=ax)
