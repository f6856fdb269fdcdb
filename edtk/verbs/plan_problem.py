"""`edtk.plan` of a problem of arrays or of a region: its arguments, checked."""

from collections.abc import Callable, Sequence
from functools import partial
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

import criteria
from edtk.design.enclosure.prove_region import prove_region
from edtk.design.errors import Errors
from edtk.design.exact import plan_region as exact
from edtk.design.exact.arranged.find_arranged import find_arranged
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import ROUNDING, Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.information import PackedInformation, Rows
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region
from edtk.study.plan_study import Progress
from edtk.system.errors import ArgumentError, whole_number
from edtk.system.typing import Array, Indices
from edtk.verbs.inputs import CriterionLike
from edtk.verbs.question import seconds_for

MOST_PLACES = 5000  # experiments of a plan: a search looks at each of them in turn


def plan_region(
    region: Region,
    size: int,
    criterion: CriterionLike,
    seed: int,
    starts: int | None,
    keep: object,
    progress: Progress,
    prove_bound: float | None = None,
) -> RegionPlan:
    """Search for the best plan in a region; the arguments are those of `edtk.plan`.

    Raises:
        ArgumentError: An argument is impossible.
        UserError: So few experiments cannot identify the parameters.
    """
    if keep is not None and not isinstance(keep, Problem):
        raise ArgumentError("expected a Problem of the experiments at hand", argument="keep")
    criterion = criteria.as_criterion(criterion, region.parameters)
    number = None if starts is None else whole_number(starts, "starts", 1)
    return exact.plan_region(
        region,
        whole_number(size, "size", 1),
        criterion,
        whole_number(seed, "seed", 0),
        number,
        keep,
        progress,
        relax_region if prove_bound is None else partial(prove_region, eps=prove_bound),
    )


def plan_problem(
    problem: Problem,
    size: int | None = None,
    criterion: CriterionLike = "D",
    seed: int = 0,
    *,
    starts: int | None = None,
    keep: ArrayLike | Problem | None = None,
    most: ArrayLike | None = None,
    costs: ArrayLike | None = None,
    cost_budget: float | None = None,
    blocks: Sequence[int] | None = None,
    block_variance: float = np.inf,
    errors: Errors | None = None,
    prove: float | None = None,
    progress: Callable[[str, float], object] = lambda label, cost: None,
) -> ProblemPlan:
    """Search for the best plan of whole experiments on the candidates of a problem.

    The arguments are those of `edtk.plan`.

    Raises:
        ArgumentError: An argument is impossible, or does not fit another one.
        UserError: So few experiments cannot identify the parameters.
    """
    criterion = criteria.as_criterion(criterion, problem.parameters)
    if size is not None and not _is_number(size):
        raise ArgumentError("expected a whole number", argument="size", given=size)
    seed = whole_number(seed, "seed", 0)
    starts = None if starts is None else whole_number(starts, "starts", 1)
    if errors is not None:
        beside: dict[str, object] = {
            "keep": keep,
            "most": most,
            "costs": costs,
            "cost_budget": cost_budget,
        }
        beside |= {"blocks": blocks, "prove": prove}
        _require_arranged(errors, problem, beside)
        m = errors.size_of(size)
        if m > MOST_PLACES:
            message = f"plans of more than {MOST_PLACES} runs are not searched for"
            raise ArgumentError(message, argument="size", given=m)
        return find_arranged(problem, criterion, errors, m, seed, starts, progress)
    sizes = _block_sizes(blocks, block_variance, keep, problem)
    if sizes and size is None:
        size = sum(sizes)
    if sizes and sum(sizes) != size:
        message = f"blocks of {sum(sizes)} experiments in all, expected {size}, the size"
        raise ArgumentError(message, argument="blocks")
    kept, experiments, number = _kept(keep, problem)
    left = _left(most, kept, problem.n)
    prices, funds = _funds(costs, cost_budget, kept, problem.n)
    m = _places(size, number, left, prices, funds)
    known, base = _as_rows(experiments, problem.p)
    if problem.prior is not None:
        if size is None:
            message = "a prior counts per experiment, so that a size is needed beside it"
            raise ArgumentError(message, argument="size")
        base = base + size * problem.prior
    limits = Limits(m, base, left, prices, funds, size is not None, sizes, block_variance)
    return find_counts(
        problem,
        criterion,
        limits,
        kept,
        number - int(kept.sum()),
        seed,
        starts,
        progress,
        prove=None if prove is None else seconds_for(prove),
        known=known,
    )


