"""`edtk.plan` of a problem of arrays or of a region: its arguments, checked."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import criteria
from edtk.design.enclosure.prove_region import prove_region
from edtk.design.errors import Errors, variance_of_effects
from edtk.design.exact import plan_region as exact
from edtk.design.exact.arranged.find_arranged import find_arranged
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import ROUNDING_OF_FUNDS, Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.information import PackedInformation, Rows
from edtk.design.linear_constraints import LinearConstraints
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region
from edtk.system.arguments import is_number
from edtk.system.errors import ArgumentError, finite_numbers, whole_number
from edtk.system.time_limit import Progress
from edtk.system.typing import Array, Indices
from edtk.verbs.asked_limits import (
    Budgets,
    Constraint,
    asked_constraints,
    counts_of_candidates,
    kept_candidates,
    whole_numbers,
)
from edtk.verbs.inputs import CriterionLike
from edtk.verbs.question import seconds_for

MOST_PLACES = 5000  # experiments of a plan: a search looks at each of them in turn


def plan_region(
    region: Region,
    size: int,
    criterion: CriterionLike,
    seed: int,
    starts: int | None,
    keep: Problem | None,
    progress: Progress,
    prove_bound: float | None = None,
) -> RegionPlan:
    """Search for the best plan in a region; the arguments are those of `edtk.plan`.

    Raises:
        ArgumentError: An argument is impossible.
        UserError: So few experiments cannot identify the parameters.
    """
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
    least: ArrayLike | None = None,
    most: ArrayLike | None = None,
    costs: ArrayLike | None = None,
    cost_budget: ArrayLike | None = None,
    constraints: Sequence[Constraint] | None = None,
    blocks: Sequence[int] | None = None,
    block_variance: float = np.inf,
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
    seed, starts = _searched(size, seed, starts)
    sizes = _block_sizes(blocks, block_variance, keep, problem)
    size = _size_of_blocks(sizes, size)
    kept = _Kept.of(keep, problem)
    left = _left(most, kept.counts, problem.n)
    lacking = _lacking(least, kept.counts, left, problem.n)
    linear = asked_constraints(constraints, problem)
    if sizes:
        # Whoever must be in some block may be in any.
        linear = linear.and_also(*_each_at_least(lacking))
        lacking = np.zeros_like(lacking)
    new = _New(lacking, left, Budgets.of(costs, cost_budget, problem.n)).asked(size, kept.number)
    known, base = kept.beside(new.lacking, problem)
    limits = Limits(
        new.m,
        base + _known_before(problem, size),
        new.left,
        *new.prices(sized=size is not None),
        size is not None,
        sizes,
        block_variance,
        new.constrained(linear.shifted(kept.counts + new.lacking)),
    )
    _require_consistent(limits, problem.n)
    given = kept.counts + new.lacking
    found = find_counts(
        problem,
        criterion,
        limits,
        given,
        kept.number - int(kept.counts.sum()),
        seed,
        starts,
        progress,
        prove=None if prove is None else seconds_for(prove),
        known=known,
    )
    return replace(
        found,
        kept=kept.counts,
        least=given if new.lacking.any() else None,
        spent=None if new.budgets is None else new.budgets.spent(found.counts - kept.counts),
    )


def plan_arranged(
    problem: Problem,
    size: int | None = None,
    criterion: CriterionLike = "D",
    seed: int = 0,
    *,
    errors: Errors,
    starts: int | None = None,
    keep: ArrayLike | Problem | None = None,
    most: ArrayLike | None = None,
    progress: Callable[[str, float], object] = lambda label, cost: None,
    **others: object,
) -> ProblemPlan:
    """Search for the best plan of runs in order, whose errors have a structure.

    The arguments are those of `edtk.plan`; no others go with a structure of errors.

    Raises:
        ArgumentError: An argument is impossible, or does not fit another one.
        UserError: So few experiments cannot identify the parameters.
    """
    criterion = criteria.as_criterion(criterion, problem.parameters)
    seed, starts = _searched(size, seed, starts)
    _require_arranged(errors, problem, others)
    m, first, allowed = _runs(errors, size, keep, most, problem)
    return find_arranged(problem, criterion, errors, m, seed, starts, progress, first, allowed)


def _searched(size: object, seed: int, starts: int | None) -> tuple[int, int | None]:
    """Seed and number of starts of a search.

    Raises:
        ArgumentError: One is no such number, or the size is none.
    """
    if size is not None and not is_number(size):
        raise ArgumentError("expected a whole number", argument="size", given=size)
    seed = whole_number(seed, "seed", 0)
    return seed, None if starts is None else whole_number(starts, "starts", 1)


@dataclass(frozen=True, eq=False)
class _Kept:
    """Experiments that every plan has because they are made.

    Attributes:
        counts: How many of each candidate these are (n,).
        experiments: All of them, each once; None for none.
        number: How many.
    """

    counts: Indices
    experiments: Rows | PackedInformation | None
    number: int

    @classmethod
    def of(cls, keep: ArrayLike | Problem | None, problem: Problem) -> "_Kept":
        """Read them: candidates of the problem, or experiments of another one.

        Raises:
            ArgumentError: They are neither, or of other parameters.
        """
        nothing = np.zeros(problem.n, dtype=int)
        if keep is None:
            return cls(nothing, None, 0)
        if isinstance(keep, Problem):
            if keep.p != problem.p:
                message = f"kept experiments have {keep.p} parameters, expected {problem.p}"
                raise ArgumentError(message, argument="keep")
            return cls(nothing, keep.kept, keep.n)
        chosen = kept_candidates(keep, problem.n)
        counts = np.bincount(chosen, minlength=problem.n)
        return cls(counts, problem.kept[chosen], len(chosen))

    def beside(self, lacking: Indices, problem: Problem) -> tuple[Rows | None, Array]:
        """Rows of these and of new ones (n,) that every plan has, and the information without rows.

        Returns:
            Each row of experiments that have some; and the information (p, p) of the others.
        """
        new = problem.kept[np.repeat(np.arange(problem.n), lacking)]
        parts = [part for part in (self.experiments, new) if part is not None and part.n]
        rows = [part.each for part in parts if isinstance(part, Rows)]
        base = np.zeros((problem.p, problem.p))
        for part in parts:
            if isinstance(part, PackedInformation):
                base = base + part.weighted(np.ones(part.n))
        return reduce(add, rows) if rows else None, base


@dataclass(frozen=True, eq=False)
class _New:
    """The new experiments of a plan: those that every plan has, and those to choose beside them.

    Attributes:
        lacking: How many of each candidate every plan has (n,).
        left: How often each may be chosen beside these (n,); None for any number.
        budgets: What may be spent on these; None for anything.
        m: How many are to be chosen.
    """

    lacking: Indices
    left: Indices | None
    budgets: Budgets | None
    m: int = 0

    def asked(self, size: int | None, kept: int) -> "_New":
        """The same with the number of those to choose beside `lacking`, one at least.

        Args:
            size: Number of all experiments; None where the budgets decide.
            kept: Number of kept ones.

        Raises:
            ArgumentError: There is no such number, or it is too large for a search.
        """
        left, budgets, lacking = self.left, self.budgets, self.lacking
        if budgets is not None:
            _require_affordable(lacking, budgets)
            budgets = budgets.without(lacking)
        left = None if left is None else left - lacking
        m = _places(size, kept, lacking, left, budgets)
        if m > 0:
            return _New(lacking, left, budgets, m)
        # All experiments are told: one of them is then the only choice that is left.
        one = np.bincount([int(np.flatnonzero(lacking)[0])], minlength=len(lacking))
        return _New(lacking - one, one, None if budgets is None else budgets.without(-one), 1)

    def prices(self, sized: bool) -> tuple[Array | None, float]:
        """What each candidate costs of a joint budget (n,), and this; none where all is linear."""
        if self.budgets is None or (sized and len(self.budgets.costs) > 1):
            return None, np.inf
        return self.budgets.joint

    def constrained(self, linear: LinearConstraints) -> LinearConstraints | None:
        """Constraints, with several budgets among them; None without any."""
        budgets = self.budgets
        if budgets is not None and len(budgets.costs) > 1:
            # Budgets are about new experiments, and know already what fixed ones cost.
            linear = linear.and_also(budgets.costs, -np.inf, budgets.funds, *budgets.rows.names)
        return linear if len(linear) else None


def _known_before(problem: Problem, size: int | None) -> Array:
    """The information (p, p) of a problem's prior in a plan of so many experiments."""
    if problem.prior is None:
        return np.zeros((problem.p, problem.p))
    if size is None:
        message = "a prior counts per experiment, so that a size is needed beside it"
        raise ArgumentError(message, argument="size")
    return size * problem.prior


