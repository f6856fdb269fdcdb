"""The plans that a search has found so far."""

import numpy as np

from criteria.linalg.estimable import range_whitener
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.plans import Plans
from edtk.system.typing import Array

GAIN = 1e-4  # relative improvement that counts; less is lost among what seeds differ by
SLIGHT = 1e-9  # relative improvement by which a plan is worth a change of what was found
SAME = 1e-3  # relative difference of information up to which two plans are the same


class SearchRecord:
    """The best plan so far, and all plans that were refined to the end.

    Attributes:
        best: The best plan, in a batch of one.
        cost: Its cost.
        batches: Number of batches that were entered.
        idle: Number of batches since the last improvement that counts.
    """

    best: Plans
    cost: float
    batches: int
    idle: int

    def __init__(self, space: DesignSpace) -> None:
        self.cost = np.inf
        self.batches = 0
        self.idle = 0
        self._space = space
        self._costs: list[float] = []
        self._information: list[Array] = []
        self._plans: list[Plans] = []

    @property
    def empty(self) -> bool:
        """Whether no batch was entered yet."""
        return self.batches == 0

    def enter(self, costs: Array, plans: Plans) -> None:
        """Enter the answer of one batch: costs (e,), the best first, and their plans."""
        improved = self.empty or costs[0] < self.cost * (1 - GAIN)
        self.idle = 0 if improved else self.idle + 1
        if self.empty or costs[0] < self.cost:
            self.cost = float(costs[0])
            self.best = plans[np.array([0])]
        self.batches += 1
        self._add(costs, plans)

    def improve(self, costs: Array, plans: Plans) -> None:
        """Enter the best of some plans (e,), the best first, if it is better than all so far."""
        if costs[0] < self.cost * (1 - SLIGHT):
            self.cost = float(costs[0])
            self.best = plans[np.array([0])]
            self._add(costs[:1], self.best)

    def _add(self, costs: Array, plans: Plans) -> None:
        """Keep plans with their costs (e,) for the census."""
        self._costs += costs.tolist()
        self._plans += [plans]
        self._information += list(plans.information(self._space))

    @property
    def plans(self) -> Plans:
        """All plans that were refined to the end, the best first."""
        x = np.concatenate([plans.x for plans in self._plans])
        repeats = np.concatenate([plans.repeats for plans in self._plans])
        return Plans(x, repeats)[np.argsort(self._costs, kind="stable")]

    def champions(self, most: int) -> tuple[Array, Plans]:
        """Costs (b,) of the best plans that differ from each other, and the plans.

        Without a regular plan there is none.
        """
        order = np.argsort(self._costs, kind="stable")
        costs = np.array(self._costs)[order]
        finite = int(np.isfinite(costs).sum())
        if not finite:
            return costs[:0], self.plans[np.arange(0)]
        M = np.array(self._information)[order[:finite]]
        chosen = distinct(M, range_whitener(M[0]), SAME, most)
        return costs[chosen], self.plans[chosen]

    def census(self) -> tuple[int, int]:
        """How many plans came out as the best one, and how many different plans there are."""
        if not np.isfinite(self.cost):
            return 0, 0
        order = np.argsort(self._costs, kind="stable")
        M = np.array(self._information)[order]
        T = range_whitener(M[0])
        # Whitened by the best plan, the best plan is the identity, of norm sqrt of its rank.
        difference = np.linalg.norm(T.T @ (M - M[0]) @ T, axis=(1, 2))
        same = difference <= SAME * np.sqrt(T.shape[1])
        return int(same.sum()), len(distinct(M, T, SAME))
