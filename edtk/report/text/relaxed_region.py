"""Text of a design over a region."""

import numpy as np

from edtk.design.region import Region
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.report.text_table import text_table
from edtk.system.typing import Array

SHOWN = 1e-6  # of a variable's range: what lies below is what a search leaves of a zero


def relaxed_region(found: RelaxedRegion) -> str:
    """Value, both bounds, and a line for each point with its weight."""
    return "\n".join(
        [
            f"{found.criterion.label} ({found.criterion.formula}): {found.value:.7g}",
            *region_bounds(found),
            text_table(*region_rows(found)),
        ]
    )


def region_bounds(found: RelaxedRegion) -> list[str]:
    """The bound over the region and the one over the grid, a line each."""
    searched = found.searched_bound
    proved = found.grid_bound
    return [
        f"bound {searched.value:.7g} over the region ({searched.kind.value}), relative gap "
        f"{searched.gap:.1e}",
        f"bound {proved.value:.7g} over {len(found.grid)} points of a grid ({proved.kind.value}), "
        f"relative gap {proved.gap:.1e}",
    ]


def region_rows(found: RelaxedRegion) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the variables of a point, and its weight."""
    rows = region_points(found.region, found.points)
    weights = [f"{weight:.5f}" for weight in found.weights]
    header = [*found.region.variables, "weight"]
    return header, [[*row, weight] for row, weight in zip(rows, weights, strict=True)]


def region_points(region: Region, points: Array) -> list[list[str]]:
    """The variables of points (k, d), in words."""
    low, high = region.limits
    unit = SHOWN * 10.0 ** np.ceil(np.log10(high - low))
    # Adding zero removes the sign of a zero.
    shown = np.round(points / unit) * unit + 0.0
    return [[f"{value:.6g}" for value in x] for x in shown]
