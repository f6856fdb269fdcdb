"""What a criterion means for several models at once: their mean, or the worst of them."""

from collections.abc import Callable

import numpy as np

import criteria
from edtk.design.nonlinear_model import Robust
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array
from edtk.verbs.inputs import CriterionLike

VARIANCES = ("A", "I", "c")  # criteria that are sums of variances, with what each sums


def criterion_of(
    asked: CriterionLike,
    question: Problem | Region,
    best: Callable[[Problem | Region, criteria.Criterion], float],
) -> criteria.Criterion:
    """The criterion of a problem or a region, of several models at once where they are such.

    - "bayes" with D: ``exp(mean of log det(M_j)^(-1/p))``, the Bayesian D-criterion of a sample of
      theta (Chaloner and Larntz 1989), as the compound of one D-criterion for each model.
    - "bayes" with A, I or c: the mean of ``trace(W M_j^-1)``.
    - "maximin": the least efficiency ``best_j / cost_j`` of any criterion that minimax takes
      (Dette 1997).

    Args:
        asked: The criterion, about the parameters of one model.
        question: The problem or the region.
        best: The best value of a criterion for one model alone.

    Raises:
        ArgumentError: The criterion has no such form.
    """
    robust = question.robust
    if robust is None:
        return criteria.as_criterion(asked, question.parameters)
    names = robust.models[0].parameters
    own = criteria.as_criterion(asked, names)
    sizes = [model.p for model in robust.models]
    if robust.kind == "maximin":
        values = [best(model, own) for model in robust.models]
        return criteria.create("minimax", criteria=[own] * len(sizes), best=values, sizes=sizes)
    if own.name == "D":
        weights = robust.weights.tolist()
        return criteria.create(
            "compound", criteria=[own] * len(sizes), weights=weights, sizes=sizes
        )
    if own.name in VARIANCES:
        return criteria.create("I", root=_mean_root(own, robust))
    message = (
        f"the mean over several theta is known of D, {', '.join(VARIANCES)}; not of {own.name}"
    )
    raise ArgumentError(message, argument="criterion")


def _mean_root(own: criteria.Criterion, robust: Robust) -> Array:
    """K with ``mean trace(W M_j^-1) = trace(K K' M^-1)`` of the block diagonal M."""
    K = own.K if hasattr(own, "K") else np.eye(robust.models[0].p)
    p, s = K.shape
    k = len(robust.models)
    found = np.zeros((k * p, k * s))
    for j, weight in enumerate(robust.weights):
        found[j * p : (j + 1) * p, j * s : (j + 1) * s] = np.sqrt(weight) * K
    return found