def _runs(
    errors: Errors,
    size: int | None,
    keep: ArrayLike | Problem | None,
    most: ArrayLike | None,
    problem: Problem,
) -> tuple[int, Indices, Indices | None]:
    """How many runs in order, those that are made, and how often each candidate may be used.

    Raises:
        ArgumentError: There are too many, or what is made leaves nothing to choose.
    """
    m = errors.size_of(size)
    if m > MOST_PLACES:
        message = f"plans of more than {MOST_PLACES} runs are not searched for"
        raise ArgumentError(message, argument="size", given=m)
    return m, *_first_runs(keep, most, m, problem)


def _size_of_blocks(sizes: tuple[int, ...], size: int | None) -> int | None:
    """The size that was given, or that of the blocks.

    Raises:
        ArgumentError: These differ.
    """
    if sizes and size is not None and sum(sizes) != size:
        message = f"blocks of {sum(sizes)} experiments in all, expected {size}, the size"
        raise ArgumentError(message, argument="blocks")
    return sum(sizes) if sizes and size is None else size


def _require_arranged(errors: object, problem: Problem, others: Iterable[str]) -> None:
    """Check that a plan of runs in order is asked for, and nothing that it does not know."""
    if not isinstance(errors, Errors):
        message = "expected a structure of errors, such as edtk.Errors.split_plot('oven', 6)"
        raise ArgumentError(message, argument="errors")
    for argument in others:
        raise ArgumentError("not for plans with a structure of errors", argument=argument)
    if not isinstance(problem.kept, Rows) or _are_not_as_measured(problem.kept.A):
        message = "errors need the rows of all candidates as measured, as many of each, at most p"
        raise ArgumentError(message, argument="errors")


