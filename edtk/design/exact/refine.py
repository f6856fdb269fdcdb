"""Nonlinear refinement: all experiments of a plan move together under the constraints."""

import numpy as np

from criteria import Criterion
from edtk.design.interior_point.descend import descend
from edtk.design.relaxation.log_cost import LogCost
from edtk.design.space import Points, Space
from edtk.system.typing import Array

SHARPNESS = (10.0, 50.0, 250.0)  # of the soft maxima for criteria with kinks, in turn
# The first descent begins far from the constraints. A later one begins near an optimum, from which
# a large barrier would only drive it away.
FIRST_BARRIER = 0.03
LATER_BARRIER = 0.003


def refine(
    space: Space,
    criterion: Criterion,
    x: Array,
    repeats: Array,
    iterations: int = 200,
    sharpness: tuple[float, ...] = SHARPNESS,
) -> tuple[Array, Array]:
    """Move the poses and loads of plans to a local optimum of the criterion, many plans at once.

    The logarithm of the cost is minimised over all movable variables of each plan, see `descend`.
    A criterion with kinks is replaced by smooth ones that are nowhere below it, sharper and sharper
    (`Criterion.smoothed`). The result is chosen by the criterion itself.

    Args:
        space: Model, feasible set and movable variables.
        criterion: The criterion to improve.
        x: Design variables (b, k, v) of b plans of k experiments.
        repeats: Their repetitions (b, k), which are kept.
        iterations: Limit on the number of steps, for each smooth criterion.
        sharpness: Sharpness of these smooth criteria.

    Returns:
        Design variables (b, k, v) and costs (b,). Plans are feasible and never worse than a
        feasible start. A start that is infeasible and cannot be pushed inside has infinite cost.
    """
    smooth = [criterion] if criterion.smooth else [criterion.smoothed(s) for s in sharpness]
    stages = [x]
    barrier = FIRST_BARRIER
    for guide in smooth:
        objective = LogCost(guide, repeats)
        stages.append(descend(space, stages[-1], objective, iterations, barrier=barrier))
        barrier = LATER_BARRIER
    costs = np.array([_costs(space.at(stage), criterion, repeats) for stage in stages])
    best = costs.argmin(axis=0)
    each = np.arange(len(x))
    return np.array(stages)[best, each], costs[best, each]


def _costs(experiments: Points, criterion: Criterion, repeats: Array) -> Array:
    """Costs (b,) of plans (b, k), infinite where an experiment is not feasible."""
    feasible = experiments.feasible.all(axis=1)
    return np.where(feasible, criterion.cost(experiments.information(repeats)), np.inf)