def _require_arranged(errors: object, problem: Problem, beside: dict[str, object]) -> None:
    """Check that a plan of runs in order is asked for, and nothing that it does not know."""
    if not isinstance(errors, Errors):
        message = "expected a structure of errors, such as edtk.Errors.split_plot('oven', 6)"
        raise ArgumentError(message, argument="errors")
    for argument, given in beside.items():
        if given is not None:
            raise ArgumentError("not for plans with a structure of errors", argument=argument)
    if not isinstance(problem.kept, Rows) or _are_not_as_measured(problem.kept.A):
        message = "errors need the rows of all candidates as measured, as many of each, at most p"
        raise ArgumentError(message, argument="errors")


def _block_sizes(
    blocks: Sequence[int] | None, variance: float, keep: object, problem: Problem
) -> tuple[int, ...]:
    """Sizes of the blocks; none without blocks."""
    if not (_is_number(variance) and variance > 0):
        raise ArgumentError("expected above 0", argument="block_variance", given=variance)
    if blocks is None:
        if np.isfinite(variance):
            raise ArgumentError("expected blocks beside it", argument="block_variance")
        return ()
    given = _numbers(blocks, "blocks")
    sizes = tuple(int(b) for b in given.ravel())
    if given.ndim != 1 or not sizes or (given < 1).any() or (given != sizes).any():
        raise ArgumentError("expected sizes of blocks, whole and positive", argument="blocks")
    if keep is not None:
        message = "experiments cannot be kept where others are put in blocks"
        raise ArgumentError(message, argument="keep")
    if not isinstance(problem.kept, Rows) or _are_not_as_measured(problem.kept.A):
        message = "blocks need the rows of all candidates as measured, as many of each, at most p"
        raise ArgumentError(message, argument="blocks")
    return sizes


def _are_not_as_measured(A: Array) -> bool:
    """Whether rows (n, r, p) were turned into p triangular ones, or filled with rows of zeros.

    Signs of the former tell nothing. The latter were not measured, and have no effect of a block.
    """
    _, r, p = A.shape
    triangular = r == p > 1 and not np.tril(A, -1).any()
    return triangular or (r > 1 and not A.any(axis=2).all())


def _kept(
    keep: ArrayLike | Problem | None, problem: Problem
) -> tuple[Indices, Rows | PackedInformation | None, int]:
    """Counts (n,) of kept candidates, all kept experiments, each once, and their number."""
    nothing = np.zeros(problem.n, dtype=int)
    if keep is None:
        return nothing, None, 0
    if isinstance(keep, Problem):
        if keep.p != problem.p:
            message = f"kept experiments have {keep.p} parameters, expected {problem.p}"
            raise ArgumentError(message, argument="keep")
        return nothing, keep.kept, keep.n
    chosen = np.asarray(keep)
    if chosen.shape == (0,):
        chosen = chosen.astype(int)
    whole = chosen.ndim == 1 and np.issubdtype(chosen.dtype, np.integer)
    if not whole or not ((chosen >= 0) & (chosen < problem.n)).all():
        message = f"expected indices of candidates, from 0 to {problem.n - 1}, or a Problem"
        raise ArgumentError(message, argument="keep")
    return np.bincount(chosen, minlength=problem.n), problem.kept[chosen], len(chosen)


def _as_rows(experiments: Rows | PackedInformation | None, p: int) -> tuple[Array | None, Array]:
    """Rows (k, p) of experiments that have some, and the information (p, p) of those without."""
    if isinstance(experiments, Rows):
        return experiments.flat, np.zeros((p, p))
    if experiments is None or not experiments.n:
        return None, np.zeros((p, p))
    return None, experiments.weighted(np.ones(experiments.n))


