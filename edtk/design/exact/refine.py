"""Plans that are improved by exchanges of places and by descents in turn, and made tidy."""

from collections.abc import Callable

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import Candidates
from edtk.design.design_space import DesignSpace, Points, Space, plan_costs
from edtk.design.exact.apportion import apportion, best_repeats
from edtk.design.exact.day import POSE_DIGITS
from edtk.design.exact.exchange import exchange
from edtk.design.exact.round_poses import round_plan
from edtk.design.exact.search_record import FINE, Answer, Descent, Plans, Search
from edtk.design.information import distinct
from edtk.design.interior_point.descend import descend
from edtk.design.problem import Problem
from edtk.design.relaxation.settle import LogCost
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

SHARPNESS = (10.0, 50.0, 250.0)  # of the soft maxima for criteria with kinks, in turn
# The first descent begins far from the constraints. A later one begins near an optimum, from which
# a large barrier would only drive it away.
FIRST_BARRIER = 0.03
LATER_BARRIER = 0.003
# Relative improvement by new places for which repetitions are distributed anew.
EXCHANGE_GAIN = 1e-9
# Relative differences of information up to which poses become one, the boldest first: poses that
# have drifted apart without gain are farther from each other than those of an accurate optimum.
ALIKE = (0.03, 0.003, 1e-4)
LOSS_FOR_FEWER_POSES = 1e-6  # relative increase of the cost at which fewer poses are still welcome
LAST_STEPS = 100  # steps of the last descent
SHARPEST = (1000.0, 4000.0)  # its soft maxima, within 4e-4 of the criterion and less
# Rounds of refinement, with an exchange between them. The last exchange still improved the best
# plan by 1e-4 in a quarter of 36 batches; more gain is left to the next batch.
REFINE_ROUNDS = 4
REFINE_GAIN = 1e-6  # relative improvement for which another round is made


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
    # Batches begin with one rounded design, and what a plan comes to is the same in any company.
    plans = np.concatenate([x.reshape(len(x), -1), repeats], axis=1)
    _, first, of = np.unique(plans, axis=0, return_index=True, return_inverse=True)
    if len(first) < len(x):
        moved, costs = refine(space, criterion, x[first], repeats[first], iterations, sharpness)
        return moved[of.reshape(-1)], costs[of.reshape(-1)]
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
    return np.where(feasible, plan_costs(criterion, experiments, repeats), np.inf)


def exchange_in_turn(
    problem: Problem, criterion: Criterion, places: Indices, repeats: Array, thorough: bool = True
) -> tuple[Indices, Array]:
    """Exchange places and redistribute repetitions, until neither improves a plan.

    Args:
        problem: The candidates.
        criterion: The criterion to improve.
        places: Indices of the candidates (b, k) of b plans.
        repeats: Whole numbers of measurements (b, k).
        thorough: See `exchange`.

    Returns:
        Places (b, k) and repetitions (b, k) of the same sums.
    """
    places = places.copy()
    repeats = repeats.copy()
    costs = np.full(len(places), np.inf)
    left = np.arange(len(places))
    while len(left):
        places[left], reached = exchange(
            problem, criterion, places[left], repeats[left], thorough=thorough
        )
        improved = reached < costs[left] * (1 - EXCHANGE_GAIN)
        # With one measurement a place, a new distribution is the same as an exchange of places.
        repeated = repeats[left].sum(axis=1) > places.shape[1]
        costs[left] = reached
        left = left[improved & repeated & (not out_of_time())]
        for i in left:
            blocks = problem.blocks(places[i])
            repeats[i] = best_repeats(criterion, blocks, repeats[i], problem.prior)
    return places, repeats


def draw_starts(
    criterion: Criterion,
    m: int,
    places: int,
    support: Candidates,
    weights: Array,
    fresh: Candidates,
    size: int,
    seed: tuple[int, ...],
) -> Plans:
    """Draw plans of m experiments from which a search may start.

    The first plan is the relaxed design, rounded by efficient apportionment, whatever the seed. Of
    the others every second one is exchanged, every fourth has places drawn by weight, and every
    fourth has random places.

    Args:
        criterion: The criterion that the exchange improves.
        m: Number of experiments.
        places: Number of places in a plan, at most m.
        support: Experiments of the relaxed design.
        weights: Their weights.
        fresh: Further experiments to choose from.
        size: Number of plans.
        seed: Seed.
    """
    rng = np.random.default_rng(seed)
    pool = support + fresh
    even = apportion(np.ones(places), m).astype(float)
    heaviest = np.argsort(-weights, kind="stable")[:places]
    chosen = [_draw_places(rng, i, weights, len(pool.x), places) for i in range(1, size)]
    indices = np.array([np.resize(heaviest, places), *chosen])
    times = np.array([_rounded(weights, m, places), *[even] * (size - 1)])
    # Starts are refined afterwards, so that a look at all candidates would be wasted on them.
    indices[1::2], times[1::2] = exchange_in_turn(
        pool.problem, criterion, indices[1::2], times[1::2], thorough=False
    )
    return Plans(pool.x[indices], times)


