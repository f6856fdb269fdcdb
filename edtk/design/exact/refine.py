"""Nonlinear refinement: all experiments of a plan move together under the constraints, many plans at once."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.log_cost import LogCost
from edtk.design.experiments import Experiments
from edtk.design.interior_point.descend import descend

Array = NDArray[np.float64]
SHARPNESS = (10.0, 50.0, 250.0)  # of the soft maxima that take a criterion with kinks down


def refine(
    space: DesignSpace,
    criterion: Criterion,
    x: Array,
    repeats: Array,
    iterations: int = 200,
    sharpness: tuple[float, ...] = SHARPNESS,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[Array, Array]:
    """Minimise the logarithm of the criterion's cost over all movable variables of each plan, see `descend`.

    A criterion with kinks is taken down by smooth ones above it, sharper and sharper (`Criterion.smoothed`); what
    counts in the end is the criterion itself.

    Args:
        space: Model, feasible set and what may move.
        criterion: What to improve.
        x: Design variables (b, k, v) of b plans of k experiments.
        repeats: Their repetitions (b, k), which are kept.
        iterations: Limit on steps, of each smooth criterion.
        sharpness: Of those smooth criteria.
        stop: Asked before each step whether to end early.

    Returns:
        Design variables (b, k, v) and costs (b,): feasible ones, never worse than a feasible start; a start that is
        infeasible and cannot be mended has infinite cost.
    """
    guides = [criterion] if criterion.smooth else [criterion.smoothed(s) for s in sharpness]
    met = [x]
    for i, guide in enumerate(guides):
        barrier = 0.03 if i == 0 else 0.003
        met.append(
            descend(space, met[-1], LogCost(guide, repeats), iterations, barrier=barrier, stop=stop)
        )
    costs = np.array([_cost(space.at(m), criterion, repeats) for m in met])
    best = costs.argmin(axis=0)
    return np.array(met)[best, np.arange(len(x))], costs[best, np.arange(len(x))]


def _cost(experiments: Experiments, criterion: Criterion, repeats: Array) -> Array:
    """Costs (b,) of plans (b, k); infinite where an experiment is not feasible."""
    feasible = experiments.feasible.all(axis=1)
    return np.where(feasible, criterion.cost(experiments.information(repeats)), np.inf)
