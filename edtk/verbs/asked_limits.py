"""Limits on counts as a call states them: least and largest counts, costs, sums, and marginals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.linear_constraints import Linear, LinearConstraints, with_triple
from edtk.design.problem import Problem
from edtk.design.relaxation.weight_limits import WeightLimits
from edtk.system.errors import LARGEST_NUMBER, ArgumentError, finite_numbers
from edtk.system.typing import Array, Indices, Mask

ROUNDING = 1e-9  # part of a size by which sums of limits may be off it
# A triple, or how often each level of columns is used: one number, two, or those of each level.
Constraint = Linear | Mapping[str, Any]


def counts_of_candidates(given: ArrayLike, n: int, argument: str) -> Array:
    """One number for each of n candidates, not negative.

    Raises:
        ArgumentError: It is none.
    """
    found = finite_numbers(given, argument)
    if found.shape not in ((), (n,)) or (found < 0).any():
        message = f"expected a number, zero or more, or one for each of {n} candidates"
        raise ArgumentError(message, argument=argument)
    return np.broadcast_to(found, (n,))


def whole_numbers(given: ArrayLike) -> Indices | None:
    """An argument as an array of whole numbers; None if it is none."""
    try:
        found = np.asarray(given)
    except ValueError:  # lists of different lengths
        return None
    if not found.size:
        return found.astype(int)
    return found if np.issubdtype(found.dtype, np.integer) else None


def kept_candidates(keep: ArrayLike, n: int) -> Indices:
    """Experiments that were made, as indices (k,) of n candidates.

    Raises:
        ArgumentError: They are none.
    """
    found = whole_numbers(keep)
    if found is None or found.ndim != 1 or not ((found >= 0) & (found < n)).all():
        message = f"expected indices of candidates, from 0 to {n - 1}, "
        message += "a data frame with their columns, or a Problem"
        raise ArgumentError(message, argument="keep")
    return found


@dataclass(frozen=True, eq=False)
class Budgets:
    """What experiments cost, in one or several budgets.

    Attributes:
        costs: Costs (k, n) of one experiment each.
        funds: The budgets (k,).
        single: Whether they were given as one number and its costs (n,).
    """

    costs: Array
    funds: Array
    single: bool

    @classmethod
    def of(cls, costs: ArrayLike | None, budget: ArrayLike | None, n: int) -> "Budgets | None":
        """The costs and budgets of a call; None without any.

        Raises:
            ArgumentError: One is missing, or they do not fit each other.
        """
        if costs is None and budget is None:
            return None
        if costs is None or budget is None:
            missing, given = ("costs", "cost_budget") if costs is None else ("cost_budget", "costs")
            raise ArgumentError(f"expected beside {given}", argument=missing)
        each = finite_numbers(costs, "costs")
        prices = np.atleast_2d(each)
        free = (prices <= 0).all(axis=0) if prices.ndim == 2 else np.zeros(1, dtype=bool)
        if prices.ndim != 2 or prices.shape[1] != n or (prices < 0).any() or free.any():
            several = " in each budget (k, n), one of them above zero" if each.ndim > 1 else ""
            sign = "number, zero or more," if several else "positive number"
            message = f"expected a {sign} for each of {n} candidates{several}"
            raise ArgumentError(message, argument="costs")
        funds = finite_numbers(budget, "cost_budget")
        if each.ndim > 1 and funds.shape != (len(prices),):
            message = f"expected {len(prices)} numbers, one for each row of costs"
            raise ArgumentError(message, argument="cost_budget", given=budget)
        if each.ndim == 1 and funds.ndim:
            message = "expected one number; several budgets need costs (k, n) of each"
            raise ArgumentError(message, argument="cost_budget", given=budget)
        if not (funds > 0).all():
            raise ArgumentError("expected above 0", argument="cost_budget", given=budget)
        found = cls(prices, np.atleast_1d(funds), each.ndim == 1)
        found._require_sensible(budget)
        return found

    def _require_sensible(self, budget: object) -> None:
        """Check that the experiments that the budgets buy are a number to reckon with.

        Raises:
            ArgumentError: They are not; a candidate is named where the others are.
        """
        bought = self.bought
        least = 1.0 / LARGEST_NUMBER
        i = int(np.argmax(bought))
        if least <= bought[i] <= LARGEST_NUMBER:
            return
        expected = f"expected {least:g} to {LARGEST_NUMBER:g}"
        if ((least <= bought) & (bought <= LARGEST_NUMBER)).any():
            message = f"candidate {i}: the budget buys {bought[i]:g} experiments; {expected}"
            raise ArgumentError(message, argument="costs")
        message = f"buys {bought[i]:g} experiments; {expected}"
        raise ArgumentError(message, argument="cost_budget", given=budget)

    @property
    def bought(self) -> Array:
        """How many experiments with each candidate alone (n,) the budgets buy, whole or not."""
        prices = np.maximum(self.costs, np.finfo(float).tiny)
        with np.errstate(over="ignore"):
            return np.asarray((self.funds[:, None] / prices).min(axis=0))

    @property
    def joint(self) -> tuple[Array, float]:
        """Costs (n,) and one budget that whatever keeps all of them keeps too."""
        if len(self.costs) == 1:
            return self.costs[0], float(self.funds[0])
        return (self.costs / self.funds[:, None]).mean(axis=0), 1.0

    @property
    def rows(self) -> LinearConstraints:
        """The budgets as constraints."""
        names = tuple(f"cost_budget[{i}]" for i in range(len(self.funds)))
        return LinearConstraints.none(self.costs.shape[1]).and_also(
            self.costs, -np.inf, self.funds, *names
        )

    def without(self, counts: Array | Indices) -> "Budgets":
        """What is left beside some counts (n,)."""
        return replace(self, funds=self.funds - self.costs @ counts)

    def spent(self, counts: Array | Indices) -> float | Array:
        """What counts (n,) cost: a number, or one for each budget (k,)."""
        found = np.asarray(self.costs @ counts)
        return float(found[0]) if self.single else found


def asked_weight_limits(
    problem: Problem,
    has_prior: bool,
    size: int | None,
    least: ArrayLike | None,
    most: ArrayLike | None,
    costs: ArrayLike | None,
    cost_budget: ArrayLike | None,
    constraints: Sequence[Constraint] | None,
) -> WeightLimits | None:
    """Limits on the weights of a relaxation, as a call states them; None without any.

    They are about the counts of `size` experiments; of one, so about weights, where none is given;
    and about any number of experiments where none is given but a budget.

    Raises:
        ArgumentError: An argument is impossible, or nothing obeys all of them.
    """
    if all(given is None for given in (least, most, costs, cost_budget, constraints)):
        return None
    n = problem.n
    budgets = Budgets.of(costs, cost_budget, n)
    rows = asked_constraints(constraints, problem)
    number: float | None = 1.0 if size is None else float(size)
    largest = np.full(n, number)
    if budgets is not None:
        named = budgets.rows
        rows = rows.and_also(named.C, named.low, named.high, *named.names)
    if budgets is not None and size is None:
        if has_prior:
            message = "a prior counts per experiment, so that a size is needed beside it"
            raise ArgumentError(message, argument="size")
        number = None
        largest = budgets.bought
    if most is not None:
        largest = np.minimum(counts_of_candidates(most, n, "most"), largest)
    fewest = np.zeros(n) if least is None else counts_of_candidates(least, n, "least")
    if (fewest > largest).any():
        i = int(np.flatnonzero(fewest > largest)[0])
        message = f"candidate {i}: {fewest[i]:g} or more, but {largest[i]:g} at most"
        raise ArgumentError(message, argument="least")
    found = WeightLimits(rows, fewest, largest, number)
    of = "experiments" if size is not None or number is None else "weights of sum one"
    if number is not None and largest.sum() < number * (1 - ROUNDING):
        message = f"allows {largest.sum():g} in all, expected {number:g} or more: {of}"
        raise ArgumentError(message, argument="most")
    if number is not None and fewest.sum() > number * (1 + ROUNDING):
        message = f"asks for {fewest.sum():g} in all, expected {number:g} or less: {of}"
        raise ArgumentError(message, argument="least")
    clash = found.program.conflict(fewest, largest)
    if clash:
        message = f"no {of} within least and most obey {' and '.join(clash)} together"
        raise ArgumentError(message, argument="constraints")
    return found


def asked_constraints(given: Sequence[Constraint] | None, problem: Problem) -> LinearConstraints:
    """Constraints on the counts of a problem's candidates.

    Args:
        given: Triples of coefficients, least and largest sum, with coefficients (n,), or an
            expression of the frame's columns that gives them, such as "oven == 'left'"; or mappings
            of a column to how often each of its levels is used.
        problem: The candidates.

    Raises:
        ArgumentError: One is none of these.
    """
    n = problem.n
    if given is None:
        return LinearConstraints.none(n)
    if isinstance(given, str | Mapping) or not isinstance(given, Sequence):
        message = "expected a list of (coefficients, least, largest) or {column: counts}"
        raise ArgumentError(message, argument="constraints")
    found = LinearConstraints.none(n)
    for number, one in enumerate(given):
        where = f"constraints[{number}]"
        triples = _of_levels(one, problem, where) if isinstance(one, Mapping) else [one]
        read = partial(_named, problem=problem, where=where)
        for triple in triples:
            found = with_triple(found, triple, read, where)
    return found


def _named(given: Any, problem: Problem, where: str) -> tuple[Array, str]:
    """Coefficients (n,) as numbers, or as what an expression of the frame's columns gives."""
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], str):
        return given[0], given[1]
    if not isinstance(given, str):
        return given, ""
    frame = _frame(problem, where)
    try:
        return np.asarray(frame.eval(given), dtype=float), given
    except Exception as error:  # an expression may raise anything
        first = next(iter(str(error).splitlines()), type(error).__name__)
        columns = ", ".join(map(str, frame.columns))
        raise ArgumentError(
            f"{given!r}: {first}; the frame has {columns}", argument=where
        ) from error


