"""A plan of whole experiments on the candidates of a problem, and how far it is from the bound."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion
from criteria.criterion import printed
from edtk.design.bound import HEADLINE, VISIBLE, Bound, BoundedDesign, BoundKind
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.plan_order import PlanOrder, Transition, order_plan
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.exact.prove_exact import ExactProof
    from edtk.design.theta_box import WorstTheta


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
