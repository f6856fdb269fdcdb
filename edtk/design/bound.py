"""Bounds on the cost of every design with what they rest on, and designs that have one."""

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from enum import Enum
from typing import overload

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.criterion import Sense
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

# Relative excess of a bound over a cost that rounding may have made where nobody has counted it:
# the gap that a relaxation is asked for.
BLURRED = 1e-6
VISIBLE = 1e-8  # a relative error above this is told beside the gap
HEADLINE = 4  # digits of a value in a headline


class BoundKind(Enum):
    """The basis of a bound's claim; the value is its text for people."""

    PROVED_ON_CANDIDATES = "proved on candidates"  # no plan over a finite set of poses is better
    SOLVED = "on candidates, by a solver's word"  # the same, if a solver's optimum is believed
    SEARCHED = "searched"  # no better plan over all poses was found, which proves nothing
    PROVED = "proved on the continuum"  # no plan over all poses is better


@dataclass(frozen=True)
class Bound:
    """A number that no plan of the same number of experiments can beat, as far as `kind` says.

    Attributes:
        cost: No plan costs less; zero for a bound that says nothing.
        kind: What the claim rests on.
        degree: Degree of homogeneity of the cost: ``cost(c M) = c**-degree cost(M)``.
        sense: Whether the criterion's printed form is minimised or maximised.
        gap: Relative gap ``1 - cost/best`` to the cost of the best weights known, never negative.
            The least possible cost of weights lies between the two.
    """

    cost: float
    kind: BoundKind
    degree: float
    sense: Sense
    gap: float

    @classmethod
    def of(
        cls,
        criterion: Criterion,
        cost: float,
        best: float,
        kind: BoundKind,
        error: float = 0.0,
        blurred: float = BLURRED,
    ) -> "Bound":
        """The bound on a criterion's cost, which no design that is known may be below.

        It is lowered by its own rounding, and onto the cost of the best weights where rounding has
        lifted it above. One that is further above contradicts them: it says nothing.

        Args:
            criterion: Tells degree and sense.
            cost: No plan costs less.
            best: Cost of the best weights known, from which the gap follows.
            kind: What the claim rests on.
            error: Relative error that rounding may have made in the bound.
            blurred: Relative excess over `best` that is rounding.
        """
        lowered = max(float(cost) * (1.0 - error), 0.0)
        if not lowered <= best * (1.0 + blurred):
            lowered = 0.0
        kept = min(lowered, float(best))
        return cls(kept, kind, criterion.degree, criterion.sense, 1.0 - kept / best)

    def scaled(self, m: float) -> "Bound":
        """The bound on plans of m times as many experiments: ``cost * m**-degree``."""
        return replace(self, cost=float(self.cost * m**-self.degree))

    @property
    def value(self) -> float:
        """The bound in the criterion's printed form; inf for a maximised one that says nothing."""
        return printed_form(self.cost, self.sense)

    def efficiency(self, cost: float) -> float:
        """``bound / cost`` of a plan of this cost: one for a plan that cannot be improved."""
        return self.cost / cost

    def gap_to(self, cost: float) -> float:
        """Relative gap ``1 - bound/cost`` to a plan of this cost."""
        return 1.0 - self.cost / cost


@overload
def printed_form(cost: float, sense: Sense) -> float: ...
@overload
def printed_form(cost: NDArray[np.float64], sense: Sense) -> NDArray[np.float64]: ...
def printed_form(cost: float | NDArray[np.float64], sense: Sense) -> float | NDArray[np.float64]:
    """Costs as the criterion's formula prints them; applied to printed values, their costs.

    Args:
        cost: One cost or many, zero or positive.
        sense: "min": the printed value is the cost; "max": its reciprocal, inf for zero.
    """
    if sense == "min":
        return cost
    if np.ndim(cost):
        with np.errstate(divide="ignore"):
            return 1.0 / np.asarray(cost, dtype=float)
    return 1.0 / float(cost) if cost else float("inf")


def printed_bounds(bounds: dict[str, Bound]) -> dict[str, float | None]:
    """Bounds as the criterion's formula prints them, for JSON; None for one that says nothing."""
    values = {name: bound.value for name, bound in bounds.items()}
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


class BoundedDesign(Presented):
    """A design with its cost, and a bound on the cost of every design of as many experiments."""

    cost: float

    @property
    @abstractmethod
    def told_bound(self) -> Bound:
        """The bound with which a design is told."""

    @property
    @abstractmethod
    def bounds(self) -> dict[str, Bound]:
        """All bounds that are known, by what they are on.

        "candidates": proved on candidates; "searched": over all poses or points, as far as a search
        has seen; "continuum": proved over all of them; "whole_plans": proved of plans of whole
        experiments on candidates.
        """

    @property
    def value(self) -> float:
        """The criterion as its formula prints it."""
        return printed_form(self.cost, self.told_bound.sense)

    @property
    def bound(self) -> float:
        """The bound as the criterion's formula prints it."""
        return self.told_bound.value

    @property
    def kind(self) -> BoundKind:
        """What the claim of `bound` rests on."""
        return self.told_bound.kind

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost`` as costs, never negative."""
        return self.told_bound.gap_to(self.cost)

    @property
    def efficiency(self) -> float:
        """``bound / cost`` as costs: one for a design that cannot be improved."""
        return self.told_bound.efficiency(self.cost)


@dataclass(frozen=True, eq=False, kw_only=True)
class RelaxedDesign(BoundedDesign):
    """Weights of one experiment's worth of measurements, their cost, and a bound with its proof.

    Attributes:
        criterion: What was minimised.
        weights: Shares of the experiments, not negative, of sum one.
        cost: The criterion's cost of these weights.
        proved_bound: No weights of the candidates have a lower cost.
        multipliers: The proof of the bounds (r, p, p), see `Relaxable.lower_bound`.
        solver: The solver that found the weights.
        iterations: Number of restricted master problems that were solved.
    """

    criterion: Criterion
    weights: Array
    cost: float
    proved_bound: Bound
    multipliers: Array
    solver: str
    iterations: int

    @property
    def told_bound(self) -> Bound:
        """The proved one."""
        return self.proved_bound

    @property
    def bounds(self) -> dict[str, Bound]:
        """That on the candidates."""
        return {"candidates": self.proved_bound}

    @property
    @abstractmethod
    def places(self) -> Array | Indices:
        """Where the experiments are (k, ...): candidates, design variables of poses, or points."""
