"""Linear constraints as users state them: sums with a least and a largest value."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.arguments import is_number
from edtk.system.errors import ArgumentError, finite_numbers
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from scipy.optimize import Bounds, LinearConstraint

# Coefficients of a sum, least and largest value; None where there is no such limit.
Linear = tuple[ArrayLike | str | Mapping[str, float], float | None, float | None]


@dataclass(frozen=True, eq=False)
class LinearConstraints:
    """``low <= C x <= high`` for x (n,).

    Attributes:
        C: Coefficients (k, n).
        low: Least sums (k,), minus infinity for none.
        high: Largest sums (k,), infinity for none.
        names: How messages call them (k,).
    """

    C: Array
    low: Array
    high: Array
    names: tuple[str, ...]

    @classmethod
    def none(cls, n: int) -> "LinearConstraints":
        """No constraint on n numbers."""
        return cls(np.zeros((0, n)), np.zeros(0), np.zeros(0), ())

    def __len__(self) -> int:
        """Number of constraints."""
        return len(self.C)

    def and_also(
        self, C: Array, low: ArrayLike, high: ArrayLike, *names: str
    ) -> "LinearConstraints":
        """These and more of them."""
        each = (len(C),)
        return LinearConstraints(
            np.concatenate([self.C, C]),
            np.concatenate([self.low, np.broadcast_to(np.asarray(low, dtype=float), each)]),
            np.concatenate([self.high, np.broadcast_to(np.asarray(high, dtype=float), each)]),
            (*self.names, *names),
        )

    def shifted(self, x: Array | Indices) -> "LinearConstraints":
        """The same for what is added to x (n,)."""
        sums = self.C @ x
        return LinearConstraints(self.C, self.low - sums, self.high - sums, self.names)

    def conflict(
        self,
        least: Array,
        most: Array,
        integral: bool = False,
    ) -> tuple[str, ...]:
        """Names of constraints that no x (n,) obeys together; none where all can be obeyed.

        None of the named ones can be left out: without it there is an x.

        Args:
            least: Least numbers (n,).
            most: Largest numbers (n,), at least as large.
            integral: Whether the numbers are whole.
        """
        chosen = np.arange(len(self))
        if self._is_feasible(chosen, least, most, integral):
            return ()
        for one in range(len(self)):
            rest = chosen[chosen != one]
            if not self._is_feasible(rest, least, most, integral):
                chosen = rest
        return tuple(self.names[i] for i in chosen)

    def _is_feasible(self, chosen: Indices, least: Array, most: Array, integral: bool) -> bool:
        """Whether some of the constraints can be obeyed together."""
        if not len(chosen):
            return True
        zeros = np.zeros(self.C.shape[1])
        return self.subset(chosen).best(zeros, least, most, integral) is not None

    def is_obeyed(self, x: Array, within: float) -> bool:
        """Whether x (n,) is at most so far, in units of its numbers, from obeying them all."""
        sums = self.C @ x
        room = within * np.abs(self.C).max(axis=1, initial=0.0)
        return bool(((sums >= self.low - room) & (sums <= self.high + room)).all())

    def subset(self, chosen: Indices) -> "LinearConstraints":
        """Some of them."""
        names = tuple(self.names[i] for i in chosen)
        return LinearConstraints(self.C[chosen], self.low[chosen], self.high[chosen], names)

    def best(self, gains: Array, least: Array, most: Array, integral: bool = False) -> Array | None:
        """An x (n,) of the largest ``gains @ x``; None where nothing obeys the constraints.

        Args:
            gains: Gains (n,).
            least: Least numbers (n,).
            most: Largest numbers (n,).
            integral: Whether the numbers are whole.
        """
        from scipy.optimize import Bounds, LinearConstraint

        found = solved(
            -gains,
            np.full(len(gains), int(integral)),
            Bounds(least, most),
            [LinearConstraint(self.C, self.low, self.high)] if len(self) else [],
        )
        if found is None:
            return None
        x = np.clip(found, least, most)
        return np.round(x) if integral else x

    def priced(self, gains: Array, least: Array, most: Array) -> tuple[Array, Array | None]:
        """Multipliers (k,) of the constraints, and x (n,), of the largest ``gains @ x``.

        A multiplier is positive where the largest value of its sum binds, negative where the least
        one does. Of a program that its solver does not solve they are zero, and there is no x.

        Args:
            gains: Gains (n,).
            least: Least numbers (n,).
            most: Largest numbers (n,).
        """
        from scipy.optimize import linprog

        above = np.isfinite(self.high)
        below = np.isfinite(self.low)
        found = linprog(
            -gains,
            A_ub=np.concatenate([self.C[above], -self.C[below]]),
            b_ub=np.concatenate([self.high[above], -self.low[below]]),
            bounds=np.column_stack([least, most]),
            method="highs",
        )
        y = np.zeros(len(self))
        if found.status != 0:
            return y, None
        duals = np.asarray(found.ineqlin.marginals)
        y[above] = np.maximum(-duals[: above.sum()], 0.0)
        y[below] -= np.maximum(-duals[above.sum() :], 0.0)
        return y, np.clip(found.x, least, most)

    def at_most(self, y: Array) -> float:
        """What ``y'C x`` is at most, for multipliers y (k,) that are zero where nothing binds."""
        up = np.where(y > 0, self.high, 0.0)
        down = np.where(y < 0, self.low, 0.0)
        return float(y @ (up + down))


