"""Axes for a picture: new ones, or panels in the place of given axes."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def panels(
    ax: "Axes | None", rows: int, columns: int, size: tuple[float, float], **options: Any
) -> np.ndarray:
    """Make axes (rows, columns) for a picture.

    Args:
        ax: Axes whose place is divided, or taken as they are for a single panel; a new figure where
            they are not given.
        rows: Number of rows of panels.
        columns: Number of columns of panels.
        size: Width and height of a new figure [inch].
        options: Of `subplots`, such as `sharex`.

    Raises:
        ValueError: The axes have no place in a grid that could be divided.
    """
    if ax is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=size, layout="constrained")
        return np.asarray(figure.subplots(rows, columns, squeeze=False, **options))
    if rows == columns == 1:
        return np.array([[ax]])
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("these axes cannot be divided; expected axes that pyplot.subplots made")
    ax.set_axis_off()
    grid = place.subgridspec(rows, columns)
    return np.asarray(grid.subplots(squeeze=False, **options))
