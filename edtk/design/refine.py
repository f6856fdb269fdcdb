"""Nonlinear refinement: all experiments of a plan move together under the constraints, many plans at once."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.descend import descend
from edtk.design.pose_design import Experiments, PoseDesign

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
SHARPNESS = (10.0, 50.0, 250.0)  # of the soft maxima that take a criterion with kinks down


def cost_and_gradient(criterion: Criterion, experiments: Experiments, repeats: Array) -> tuple[Array, Array]:
    """Logarithms (b,) of a criterion's costs, and their gradients (b, k, v) by the design variables.

    ``d log f = <G, dM>/f`` and ``dM = sum r_i (dA_i' A_i + A_i' dA_i)/sigma^2`` give
    ``d log f/dx_ik = (2 r_i/f) <A_i G, dA_i/dx_k>/sigma^2``.

    Args:
        criterion: What is minimised.
        experiments: Plans (b, k).
        repeats: Their repetitions (b, k).
    """
    cost, G = criterion.cost_and_gradient(information(experiments, repeats))
    finite = np.isfinite(cost)[:, None, None]
    G = np.where(finite, 2.0 / cost[:, None, None] * G, 0.0)
    slope = np.einsum("bkri,bkriv->bkv", experiments.regressor @ G[:, None], experiments.regressor_gradient)
    return np.log(cost), repeats[..., None] * slope


def information(experiments: Experiments, repeats: Array) -> Array:
    """Information matrices (b, p, p) of plans (b, k) with repetitions (b, k)."""
    A = experiments.regressor
    b, k, rows, p = A.shape
    A = (A * np.sqrt(repeats)[..., None, None]).reshape(b, k * rows, p)
    M = np.swapaxes(A, 1, 2) @ A
    shared = experiments.design.shared
    return M if shared is None else M + repeats.sum(axis=1)[:, None, None] * shared


def refine(
    design: PoseDesign,
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
        design: Model, feasible set and what may move.
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

        def objective(here: Experiments, start: Indices, guide: Criterion = guide) -> tuple[Array, Array]:
            return cost_and_gradient(guide, here, repeats[start])

        met.append(descend(design, met[-1], objective, iterations, barrier=0.01 if i == 0 else 1e-3, stop=stop))
    costs = np.array([_cost(design.at(m), criterion, repeats) for m in met])
    best = costs.argmin(axis=0)
    return np.array(met)[best, np.arange(len(x))], costs[best, np.arange(len(x))]


def _cost(experiments: Experiments, criterion: Criterion, repeats: Array) -> Array:
    """Costs (b,) of plans (b, k); infinite where an experiment is not feasible."""
    feasible = experiments.feasible.all(axis=1)
    return np.where(feasible, criterion.cost(information(experiments, repeats)), np.inf)
