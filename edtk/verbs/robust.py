"""What a criterion means for several models at once: their mean, or the worst of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

import criteria
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.nonlinear_model import Robust
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.theta_box import INSIDE, ThetaBox, WorstTheta
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array
from edtk.verbs.inputs import CriterionLike

Design = TypeVar("Design", Relaxation, ProblemPlan)

ROUNDS = 60  # designs at most: five are the rule, of rivals some twenty
ENOUGH = 1e-5  # part by which the worst theta may be worse than those of the list
# Besides at each design, the worst theta is looked for near the best one: designs of short lists
# swing to and fro (Ben-Ameur and Neto, Networks 49, 2007). It halves their number.
NEAR = 0.3
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
    - "rivals": the least of the deviances, which are the information of models of one parameter.

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
    if robust.box is not None:
        message = "has ranges, which edtk.relax and edtk.plan serve; expected a list of theta"
        raise ArgumentError(message, argument="theta")
    if robust.kind in ("maximin", "rivals"):
        values = None
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


def over_ranges(
    problem: Problem,
    asked: CriterionLike,
    solve: Callable[[Problem, criteria.Criterion], Design],
    first: Sequence[Array] = (),
    rounds: int = ROUNDS,
) -> Design:
    """The design whose worst theta within ranges is the best, see `edtk.design.theta_box`.

    Args:
        problem: The problem of a model with ranges.
        asked: The criterion of one model.
        solve: Finds the best design of a problem of several models.
        first: Theta (p,) of the first list; defaults to one within the ranges.
        rounds: Designs at most. If they end before the worst theta is one of the list, it is the
            best of these designs, beside the bound of its list.
    """
    assert problem.robust is not None
    box: ThetaBox = problem.robust.box
    own = criteria.as_criterion(asked, box.parameters)
    known: dict[Problem, Relaxation] = {}

    def optimum(model: Problem, criterion: criteria.Criterion) -> Relaxation:
        if model not in known:
            known[model] = relax(model, criterion)
        return known[model]

    def best_value(model: Problem | Region, criterion: criteria.Criterion) -> float:
        assert isinstance(model, Problem)
        return optimum(model, criterion).value

    thetas = list(first) or [box.at(np.full(len(box.free), INSIDE))]
    best: Design | None = None
    highest = 0.0
    for _ in range(rounds):
        listed = box.listed(thetas)
        criterion = criterion_of(asked, listed, best_value)
        design = solve(listed, criterion)
        weights = _shares(design)
        theta, value = box.worst(weights, own, optimum, thetas)
        of_list = min(box.value(one, weights, own, optimum) for one in thetas)
        named = dict(zip(box.names, theta.tolist(), strict=True))
        design = replace(design, worst=WorstTheta(named, value, np.array(thetas), box.what))
        if value >= of_list * (1 - ENOUGH) or not box.is_new(theta, thetas):
            return design
        trials = [theta]
        if best is None or value > highest:
            best, highest = design, value
        else:
            near = NEAR * weights + (1 - NEAR) * _shares(best)
            trials.append(box.worst(near, own, optimum, thetas)[0])
        for one in trials:
            if box.is_new(one, thetas):
                thetas.append(one)
    assert best is not None
    return best


def _shares(design: Relaxation | ProblemPlan) -> Array:
    """Weights (n,) of sum one."""
    found = design.weights if isinstance(design, Relaxation) else design.counts
    return np.asarray(found / found.sum())
