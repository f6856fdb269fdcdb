"""A plan without idle places and equal poses."""

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.plans import Plans
from edtk.design.exact.refine import refine
from edtk.design.exact.round_plan import round_plan
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices

# Relative differences of information up to which poses become one, the boldest first: poses that
# have drifted apart without gain are farther from each other than those of an accurate optimum.
ALIKE = (0.03, 0.003, 1e-4)
LOSS = 1e-6  # relative increase of the cost at which fewer poses are still welcome
FINEST = 100  # steps of the last descent
SHARPEST = (1000.0, 4000.0)  # its soft maxima, within 4e-4 of the criterion and less
DIGITS = 9  # by which poses are sorted: rounding must not decide about their order


def tidy(space: DesignSpace, criterion: Criterion, best: Plans, cost: float) -> tuple[Array, Array]:
    """Merge alike poses of a plan where that costs next to nothing, refine it, and round it.

    The poses are those that a controller takes, see `round_plan`.

    Args:
        space: Model and feasible set.
        criterion: The criterion that the plan is good for.
        best: The plan, in a batch of one.
        cost: Its cost.

    Returns:
        Design variables (k, v) and repetitions (k,), the most repeated pose first, then in the
        order of the joint variables.
    """
    used = best.repeats[0] > 0
    x = best.x[0, used]
    repeats = best.repeats[0, used].astype(float)
    # Poses whose repeats share an error are worth more apart, even where they are alike.
    shares = space.noise is not None and space.noise.shares
    for alike in () if shares else ALIKE:
        problem = space.problem(x)
        kept = distinct(problem.blocks(), range_whitener(problem.mean), alike)
        if len(kept) == len(x):
            continue
        fewer = _merged_repeats(problem, repeats, kept)
        moved, costs = refine(space, criterion, x[kept][None], fewer[None])
        if costs[0] <= cost * (1 + LOSS):
            x = moved[0]
            repeats = fewer
            break
    x = refine(space, criterion, x[None], repeats[None], FINEST, SHARPEST)[0][0]
    x, repeats = round_plan(space, criterion, x, repeats, merge=not shares)
    order = np.lexsort((*np.round(x.T[::-1], DIGITS), -repeats))
    return x[order], repeats[order]


def _merged_repeats(problem: Problem, repeats: Array, kept: Indices) -> Array:
    """Repetitions of the poses that are kept: each pose gives its own to the most similar one."""
    T = range_whitener(problem.information(repeats))
    whitened = (T.T @ problem.blocks() @ T).reshape(problem.n, -1)
    owner = np.linalg.norm(whitened[:, None] - whitened[kept], axis=-1).argmin(axis=1)
    return np.bincount(owner, weights=repeats).astype(float)