def _draw_places(
    rng: np.random.Generator, number: int, weights: Array, candidates: int, places: int
) -> Indices:
    """Indices (places,) of the plan of this number, among so many candidates, the support first."""
    # Both are drawn for every plan, so that its random numbers do not depend on the others' kind.
    by_weight = rng.choice(len(weights), size=places, p=weights)
    anywhere = rng.choice(candidates, size=places)
    return by_weight if number % 4 == 0 else anywhere


def _rounded(weights: Array, m: int, places: int) -> Array:
    """Apportionment (places,) of m experiments to the heaviest places; zero beyond the support."""
    heaviest = np.sort(weights)[::-1][:places]
    return np.pad(apportion(heaviest, m), (0, places - len(heaviest))).astype(float)


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
    shares = space.shares_errors
    for alike in () if shares else ALIKE:
        kept, fewer = _merged(space, x, repeats, alike)
        if len(kept) == len(x):
            continue
        moved, costs = refine(space, criterion, x[kept][None], fewer[None])
        if costs[0] <= cost * (1 + LOSS_FOR_FEWER_POSES):
            x = moved[0]
            repeats = fewer
            break
    x = refine(space, criterion, x[None], repeats[None], LAST_STEPS, SHARPEST)[0][0]
    x, repeats = round_plan(space, criterion, x, repeats, merge=not shares)
    order = np.lexsort((*np.round(x.T[::-1], POSE_DIGITS), -repeats))
    return x[order], repeats[order]


def _merged(space: DesignSpace, x: Array, repeats: Array, alike: float) -> tuple[Indices, Array]:
    """Indices of poses (k, v) that differ, and their repetitions with those of poses like them.

    Loads of a list have prices of their own: visits under one take no place of another's.
    """
    problem = space.problem(x)
    blocks = problem.blocks()
    T = range_whitener(problem.mean)
    whitened = (T.T @ blocks @ T).reshape(problem.n, -1)
    loads = np.zeros(len(x)) if space.load.moves else space.load_of(x)
    kept: list[int] = []
    fewer = repeats.copy()
    for load in np.unique(loads):
        own = np.flatnonzero(loads == load)
        differ = own[distinct(blocks[own], T, alike)]
        owner = np.linalg.norm(whitened[own, None] - whitened[differ], axis=-1).argmin(axis=1)
        fewer[differ] = np.bincount(owner, weights=repeats[own])
        kept += differ.tolist()
    kept.sort()
    return np.array(kept), fewer[kept]


def exchange_and_refine(
    space: DesignSpace,
    criterion: Criterion,
    first: Answer,
    fresh: Callable[[int], Candidates],
) -> Search:
    """Exchange places of plans and refine them, as long as one of the plans becomes better.

    A place may be exchanged for a fresh candidate, or for a place of another plan.

    Args:
        space: Model and feasible set.
        criterion: The criterion to improve.
        first: Costs (b,) of the plans, and the plans.
        fresh: The candidates of each turn.

    Yields:
        Descents; costs and plans at their ends are sent back.

    Returns:
        Costs (b,), the best first, and the plans.
    """
    costs, plans = first
    for turn in range(1, REFINE_ROUNDS):
        if out_of_time():
            break
        exchanged = _exchanged(space, criterion, plans, fresh(turn))
        reached, exchanged = yield Descent(exchanged, FINE)
        better = reached < costs * (1 - REFINE_GAIN)
        if not better.any():
            break
        costs = np.where(better, reached, costs)
        plans = plans.replaced(better, exchanged)
    order = np.argsort(costs, kind="stable")
    return costs[order], plans[order]


def _exchanged(space: DesignSpace, criterion: Criterion, plans: Plans, fresh: Candidates) -> Plans:
    """Plans after repetitions were moved and places exchanged, wherever that helps."""
    own = plans.x.reshape(-1, plans.x.shape[-1])
    pool = Candidates(own, space.problem(own)) + fresh
    places = np.arange(len(own)).reshape(plans.repeats.shape)
    repeats = _best_repeats(criterion, pool, places, plans.repeats)
    places, repeats = exchange_in_turn(pool.problem, criterion, places, repeats)
    return Plans(pool.x[places], repeats)


def _best_repeats(criterion: Criterion, pool: Candidates, places: Indices, repeats: Array) -> Array:
    """Best repetitions (b, k) of plans at fixed places of the pool (b, k)."""
    prior = pool.problem.prior
    blocks = pool.problem.blocks(places)
    return np.array(
        [
            best_repeats(criterion, own, times, prior)
            for own, times in zip(blocks, repeats, strict=True)
        ]
    )
