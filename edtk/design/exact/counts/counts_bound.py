"""A bound on every plan within limits, from weights within the same limits."""

from dataclasses import dataclass

import numpy as np

from criteria import Relaxable
from criteria.linalg.root import root
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.reachable import Reachable
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.system.typing import Array

GAP = 1e-4  # relative gap at which the bound is good enough
MASTER_GAP = 1e-5  # of the programs over some plans
ROUNDS = 60


@dataclass(frozen=True, eq=False)
class CountsBound:
    """A bound, and the counts that come near it.

    Attributes:
        cost: No plan within the limits costs less.
        counts: Counts (n,), not whole, of a plan that costs about as much.
        gap: Relative gap between the bound and these counts.
    """

    cost: float
    counts: Array
    gap: float


def counts_bound(
    problem: Problem,
    criterion: Relaxable,
    limits: Limits,
    start: Array,
    multipliers: Array,
) -> CountsBound:
    """Minimise a criterion over counts within limits that need not be whole.

    A plan X within the limits obeys ``<Z, X> <= <Z, K> + max_n sum_i n_i <Z, M_i>`` for every
    multiplier Z, with K what all plans have; so a criterion's `lower_bound` holds for it too. The
    program over all such plans is solved by Dantzig and Wolfe's decomposition: of a few whole
    plans the best mixture is found by `relax`, whose multiplier tells the plan that joins next.

    Args:
        problem: The candidates, without a prior: `Limits.base` is what all plans have.
        criterion: What is minimised.
        limits: What plans must obey.
        start: Counts (n,) of a plan within the limits, regular.
        multipliers: Multipliers (r, p, p) of a like program.
    """
    reachable = Reachable(limits, problem.n)
    search = _Decomposition(problem, criterion, reachable, [start])
    search.prove(multipliers, search.information(start))
    for _ in range(ROUNDS):
        known = len(search.plans)
        try:
            search.improve()
        except RelaxationError:
            break
        if search.gap <= GAP or len(search.plans) == known:
            break
    return CountsBound(search.bound, search.counts, search.gap)


class _Decomposition:
    """Whole plans, their best mixture, and the best bound so far."""

    def __init__(
        self, problem: Problem, criterion: Relaxable, reachable: Reachable, plans: list[Array]
    ) -> None:
        self.problem = problem
        self.criterion = criterion
        self.reachable = reachable
        self.plans = plans
        self.counts = plans[0]
        self.cost = float(criterion.cost(self.information(plans[0])))
        self.bound = 0.0

    @property
    def gap(self) -> float:
        """Relative gap between the best bound and the best mixture."""
        return 1.0 - self.bound / self.cost

    def information(self, counts: Array) -> Array:
        """Information (p, p) of counts (n,), with what every plan has."""
        return self.problem.information(counts) + self.reachable.limits.base

    def improve(self) -> None:
        """Mix the plans, and add those that the mixture's multipliers ask for."""
        columns = np.array([self.information(plan) for plan in self.plans])
        mixed = relax(Problem(root(columns)), self.criterion, MASTER_GAP)
        M = np.tensordot(mixed.weights, columns, axes=1)
        cost = float(self.criterion.cost(M))
        if cost < self.cost:
            self.cost = cost
            self.counts = np.tensordot(mixed.weights, np.array(self.plans), axes=1)
        Z = mixed.multipliers
        if self.criterion.smooth:
            Z = np.concatenate([Z, -self.criterion.gradient(M)[None]])
        self.prove(Z, M)

    def prove(self, multipliers: Array, M: Array) -> None:
        """Take over what multipliers (r, p, p) prove near M (p, p), and the plans they ask for."""
        base = self.reachable.limits.base
        tops = []
        for Z, each in zip(multipliers, self.problem.sensitivities(multipliers), strict=True):
            top, counts = self.reachable.largest(each)
            tops.append(top + float(np.sum(Z * base)))
            if not any(np.allclose(counts, plan, rtol=0, atol=1e-9) for plan in self.plans):
                self.plans.append(counts)
        largest = np.array(tops)
        proofs = [
            self.criterion.lower_bound(multipliers[i : i + 1], largest[i : i + 1], M)
            for i in range(len(largest))
        ]
        proofs.append(self.criterion.lower_bound(multipliers, largest, M))
        self.bound = max(self.bound, *(proof for proof in proofs if np.isfinite(proof)))
