"""Orders of a plan's experiments in which little has to be changed from one to the next."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.problem import Problem
from edtk.design.tours import BEST_UP_TO, cheap_tour, cheapest_possible
from edtk.system.errors import ArgumentError, finite_numbers, whole_number
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

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