def _left(most: ArrayLike | None, kept: Indices, n: int) -> Indices | None:
    """How often each candidate may still be chosen (n,)."""
    if most is None:
        return None
    given = np.asarray(most)
    if given.shape not in ((), (n,)) or not np.issubdtype(given.dtype, np.integer):
        message = f"expected a whole number, or one for each of {n} candidates"
        raise ArgumentError(message, argument="most")
    left = np.broadcast_to(given, (n,)) - kept
    if (left < 0).any():
        first = int(np.flatnonzero(left < 0)[0])
        message = f"candidate {first} is kept {kept[first]} times, which is more"
        raise ArgumentError(message, argument="most")
    return left


def _funds(
    costs: ArrayLike | None, budget: float | None, kept: Indices, n: int
) -> tuple[Array | None, float]:
    """Costs (n,) of the candidates, and what the new experiments may cost together."""
    if costs is None and budget is None:
        return None, np.inf
    if costs is None or budget is None:
        missing, given = ("costs", "cost_budget") if costs is None else ("cost_budget", "costs")
        raise ArgumentError(f"expected beside {given}", argument=missing)
    prices = _numbers(costs, "costs")
    if prices.shape != (n,) or not (np.isfinite(prices) & (prices > 0)).all():
        message = f"expected a positive number for each of {n} candidates"
        raise ArgumentError(message, argument="costs")
    if not (_is_number(budget) and np.isfinite(budget) and budget > 0):
        raise ArgumentError("expected above 0", argument="cost_budget", given=budget)
    return prices, float(budget)


def _is_number(given: object) -> bool:
    return isinstance(given, Real)


def _numbers(given: object, argument: str) -> Array:
    """An argument as an array of finite numbers.

    Raises:
        ArgumentError: It is none.
    """
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise ArgumentError("expected numbers", argument=argument) from error
    if not np.isfinite(found).all():
        raise ArgumentError("expected finite numbers", argument=argument)
    return found


def _places(
    size: int | None, kept: int, left: Indices | None, prices: Array | None, funds: float
) -> int:
    """Number of new experiments, or the largest number where the funds decide.

    Raises:
        ArgumentError: There is no such number, or it is too large for a search.
    """
    if size is None and prices is None:
        message = "expected the number of experiments, or costs and a cost_budget"
        raise ArgumentError(message, argument="size")
    if size is not None and not np.isfinite(size):
        raise ArgumentError("expected a whole number", argument="size", given=size)
    m = _affordable(left, prices, funds) if size is None else int(size) - kept
    if size is not None and (m != size - kept or m < 1):
        beside = f" beside {kept} kept experiments" if kept else ""
        raise ArgumentError(f"expected one or more{beside}", argument="size", given=size)
    if left is not None and left.sum() < m:
        message = f"allows {left.sum()} new experiments, expected {m} or more"
        raise ArgumentError(message, argument="most")
    if prices is not None and size is not None:
        least = _cheapest(left, prices, m)
        if least > funds * (1 + ROUNDING):
            message = f"{m} new experiments cost {least:g} or more"
            raise ArgumentError(message, argument="cost_budget", given=funds)
    if m < 1:
        message = f"the cheapest candidate costs {np.min(prices):g}"  # type: ignore[arg-type]
        raise ArgumentError(message, argument="cost_budget", given=funds)
    if m > MOST_PLACES:
        message = f"plans of more than {MOST_PLACES} experiments are not searched for, here {m}"
        raise ArgumentError(message, argument="cost_budget" if size is None else "size")
    return m


def _affordable(left: Indices | None, prices: Array | None, funds: float) -> int:
    """The largest number of experiments that the funds allow."""
    assert prices is not None
    order = np.argsort(prices, kind="stable")
    allowed = np.floor(funds * (1 + ROUNDING) / prices)
    if left is not None:
        allowed = np.minimum(allowed, left)
    number = 0
    for i in order:
        bought = int(min(allowed[i], np.floor(funds * (1 + ROUNDING) / prices[i])))
        number += bought
        funds -= bought * prices[i]
        if number > MOST_PLACES or bought < allowed[i]:
            break
    return number


def _cheapest(left: Indices | None, prices: Array, m: int) -> float:
    """The least cost of m experiments."""
    ordered = np.sort(prices)
    if left is None:
        return float(m * ordered[0])
    times = np.minimum(left[np.argsort(prices, kind="stable")], m)
    return float(np.repeat(ordered, times)[:m].sum())