def solved(
    costs: Array, integrality: ArrayLike, bounds: "Bounds", constraints: "list[LinearConstraint]"
) -> Array | None:
    """Solution (n,) of a program partly in whole numbers; None where it has none.

    HiGHS's reductions call programs infeasible that have rows nearly alike, and are left out then.
    """
    from scipy.optimize import milp

    for reduced in (True, False):
        found = milp(
            costs,
            integrality=integrality,
            bounds=bounds,
            constraints=constraints,
            options={"presolve": reduced},
        )
        if found.x is not None:
            return np.asarray(found.x)
    return None


def linear_constraints(
    given: object,
    coefficients: Callable[[Any], tuple[Array, str]],
    n: int,
    argument: str = "constraints",
) -> LinearConstraints:
    """Read constraints on n numbers.

    Args:
        given: A list of triples, see `Linear`.
        coefficients: Reads the first of a triple: numbers (n,), and a name or nothing.
        n: How many numbers.
        argument: What the call names them.

    Raises:
        ArgumentError: One is no such triple, or its least value is above its largest.
    """
    found = LinearConstraints.none(n)
    if isinstance(given, str | Mapping) or not isinstance(given, Sequence):
        message = "expected a list of (coefficients, least, largest)"
        raise ArgumentError(message, argument=argument)
    for number, one in enumerate(given):
        found = with_triple(found, one, coefficients, f"{argument}[{number}]")
    return found


def with_triple(
    beside: LinearConstraints,
    given: object,
    coefficients: Callable[[Any], tuple[Array, str]],
    where: str,
) -> LinearConstraints:
    """Some constraints, and that of a triple; for the arguments see `linear_constraints`.

    Raises:
        ArgumentError: It is no such triple, or its least value is above its largest.
    """
    if not isinstance(given, Sequence) or isinstance(given, str) or len(given) != 3:
        message = "expected (coefficients, least, largest)"
        raise ArgumentError(message, argument=where, given=repr(given))
    first, low, high = given
    row, name = coefficients(first)
    row = finite_numbers(row, where)
    n = beside.C.shape[1]
    if row.shape != (n,):
        raise ArgumentError(f"{row.size} coefficients, expected {n}", argument=where)
    least = _limit(low, -np.inf, where)
    largest = _limit(high, np.inf, where)
    if least > largest:
        message = f"the least value {least:g} is above the largest, {largest:g}"
        raise ArgumentError(message, argument=where)
    return beside.and_also(row[None], least, largest, f"{where} ({name})" if name else where)


def _limit(given: object, default: float, where: str) -> float:
    """A limit of a sum; infinite for None."""
    if given is None:
        return default
    if not is_number(given):
        raise ArgumentError("expected a number, or None, as a limit", argument=where)
    return float(given)