def _first_runs(
    keep: ArrayLike | Problem | None, most: ArrayLike | None, m: int, problem: Problem
) -> tuple[Indices, Indices | None]:
    """The candidates (k,) of the first runs, which are made, and how often each may be used (n,).

    Raises:
        ArgumentError: They are none, or leave nothing to choose.
    """
    if isinstance(keep, Problem):
        message = "expected the candidates of the first runs in order, as indices"
        raise ArgumentError(message, argument="keep")
    made = _Kept.of(keep, problem)
    counts, number = made.counts, made.number
    if number >= m:
        raise ArgumentError(f"{number} runs are made, expected fewer than {m}", argument="keep")
    left = _left(most, counts, problem.n)
    if left is not None and left.sum() < m - number:
        message = f"allows {left.sum()} more runs, expected {m - number} or more"
        raise ArgumentError(message, argument="most")
    first = np.zeros(0, dtype=int) if keep is None else np.asarray(keep, dtype=int)
    return first, None if left is None else left + counts


def _block_sizes(
    blocks: Sequence[int] | None, variance: float, keep: object, problem: Problem
) -> tuple[int, ...]:
    """Sizes of the blocks; none without blocks."""
    variance_of_effects(variance, "block_variance")
    if blocks is None:
        if np.isfinite(variance):
            raise ArgumentError("expected blocks beside it", argument="block_variance")
        return ()
    given = finite_numbers(blocks, "blocks")
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


def _left(most: ArrayLike | None, kept: Indices, n: int) -> Indices | None:
    """How often each candidate may still be chosen (n,)."""
    if most is None:
        return None
    given = whole_numbers(most)
    if given is None or given.shape not in ((), (n,)):
        message = f"expected a whole number, or one for each of {n} candidates"
        raise ArgumentError(message, argument="most")
    left = np.broadcast_to(given, (n,)) - kept
    if (left < 0).any():
        first = int(np.flatnonzero(left < 0)[0])
        message = f"candidate {first} is kept {kept[first]} times, which is more"
        raise ArgumentError(message, argument="most")
    return left


def _lacking(least: ArrayLike | None, kept: Indices, left: Indices | None, n: int) -> Indices:
    """How many new experiments of each candidate every plan has (n,).

    Raises:
        ArgumentError: They are no whole numbers, or more than are allowed.
    """
    if least is None:
        return np.zeros(n, dtype=int)
    given = counts_of_candidates(least, n, "least")
    if (given != np.round(given)).any():
        raise ArgumentError("expected whole numbers", argument="least")
    new = np.maximum(given - kept, 0)
    if (new > MOST_PLACES).any():
        i = int(np.flatnonzero(new > MOST_PLACES)[0])
        message = f"candidate {i}: asks for more than {MOST_PLACES:,} new experiments"
        raise ArgumentError(message, argument="least")
    lacking = new.astype(int)
    if left is not None and (lacking > left).any():
        i = int(np.flatnonzero(lacking > left)[0])
        message = f"candidate {i}: {int(given[i])} or more, but most allows {left[i] + kept[i]}"
        raise ArgumentError(message, argument="least")
    return lacking


