"""Swaps of experiments in different blocks, priced by low-rank updates of the information."""

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.prices import GAIN, first_of_largest
from edtk.design.exact.exchange_costs import UPDATABLE, trade_costs
from edtk.system.typing import Array, Indices

SWAP_SWEEPS = 50  # over all places, at most


def swap_between_blocks(criterion: Criterion, scatter: Scatter, places: Indices) -> Indices:
    """Swap experiments of different blocks in each plan, as long as that improves it.

    Where every candidate may be taken once only, and all are, nothing else can improve a plan.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the blocks.
        places: Candidates (b, m) at the places of b plans.

    Returns:
        Places (b, m) of plans that are no worse.
    """
    places = places.copy()
    left = np.arange(len(places))
    for _ in range(SWAP_SWEEPS):
        swaps = BlockSwaps(criterion, scatter, places[left])
        moved = np.zeros(len(left), dtype=bool)
        for place in range(places.shape[1]):
            moved[swaps.swap(place)] = True
        places[left] = swaps.places
        left = left[moved]
        if not len(left):
            break
    return places


class BlockSwaps:
    """Plans on their way, in which experiments of different blocks are swapped.

    Let s and t be the sums of the rows of two blocks, with shares a and b of `Limits.shares`. Where
    U of the first and V of the second are swapped, the sums become ``s + V - U`` and ``t + U - V``,
    and the information about the parameters changes by

        h (J'J - E'E)    with h = a + b, J = (b t - a s) / h and E = V - U - J.

    So a swap is a trade: rows J join, and rows E leave, both times the root of h.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the blocks.
        places: Candidates (b, m) at the places of b plans.
    """

    def __init__(self, criterion: Criterion, scatter: Scatter, places: Indices) -> None:
        self.criterion = criterion
        self.scatter = scatter
        self.places = places.copy()
        self.M = scatter.information(places)
        self.costs = self._costs_of(self.M)
        _, self.cov, self.regular = guarded_inverse(self.M, UPDATABLE)

    def swap(self, place: int) -> Indices:
        """Swap the experiment at one place with the best one of another block.

        Returns:
            The plans (k,) that this improves; the others stay as they are.
        """
        costs = self.costs_at(place)
        best = first_of_largest(-costs, costs.min(axis=1))
        least = costs[np.arange(len(best)), best]
        which = (least < self.costs * (1 - GAIN)).nonzero()[0]
        return self._take_over(which, place, best[which]) if len(which) else which

    def costs_at(self, place: int) -> Array:
        """Costs (b, m) where a place is swapped with each other; inf with those of its block."""
        scatter = self.scatter
        shares, block_of = scatter.limits.shares, scatter.limits.block_of
        own = block_of[place]
        others = np.flatnonzero(block_of != own)
        h = (shares[own] + shares[block_of[others]])[:, None, None]
        pulls = shares[:, None, None] * scatter.sums(self.places)
        J = (pulls[:, block_of[others]] - pulls[:, own, None]) / h
        U = scatter.rows[self.places]
        E = U[:, others] - U[:, place, None] - J
        root = np.sqrt(h)
        inverse = self.cov, self.regular
        costs = np.full(self.places.shape, np.inf)
        costs[:, others] = trade_costs(self.criterion, self.M, inverse, root * J, root * E)
        return costs

    def _take_over(self, which: Indices, place: int, other: Indices) -> Indices:
        """Swap two places in plans (k,); information and costs are computed anew, without a drift.

        Returns:
            The plans that this improves indeed; the others stay as they are.
        """
        trials = self.places[which]
        each = np.arange(len(which))
        trials[each, other] = self.places[which, place]
        trials[:, place] = self.places[which, other]
        M = self.scatter.information(trials)
        costs = self._costs_of(M)
        better = costs < self.costs[which] * (1 - GAIN)
        which = which[better]
        self.places[which] = trials[better]
        self.costs[which] = costs[better]
        self.M[which] = M[better]
        _, self.cov[which], self.regular[which] = guarded_inverse(M[better], UPDATABLE)
        return which

    def _costs_of(self, M: Array) -> Array:
        """Costs (b,) of information (b, p, p)."""
        return np.asarray(self.criterion.cost(M)).reshape(-1)
