"""What a criterion means for several models at once: their mean, or the worst of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import block_diag

import criteria
from criteria.linalg.inverse import TINY
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
from edtk.system.time_limit import Progress, no_progress
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
    progress: Progress = no_progress,
    plans: int | None = None,
) -> Design:
    """The design whose worst theta within ranges is the best, see `edtk.design.theta_box`.

    The first list has one theta within the ranges; of a region those that matter on a grid of its
    points, and of plans those of the best weights.

    Args:
        question: The problem or the region of a model with ranges.
        asked: The criterion of one model.
        solve: Finds the best design of a problem or a region of several models.
        progress: Called with a line about the current step, and a number that goes with it.
        plans: Plans at most, each of which is a search of its own; None where `solve` finds
            weights.
    """
    assert question.robust is not None
    assert question.robust.box is not None
    ranges = _Ranges(question.robust.box, None, asked, progress)
    thetas = [ranges.box.inside()]
    if isinstance(question, Region):
        points = RegionGrid.of(question, GRID).x
        grid = ranges.box.among(CandidateSites(points, question.variables, None))
        on_grid = replace(ranges, box=grid)
        thetas, _ = on_grid.that_count(on_grid.served(relax, thetas))
        ranges = replace(ranges, grid=grid)
    if plans is None:
        return ranges.served(solve, thetas)
    weights = ranges.served(partial(best_weights, progress=progress), thetas)
    assert weights.worst is not None
    return ranges.served(solve, list(weights.worst.thetas), plans)


@dataclass(frozen=True, eq=False)
class _Ranges:
    """A model with ranges of theta, and the best weights of each theta that was tried.

    Attributes:
        box: The ranges.
        grid: The same for a grid of points, where the box is that of a region; else None. Weights
            on candidates are found many times faster than points of a region.
        asked: The criterion of one model.
        progress: See `over_ranges`.
        known: The best weights of each model alone.
    """

    box: ThetaBox[Any]
    grid: ThetaBox[Problem] | None
    asked: CriterionLike
    progress: Progress
    known: dict[Any, RelaxedDesign] = field(default_factory=dict)

    def own(self, among: ThetaBox[Any], theta: Array) -> criteria.Criterion:
        """The criterion of the model at one theta."""
        return criteria.as_criterion(
            self.asked, among.parameters, lambda name: places_of(among.model(theta), name)
        )

    def best(self, model: Problem | Region, criterion: criteria.Criterion) -> RelaxedDesign:
        """The best weights for one model alone."""
        if model not in self.known:
            self.known[model] = best_weights(model, criterion, self.progress)
            self.progress("theta alone", len(self.known))
        return self.known[model]

    def optimum(self, model: Any, criterion: criteria.Criterion) -> tuple[float, Shares]:
        """Cost of the best weights for one model alone, and how they share experiments out."""
        found = self.best(model, criterion)
        sites = self.box if self.grid is None or isinstance(model, Region) else self.grid
        return found.cost, _shares(found, sites)

    def served(
        self,
        solve: Callable[[Any, criteria.Criterion], Design],
        first: Sequence[Array],
        rounds: int = ROUNDS,
    ) -> Design:
        """The design whose worst theta is the best.

        Args:
            solve: Finds the best design for several models.
            first: Theta (p,) of the first list.
            rounds: Designs at most. If they end before the worst theta is one of the list, it is
                the best of these designs, beside the bound of its list.
        """
        judges = (self.own, self.optimum)
        thetas = list(first)
        found: Design | None = None
        highest = 0.0
        for _ in range(rounds):
            listed = self.box.listed(thetas)
            criterion = criterion_of(self.asked, listed, lambda *own: self.best(*own).value)
            design = solve(listed, criterion)
            shares = _shares(design, self.box)
            theta, value = self.box.worst(shares, *judges, thetas, self.grid)
            named = dict(zip(self.box.names, theta.tolist(), strict=True))
            worst = WorstTheta(named, value, np.array(thetas), self.box.what)
            design = replace(design, worst=worst)
            of_list = self.box.values(np.array(thetas), shares, *judges).min()
            worse = (of_list - value) / max(of_list, TINY)
            self.progress(f"{len(thetas)} theta together", float(worse))
            if value >= of_list * (1 - ENOUGH) or not self.box.is_new(theta, thetas):
                return design
            trials = [theta]
            if isinstance(design, RelaxedRegion):  # on candidates rounds are cheap, long lists not
                trials.append(self.box.between(theta, *self.that_count(design)))
            if found is None or value > highest:
                found, highest = design, value
            else:
                near = shares.mixed(_shares(found, self.box), NEAR)
                trials.append(self.box.worst(near, *judges, thetas, self.grid)[0])
            for one in trials:
                if self.box.is_new(one, thetas):
                    thetas.append(one)
        assert found is not None
        return found

    def that_count(self, design: Relaxation | RelaxedRegion) -> tuple[list[Array], Array]:
        """The theta of its list that have a part in what proves a design, and these parts (k,)."""
        assert design.worst is not None
        thetas = design.worst.thetas
        listed = self.box.listed(list(thetas))
        sites = listed.problem(design.points) if isinstance(design, RelaxedRegion) else listed
        traces = design.multipliers.sum(axis=0) * sites.information(design.weights)
        parts = traces.sum(axis=0).reshape(len(thetas), -1).sum(axis=1)
        counts = parts > PART * parts.max()
        if not counts.any():  # such as where nothing is proved: all theta alike
            return [*thetas], np.ones(len(thetas))
        return [*thetas[counts]], parts[counts]


def best_weights(
    model: Problem | Region, criterion: criteria.Criterion, progress: Progress = no_progress
) -> Relaxation | RelaxedRegion:
    """The best weights for one model alone."""
    if isinstance(model, Problem):
        return relax(model, criterion)
    return relax_region(model, criterion, progress=progress)


def _shares(design: Any, box: ThetaBox[Any]) -> Shares:
    """How a design shares experiments out."""
    is_whole = isinstance(design, ProblemPlan | RegionPlan)
    numbers = design.counts if is_whole else design.weights
    in_region = isinstance(design, RegionPlan | RelaxedRegion)
    if in_region:
        return Shares.of(design.points, numbers)
    return Shares.of(box.sites.trial, numbers, box.sites.noise)