def _of_levels(given: Mapping[str, Any], problem: Problem, where: str) -> list[Any]:
    """Marginals as triples."""
    frame = _frame(problem, where)
    found = []
    for column, counts in given.items():
        if column not in frame.columns:
            columns = ", ".join(map(str, frame.columns))
            raise ArgumentError(f"no column {column!r}; the frame has {columns}", argument=where)
        levels = frame[column].unique().tolist()
        each = counts if isinstance(counts, Mapping) else dict.fromkeys(levels, counts)
        for level, limits in each.items():
            mask: Mask = (frame[column] == level).to_numpy()
            if not mask.any():
                known = ", ".join(map(repr, levels[:10]))
                message = f"no candidate has {column} = {level!r}; there are {known}"
                raise ArgumentError(message, argument=where)
            pair = (limits, limits) if isinstance(limits, Real) else limits
            if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
                message = f"expected a number, or (least, largest), for {column} = {level!r}"
                raise ArgumentError(message, argument=where)
            found.append(((mask.astype(float), f"{column} = {level}"), *pair))
    return found


def _frame(problem: Problem, where: str) -> Any:
    """The data frame of the candidates."""
    if problem.frame is None:
        message = "columns need a problem of a data frame; give coefficients as numbers"
        raise ArgumentError(message, argument=where)
    return problem.frame
