"""What a criterion means for several models at once: their mean, or the worst of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import block_diag

import criteria
from edtk.design.bound import RelaxedDesign
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.model_design import places_of
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.problem import CandidateSites, Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_region import relax_region
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.design.relaxation.search_region import RegionGrid
from edtk.design.theta_box import Robust, Shares, ThetaBox, WorstTheta
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array
from edtk.verbs.inputs import CriterionLike

Design = TypeVar("Design", bound=Relaxation | ProblemPlan | RelaxedRegion | RegionPlan)

ROUNDS = 60  # designs at most: five are the rule, of rivals some twenty
ENOUGH = 5e-7  # part by which the worst theta may be worse than those of the list
# Besides at each design, the worst theta is looked for near the best one: designs of short lists
# swing to and fro (Ben-Ameur and Neto, Networks 49, 2007). It halves their number.
NEAR = 0.3
GRID = 600  # points of a region where the first list of theta is found
PART = 1e-3  # of the largest part in a proof, below which a theta has none
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

    Where predictions are is told by `places_of` if nothing else does; they are in parts of the
    noise.

    Args:
        asked: The criterion, about the parameters of one model.
        question: The problem or the region.
        best: The best value of a criterion for one model alone.

    Raises:
        ArgumentError: The criterion has no such form.
    """
    robust = question.robust
    if robust is None:
        return criteria.as_criterion(
            asked, question.parameters, lambda name: places_of(question, name)
        )
    if has_ranges(question):
        message = "has ranges, which edtk.relax and edtk.plan serve; expected a list of theta"
        raise ArgumentError(message, argument="theta")
    models = robust.models
    each = [criterion_of(asked, model, best) for model in models]
    sizes = [model.p for model in models]
    if robust.kind in ("maximin", "rivals"):
        values = None
        if robust.kind == "maximin":
            values = [best(model, own) for model, own in zip(models, each, strict=True)]
        return criteria.create("minimax", criteria=each, best=values, sizes=sizes)
    name = each[0].name
    if name == "D":
        weights = robust.weights.tolist()
        return criteria.create("compound", criteria=each, weights=weights, sizes=sizes)
    if name in VARIANCES:
        return criteria.create("I", root=_mean_root(each, robust))
    message = f"the mean over several theta is known of D, {', '.join(VARIANCES)}; not of {name}"
    raise ArgumentError(message, argument="criterion")


def _mean_root(each: Sequence[criteria.Criterion], robust: Robust) -> Array:
    """K with ``mean trace(W_j M_j^-1) = trace(K K' M^-1)`` of the block diagonal M."""
    roots = [getattr(one, "K", np.eye(robust.models[0].p)) for one in each]
    parts = zip(np.sqrt(robust.weights), roots, strict=True)
    return np.asarray(block_diag(*(weight * K for weight, K in parts)))


def has_ranges(question: Problem | Region) -> bool:
    """Whether its theta have ranges."""
    return question.robust is not None and question.robust.box is not None


def over_ranges(
    question: Problem | Region,
    asked: CriterionLike,
    solve: Callable[[Any, criteria.Criterion], Design],
    first: Sequence[Array] = (),
    rounds: int = ROUNDS,
) -> Design:
    """The design whose worst theta within ranges is the best, see `edtk.design.theta_box`.

    Args:
        question: The problem or the region of a model with ranges.
        asked: The criterion of one model.
        solve: Finds the best design of a problem or a region of several models.
        first: Theta (p,) of the first list; defaults to one within the ranges, of a region to those
            that matter on a grid of its points.
        rounds: Designs at most. If they end before the worst theta is one of the list, it is the
            best of these designs, beside the bound of its list.
    """
    assert question.robust is not None
    assert question.robust.box is not None
    box = question.robust.box

    def own(among: ThetaBox[Any], theta: Array) -> criteria.Criterion:
        return criteria.as_criterion(
            asked, box.parameters, lambda name: places_of(among.model(theta), name)
        )

    grid: ThetaBox[Any] | None = None
    if not first and isinstance(question, Region):
        points = RegionGrid.of(question, GRID).x
        grid = box.among(CandidateSites(points, question.variables, None))
        first = _of_grid(grid, asked)
    known: dict[Any, RelaxedDesign] = {}

    def best(model: Problem | Region, criterion: criteria.Criterion) -> RelaxedDesign:
        if model not in known:
            known[model] = best_weights(model, criterion)
        return known[model]

    def optimum(model: Any, criterion: criteria.Criterion) -> tuple[float, Shares]:
        found = best(model, criterion)
        sites = box if grid is None or isinstance(model, Region) else grid
        return found.cost, _shares(found, sites)

    thetas = list(first) or [box.inside()]
    found: Design | None = None
    highest = 0.0
    for _ in range(rounds):
        listed = box.listed(thetas)
        criterion = criterion_of(asked, listed, lambda model, one: best(model, one).value)
        design = solve(listed, criterion)
        shares = _shares(design, box)
        theta, value = box.worst(shares, own, optimum, thetas, grid)
        of_list = box.values(np.array(thetas), shares, own, optimum).min()
        named = dict(zip(box.names, theta.tolist(), strict=True))
        design = replace(design, worst=WorstTheta(named, value, np.array(thetas), box.what))
        if value >= of_list * (1 - ENOUGH) or not box.is_new(theta, thetas):
            return design
        trials = [theta]
        if found is None or value > highest:
            found, highest = design, value
        else:
            near = shares.mixed(_shares(found, box), NEAR)
            trials.append(box.worst(near, own, optimum, thetas, grid)[0])
        for one in trials:
            if box.is_new(one, thetas):
                thetas.append(one)
    assert found is not None
    return found


def _of_grid(grid: ThetaBox[Problem], asked: CriterionLike) -> list[Array]:
    """Theta that count at the best weights on a grid: those with a part in what proves them.

    Weights on candidates are found many times faster than points of a region.
    """
    found = over_ranges(grid.first(), asked, relax)
    assert found.worst is not None
    thetas = found.worst.thetas
    M = grid.listed(list(thetas)).information(found.weights)
    traces = (found.multipliers.sum(axis=0) * M).sum(axis=0)
    parts = traces.reshape(len(thetas), -1).sum(axis=1)
    return [*thetas[parts > PART * parts.max()]]


def best_weights(
    model: Problem | Region, criterion: criteria.Criterion
) -> Relaxation | RelaxedRegion:
    """The best weights for one model alone."""
    if isinstance(model, Problem):
        return relax(model, criterion)
    return relax_region(model, criterion)


def _shares(design: Any, box: ThetaBox[Any]) -> Shares:
    """How a design shares experiments out."""
    is_whole = isinstance(design, ProblemPlan | RegionPlan)
    numbers = design.counts if is_whole else design.weights
    in_region = isinstance(design, RegionPlan | RelaxedRegion)
    if in_region:
        return Shares.of(design.points, numbers)
    return Shares.of(box.sites.trial, numbers, box.sites.noise)
