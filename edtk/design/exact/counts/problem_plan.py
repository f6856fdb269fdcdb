"""A plan of whole experiments on the candidates of a problem, its bound, and its cheapest order."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.criterion import printed
from edtk.design.bound import HEADLINE, VISIBLE, Bound, BoundedDesign, BoundKind
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem
from edtk.design.tours import BEST_UP_TO, cheap_tour, cheapest_possible
from edtk.system.errors import ArgumentError, finite_numbers, whole_number
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.exact.prove_exact import ExactProof
    from edtk.design.theta_box import WorstTheta


# Costs (n, n) of the way from each candidate to each other one; a function of two candidates; or,
# for columns of a data frame, the cost of any change, or a function of two levels.
Transition = ArrayLike | Callable[[Any, Any], float] | Mapping[str, Any]
EQUAL = 1e-9  # relative difference of sums that is rounding


@dataclass(frozen=True, eq=False)
class PlanOrder(Presented):
    """The experiments of a plan in an order, and what the changes between them cost.

    Attributes:
        problem: The candidates.
        experiments: The candidates (m,) in order.
        changes: Cost (m,) of the change before each experiment; of the first one that from where
            the order begins, or zero.
        bound: No order costs less.
        proved: Whether that is the cost of this one.
    """

    problem: Problem
    experiments: Indices
    changes: Array
    bound: float
    proved: bool

    @property
    def cost(self) -> float:
        """What all changes cost."""
        return float(self.changes.sum())

    def headline(self) -> str:
        """Number of experiments, cost, and how much less any order can cost."""
        words = "none costs less" if self.proved else f"none costs less than {self.bound:.6g}"
        return f"{len(self.experiments)} experiments, changes cost {self.cost:.6g}; {words}"

    def to_frame(self) -> "pd.DataFrame":
        """A table with an experiment a row, in order: its settings, and the cost of the change.

        The index counts the experiments from 1.
        """
        import pandas as pd

        frame = self.problem.settings(self.experiments)
        name = "change"
        while name in frame.columns:
            name += "_"
        frame[name] = self.changes
        frame.index = pd.RangeIndex(1, len(frame) + 1, name="run")
        return frame


def order_plan(
    problem: Problem, blocks: Sequence[Indices], transition: Transition, begin: int | None
) -> PlanOrder:
    """Put experiments in a cheap order; blocks stay one after another.

    Repeats of a candidate follow each other where nothing is cheaper by way of others, which is so
    if costs obey the triangle inequality.

    Args:
        problem: The candidates.
        blocks: Candidates of the experiments of each block, each as often as it is measured.
        transition: What changes cost, see `Transition`.
        begin: The candidate that is set before the first experiment; None for none.

    Raises:
        ArgumentError: Costs or the candidate are none.
    """
    support = np.unique(np.concatenate(blocks))
    if begin is not None:
        support = np.append(support, _candidate(begin, problem.n))
    costs = transition_costs(transition, problem, support)
    last = None if begin is None else len(support) - 1
    place = {int(candidate): i for i, candidate in reversed(list(enumerate(support)))}
    order: list[int] = []
    changes: list[float] = []
    bound = 0.0
    for block in blocks:
        places = np.array([place[int(candidate)] for candidate in block])
        own, least = _ordered(costs, places, last)
        ways = np.r_[own[0] if last is None else last, own]
        changes += costs[ways[:-1], ways[1:]].tolist()
        if last is None:
            changes[len(order)] = 0.0
        order += own.tolist()
        last = int(own[-1])
        # Where another block may end is not known: the way from there counts for nothing.
        bound += least if block is blocks[0] else _ordered(costs, places, None)[1]
    cost = sum(changes)
    return PlanOrder(
        problem=problem,
        experiments=support[order],
        changes=np.array(changes),
        bound=min(bound, cost),
        proved=cost <= bound * (1 + EQUAL),
    )


def _ordered(costs: Array, places: Indices, last: int | None) -> tuple[Indices, float]:
    """Places (m,) in a cheap order behind the last one, and what no order costs less than."""
    repeated = places
    inside = costs[np.ix_(places, places)]
    unique, counts = np.unique(places, return_counts=True)
    if len(unique) < len(places) and _is_metric(costs[np.ix_(unique, unique)]):
        repeated = unique
        inside = costs[np.ix_(unique, unique)]
    else:
        counts = np.ones(len(places), dtype=int)
    before = np.zeros(len(repeated)) if last is None else costs[last, repeated]
    tour = cheap_tour(inside, before)
    legs = before[tour[0]] + inside[tour[:-1], tour[1:]].sum()
    least = legs if len(tour) <= BEST_UP_TO else cheapest_possible(inside, before)
    return np.repeat(repeated[tour], counts[tour]), float(least)


def _is_metric(costs: Array) -> bool:
    """Whether staying costs nothing, and no way is cheaper by way of another place."""
    room = EQUAL * float(costs.max(initial=0.0))
    return not np.diag(costs).any() and all(
        (costs <= costs[:, [i]] + costs[[i]] + room).all() for i in range(len(costs))
    )


def transition_costs(transition: Transition, problem: Problem, chosen: Indices) -> Array:
    """Costs (k, k) of the ways between chosen candidates (k,), from the first to the second index.

    Raises:
        ArgumentError: They are no such costs.
    """
    if isinstance(transition, Mapping):
        found = _of_columns(transition, problem, chosen)
    elif callable(transition):
        candidates: list[Any] = chosen.tolist()
        if problem.frame is not None:
            candidates = problem.frame.iloc[chosen].to_dict("records")
        found = _of_pairs(transition, candidates, "transition")
    else:
        given = finite_numbers(transition, "transition")
        if given.shape != (problem.n, problem.n):
            message = f"costs of shape {given.shape}, expected ({problem.n}, {problem.n})"
            raise ArgumentError(message, argument="transition")
        found = given[np.ix_(chosen, chosen)]
    if (found < 0).any():
        i, j = np.argwhere(found < 0)[0]
        message = f"from candidate {chosen[i]} to {chosen[j]} it is below zero"
        raise ArgumentError(message, argument="transition", given=f"{found[i, j]:g}")
    return found


def _of_columns(transition: Mapping[str, Any], problem: Problem, chosen: Indices) -> Array:
    """The sum of what changes of columns cost."""
    if problem.frame is None:
        message = "columns need a problem of a data frame; give costs (n, n), or a function"
        raise ArgumentError(message, argument="transition")
    frame = problem.frame.iloc[chosen]
    found = np.zeros((len(chosen), len(chosen)))
    for column, cost in transition.items():
        where = f"transition[{column!r}]"
        if column not in frame.columns:
            columns = ", ".join(map(str, frame.columns))
            raise ArgumentError(f"the frame has {columns}", argument=where)
        levels, of = np.unique(frame[column].to_numpy(), return_inverse=True)
        if callable(cost):
            each = _of_pairs(cost, levels.tolist(), where)
        else:
            number = finite_numbers(cost, where)
            if number.shape != ():
                raise ArgumentError("expected a number, or a function of levels", argument=where)
            each = number * (1.0 - np.eye(len(levels)))
        found += each[np.ix_(of.ravel(), of.ravel())]
    return found


def _of_pairs(cost: Callable[[Any, Any], float], things: list[Any], where: str) -> Array:
    """Costs (k, k) of all pairs of different things by a function; staying costs nothing."""
    found = np.zeros((len(things), len(things)))
    for i, first in enumerate(things):
        for j, second in enumerate(things):
            if i == j:
                continue
            value = cost(first, second)
            try:
                found[i, j] = float(value)
            except (TypeError, ValueError):
                found[i, j] = np.nan
            if not np.isfinite(found[i, j]):
                message = f"{value!r} from {first!r} to {second!r}, expected a number"
                raise ArgumentError(message, argument=where)
    return found


def _candidate(given: object, n: int) -> int:
    """The number of a candidate."""
    number = whole_number(given, "begin", 0)
    if number >= n:
        message = f"expected a candidate, from 0 to {n - 1}"
        raise ArgumentError(message, argument="begin", given=given)
    return number


@dataclass(frozen=True, eq=False)
class ProblemPlan(BoundedDesign):
    """The best plan of whole experiments that a search has found.

    Attributes:
        problem: The candidates.
        criterion: What was minimised.
        counts: How often each candidate is measured (n,), kept candidates included.
        cost: The criterion's cost of all experiments together.
        lower_bound: No plan within the same limits costs less; it is zero where there is no bound.
        basis: What the bound is on, in words; "no bound" with the reason where there is none.
        starts: Number of starts of the search.
        found: How many of them led to a plan as good as this one.
        ended: Why the search ended: "starts", "stagnation", "proved" or "interrupted".
        seconds: Duration of the search [s], the relaxation included.
        accuracy: Relative error that rounding may have made in cost and bound.
        kept: How often each candidate was measured already (n,); zeros if nothing was kept.
        elsewhere: Number of kept experiments that are none of the candidates.
        block_counts: Counts (b, n) of each block; None without blocks.
        spent: What the new experiments cost, in each budget (k,) if there are several; None where
            costs do not matter.
        exact_bound: No plan of whole experiments within the limits costs less, and which bound that
            is; None where no proof of plans was asked for.
        proof: Why, of the new experiments (`ExactProof`); likewise.
        most: How often each candidate may be measured (n,), kept ones counted; None for no limit.
        limits: What the new experiments obey.
        least: How often each candidate is measured in every plan (n,), kept ones counted; None
            where that is how often it was measured already.
        worst: Where in ranges of theta it is worst; None of a problem without any.
    """

    problem: Problem
    criterion: Criterion
    counts: Indices
    cost: float
    lower_bound: Bound
    basis: str
    starts: int
    found: int
    ended: str
    seconds: float
    accuracy: float
    kept: Indices
    elsewhere: int = 0
    block_counts: Indices | None = None
    spent: float | Array | None = None
    exact_bound: Bound | None = None
    proof: "ExactProof | None" = None
    most: Indices | None = None
    limits: Limits | None = None
    least: Indices | None = None
    worst: "WorstTheta | None" = None

    def headline(self) -> str:
        """Criterion, value, size and efficiency."""
        value = printed(self.criterion, self.value, digits=HEADLINE)
        experiments = f"{self.size} experiment{'' if self.size == 1 else 's'}"
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        worst = "" if self.worst is None else f", {self.worst}"
        return (
            f"{self.criterion.label} = {value} with {experiments}, {self._bounded}{digits}{worst}"
        )

    @property
    def told_bound(self) -> Bound:
        """That of every plan of so many experiments: the sharper one of weights and of plans."""
        exact = self.exact_bound
        return self.lower_bound if exact is None or exact.cost < self.lower_bound.cost else exact

    @property
    def bounds(self) -> dict[str, Bound]:
        """That of weights where there is one, and that of whole plans where it was asked for."""
        found = {"candidates": self.lower_bound} if self.lower_bound.cost else {}
        exact = self.exact_bound
        return found | ({} if exact is None else {"whole_plans": exact})

    @property
    def proved_exact(self) -> bool:
        """Whether it is proved that no plan of these candidates is better, within the limits."""
        return self.proof is not None and self.proof.proved

    @property
    def bound_exact(self) -> float | None:
        """The bound on whole plans as the criterion's formula prints it; None without a proof."""
        return None if self.exact_bound is None else self.exact_bound.value

    @property
    def _bounded(self) -> str:
        """The efficiency, and what it rests on if that is not a proof; or why there is none."""
        if self.proved_exact:
            return "proved: no plan of these candidates is better"
        if not self.told_bound.cost:
            return self.basis
        word = " by a solver's word" if self.told_bound.kind is BoundKind.SOLVED else ""
        return f"efficiency {100 * self.efficiency:.2f} %{word}"

    @property
    def size(self) -> int:
        """Number of experiments, kept ones included."""
        return int(self.counts.sum()) + self.elsewhere

    @property
    def support(self) -> Indices:
        """Indices (k,) of the candidates that are measured."""
        return np.flatnonzero(self.counts)

    @property
    def experiments(self) -> Indices:
        """Indices (size,) of the candidates, each as often as it is measured; blocks in order."""
        each = self.counts[None] if self.block_counts is None else self.block_counts
        return np.concatenate(self._repeated(each))

    @property
    def new(self) -> Indices:
        """Indices (k,) of the candidates of new experiments, each as often as it is measured."""
        return self._repeated([self.counts - self.kept])[0]

    def _repeated(self, counts: Iterable[Indices]) -> list[Indices]:
        """Candidates as often as each of several counts (n,) says."""
        return [np.repeat(np.arange(self.problem.n), own) for own in counts]

    def order(self, transition: Transition, begin: int | None = None) -> PlanOrder:
        """Put the new experiments in an order in which the changes between them cost little.

        Up to eleven different experiments it is the cheapest order; of more, `.bound` says how much
        less any can cost. Experiments of a block stay together, and blocks in their order.

        Args:
            transition: Costs (n, n) of the way from each candidate to each other one, or a function
                of two candidates: of two rows of the data frame, each a mapping, or else of two
                numbers of candidates. For a problem of a data frame also a mapping of columns to
                what any change of them costs, such as ``{"oven": 5, "time": 1}``, or to a function
                of two levels.
            begin: The candidate that is set before the first experiment; by default none.

        Returns:
            The order with its `.cost` and `.bound`, and the cost of each change in `.to_frame()`.

        Raises:
            ArgumentError: The costs are none, or do not fit the candidates.
        """
        new = [self.counts - self.kept] if self.block_counts is None else self.block_counts
        return order_plan(self.problem, self._repeated(new), transition, begin)

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a candidate a row: its count, kept ones, and its count by block.

        Candidates from a data frame are its rows; others are numbers from zero.
        """
        frame = self.problem.to_frame(self.counts, "count")
        return frame.assign(**{name: own[self.support] for name, own in self.parts.items()})

    @property
    def parts(self) -> dict[str, Indices]:
        """Counts (n,) by what they are, such as "kept" and "block 1"."""
        found = {"kept": self.kept} if self.kept.any() else {}
        if self.block_counts is not None:
            found |= {f"block {i}": own for i, own in enumerate(self.block_counts, start=1)}
        return found
