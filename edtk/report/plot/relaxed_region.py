"""Picture of a design over a region: the equivalence theorem."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.report.draw.design_stems import design_stems
from edtk.report.palette import BLUE
from edtk.report.panels import panels
from edtk.report.plain import plain
from edtk.system.errors import UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVE = 801  # points of a curve
PICTURE = 121  # points along each axis of a map
AREA = 400.0  # of the marker of a point that has all weight [square points]


def relaxed_region(found: RelaxedRegion, ax: Any = None) -> Any:
    """Draw the sensitivity over a region of one or two variables, and the points of the design.

    The sensitivity is in parts of the largest. At an optimum it is one at the design's points and
    nowhere larger. Where several multipliers prove the bound, the largest of theirs is drawn.

    Returns:
        The axes.

    Raises:
        UserError: The region has more than two variables.
    """
    ax = over_region(found, found.points, found.weights, "weight", ax)
    ax.set_title(
        f"{plain(found.criterion.label)} = {found.value:.5g}, bound {found.bound:.5g} "
        f"({found.kind.value})",
        fontsize=10,
    )
    return ax


def over_region(
    found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes | None"
) -> "Axes":
    """Draw points over the sensitivity of a design.

    Args:
        found: The design.
        points: Points (k, d).
        shares: Their shares (k,) of the experiments.
        label: What a share is called.
        ax: Where to draw; a new figure where it is not given.

    Raises:
        UserError: The region has more than two variables.
    """
    if found.region.size > 2:
        raise UserError(
            f"a region of {found.region.size} variables has no picture; expected one or two"
        )
    axes: Axes = panels(ax, 1, 1, (7.0, 4.0))[0, 0]
    draw = _curve if found.region.size == 1 else _map
    draw(found, points, shares, label, axes)
    return axes


def _curve(found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes") -> None:
    """The sensitivity over one variable, with a stem of its share at each point."""
    low, high = found.region.limits[:, 0]
    x = np.linspace(low, high, CURVE)
    ax.plot(x, _feasible(found, x[:, None]), color=BLUE, label="sensitivity / largest")
    design_stems(points[:, 0], shares, label, plain(found.region.variables[0]), ax)
    ax.set_ylim(0.0, 1.05)


def _map(found: RelaxedRegion, points: Array, shares: Array, label: str, ax: "Axes") -> None:
    """The sensitivity over two variables, with a disc of its share at each point."""
    low, high = found.region.limits
    axes = [np.linspace(a, b, PICTURE) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1)
    values = _feasible(found, grid.reshape(-1, 2)).reshape(grid.shape[:2])
    picture = ax.contourf(*axes, values, levels=np.linspace(0, 1, 11), cmap="viridis", extend="max")
    ax.scatter(
        points[:, 0],
        points[:, 1],
        s=AREA * shares,
        color="w",
        edgecolor="k",
        clip_on=False,
        zorder=3,
        label=f"points, area by {label}",
    )
    first, second = (plain(name) for name in found.region.variables)
    ax.set(xlabel=first, ylabel=second)
    assert ax.figure is not None
    ax.figure.colorbar(picture, ax=ax, label="sensitivity / largest")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=9)


def _feasible(found: RelaxedRegion, x: Array) -> Array:
    """The largest sensitivity (n,) of points (n, d), nan where they are not feasible."""
    values = found.sensitivities(x).max(axis=0)
    return np.where(found.region.at(x).feasible, values, np.nan)
