"""The search over a region for the largest sensitivities: where a design should measure next."""

import numpy as np

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.region import Region
from edtk.design.relaxation.ascend import ascend
from edtk.design.relaxation.compass import compass
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.normalised import is_normalised, normalised
from edtk.design.relaxation.onto_walls import onto_walls
from edtk.design.relaxation.region_grid import RegionGrid
from edtk.system.typing import Array, Indices

STARTS = 64  # ascents from points of the grid for each multiplier, at most
LEAST_STARTS = 16
ACCURACY = 1e-11  # relative, of a sensitivity at the end of an ascent
# Part by which the largest sensitivity is raised before it enters a bound: a maximum that an ascent
# has not quite reached must not make the bound too good. It covers ends on curved constraints.
MARGIN = 1e-9
TOP = 0.01  # part below the largest sensitivity down to which ends of ascents climb on


def search_region(
    grid: RegionGrid, criterion: Criterion, multipliers: Array, known: Array
) -> tuple[LargestSensitivities, Candidates]:
    """Ascend the sensitivity from every local maximum on the grid, and from known points.

    Args:
        grid: The points where ascents may begin.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        known: Points (k, d) that the design rests on.

    Returns:
        The largest sensitivities of grid and ascents, raised by `MARGIN`, and the points where the
        ascents ended. A search proves nothing: a peak between the points of the grid may be missed.
    """
    region = grid.region
    of_grid = normalised(grid.problem, criterion).sensitivities(multipliers)
    most = max(LEAST_STARTS, STARTS // len(multipliers))
    starts = [np.concatenate([grid.maxima(own, most), known]) for own in of_grid]
    owner = np.repeat(np.arange(len(multipliers)), [len(x) for x in starts])
    x = np.concatenate(starts)
    unit = np.abs(of_grid).max(axis=1)
    Z = multipliers[owner] / np.where(unit > 0, unit, 1.0)[owner, None, None]
    x = ascend(region, x, Z, is_normalised(criterion), accuracy=ACCURACY)
    x = _on_walls_where_better(region, criterion, x, Z)
    x = _top_climbed(region, criterion, x, Z, owner)
    found = Candidates(x, region.problem(x))
    ends = LargestSensitivities.over(found, criterion, multipliers)
    largest = ends.or_larger(LargestSensitivities.of(of_grid, grid.x))
    raised = largest.values + MARGIN * np.abs(largest.values)
    return LargestSensitivities(raised, largest.x), found


def _top_climbed(region: Region, criterion: Criterion, x: Array, Z: Array, owner: Indices) -> Array:
    """Points (n, d), of which those of almost the largest sensitivity have climbed on by `compass`.

    Ascents follow derivatives, and stop short of a kink of the model.
    """
    values = _own(region, criterion, x[None], Z)[0]
    largest = np.full(owner.max() + 1, -np.inf)
    np.maximum.at(largest, owner, values)
    top = np.flatnonzero(values >= largest[owner] - TOP * np.abs(largest[owner]))
    moved = x.copy()
    moved[top] = compass(region, x[top], lambda trials: _own(region, criterion, trials, Z[top]))
    return moved


def _on_walls_where_better(region: Region, criterion: Criterion, x: Array, Z: Array) -> Array:
    """Points (n, d), on the walls that they almost touch unless that lowers the sensitivity."""
    moved = onto_walls(region, x)
    before, after = _own(region, criterion, np.stack([x, moved]), Z)
    better = region.at(moved).feasible & (after >= before)
    return np.where(better[:, None], moved, x)


def _own(region: Region, criterion: Criterion, x: Array, Z: Array) -> Array:
    """Sensitivities (b, n) of points (b, n, d), each to its own multiplier (n, p, p)."""
    A = region.at(x).regressor
    values = ((A @ Z) * A).sum(axis=(-2, -1))
    trace = np.square(A).sum(axis=(-2, -1))
    if region.prior is not None:
        values = values + np.tensordot(Z, region.prior, 2)
        trace = trace + np.trace(region.prior)
    if not is_normalised(criterion):
        return values
    return np.asarray(values / np.where(trace > 0, trace, 1.0))