def _each_at_least(lacking: Indices) -> tuple[Any, ...]:
    """Least counts (n,) as constraints."""
    some = np.flatnonzero(lacking)
    names = (f"least of candidate {i}" for i in some)
    return (np.eye(len(lacking))[some], lacking[some], np.inf, *names)


def _require_affordable(lacking: Indices, budgets: Budgets) -> None:
    """Check that the experiments that every plan has are within the budgets."""
    for cost, own in zip(budgets.costs @ lacking, budgets.funds, strict=True):
        if cost > own * (1 + ROUNDING_OF_FUNDS):
            message = f"the experiments that least asks for cost {cost:g}"
            raise ArgumentError(message, argument="cost_budget", given=f"{own:g}")


def _require_consistent(limits: Limits, n: int) -> None:
    """Check that some plan obeys all constraints; name those that contradict each other."""
    if limits.linear is None:
        return
    clash = limits.rows(n).conflict(np.zeros(n), limits.largest(n), integral=True)
    if clash:
        beside = " within most" if limits.most is not None else ""
        message = f"no plan of whole experiments{beside} obeys {' and '.join(clash)}"
        raise ArgumentError(f"{message} together", argument="constraints")


def _places(
    size: int | None,
    kept: int,
    lacking: Indices,
    left: Indices | None,
    budgets: Budgets | None,
) -> int:
    """Number of new experiments to choose, or the largest number where the budgets decide.

    Args:
        size: Number of all experiments.
        kept: Number of kept ones.
        lacking: New experiments (n,) that every plan has.
        left: How often each candidate may be chosen beside them (n,).
        budgets: What is left to spend.

    Returns:
        The number; zero where no choice is left.

    Raises:
        ArgumentError: There is no such number, or it is too large for a search.
    """
    if size is None and budgets is None:
        message = "expected the number of experiments, or costs and a cost_budget"
        raise ArgumentError(message, argument="size")
    if size is not None and not abs(size) < np.inf:
        raise ArgumentError("expected a whole number", argument="size", given=size)
    fixed = int(lacking.sum())
    new = fixed + _most_affordable(left, budgets) if size is None else int(size) - kept
    if size is not None and (new != size - kept or new < 1):
        beside = f" beside {kept} kept experiments" if kept else ""
        raise ArgumentError(f"expected one or more{beside}", argument="size", given=size)
    if new < fixed:
        message = f"asks for {fixed} new experiments, expected {new} or fewer"
        raise ArgumentError(message, argument="least")
    if left is not None and left.sum() + fixed < new:
        message = f"allows {left.sum() + fixed} new experiments, expected {new} or more"
        raise ArgumentError(message, argument="most")
    if budgets is not None and size is not None:
        _require_cheap(left, budgets, new, fixed)
    if new < 1:
        assert budgets is not None
        message = f"the cheapest candidate costs {np.min(budgets.costs):g}"
        raise ArgumentError(message, argument="cost_budget", given=f"{budgets.funds.min():g}")
    if new > MOST_PLACES:
        message = f"plans of more than {MOST_PLACES} experiments are not searched for, here {new}"
        raise ArgumentError(message, argument="cost_budget" if size is None else "size")
    return new - fixed


def _require_cheap(left: Indices | None, budgets: Budgets, new: int, fixed: int) -> None:
    """Check that each budget alone allows so many experiments beside fixed ones."""
    for prices, funds in zip(budgets.costs, budgets.funds, strict=True):
        least = _cheapest(left, prices, new - fixed)
        if least > funds * (1 + ROUNDING_OF_FUNDS):
            message = f"{new - fixed} new experiments cost {least:g} or more"
            raise ArgumentError(message, argument="cost_budget", given=f"{funds:g}")


def _most_affordable(left: Indices | None, budgets: Budgets | None) -> int:
    """The largest number of experiments that the joint budget allows, which is none too few."""
    assert budgets is not None
    return _affordable(left, *budgets.joint)


def _affordable(left: Indices | None, prices: Array, funds: float) -> int:
    """The largest number of experiments that the funds allow."""
    order = np.argsort(prices, kind="stable")
    allowed = np.floor(funds * (1 + ROUNDING_OF_FUNDS) / prices)
    if left is not None:
        allowed = np.minimum(allowed, left)
    number = 0
    for i in order:
        bought = int(min(allowed[i], np.floor(funds * (1 + ROUNDING_OF_FUNDS) / prices[i])))
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
