"""One batch of a search for exact plans: many starts, a coarse descent, and a fine one of the best."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from criteria import Criterion
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.exact.best_repeats import best_repeats
from edtk.design.exact.refine import refine
from edtk.design.exact.starts import Starts, exchanged, starts

Array = NDArray[np.float64]
SIZE = 16  # starts of a batch
ELITE = 4  # of these are refined to the end
COARSE, FINE = 15, 60  # steps of the first descent and of the others
BLUNT, SHARP = (30.0,), (250.0,)  # soft maxima of these, see `refine`
POOL = 256  # fresh candidates of a batch, and of each round
ROUNDS = 4  # of exchange and refinement, at most


@dataclass(frozen=True, eq=False)
class Batch:
    """A piece of work that depends on nothing but itself, wherever it is done.

    Attributes:
        space: Model and feasible set.
        criterion: What to minimise.
        m: Number of experiments.
        k: Number of places at most.
        support: Design variables (s, v) of the relaxed design.
        weights: Their weights (s,).
        seed: Seed of this batch.
        seconds: After which to come back with what there is, counted from the call.
    """

    space: DesignSpace
    criterion: Criterion
    m: int
    k: int
    support: Array
    weights: Array
    seed: tuple[int, ...]
    seconds: float = np.inf

    def __call__(self) -> tuple[Array, Starts]:
        """Costs (e,) of the plans that were refined to the end, the best first, and these plans."""
        end = monotonic() + self.seconds
        with threadpool_limits(1):  # the sum of a product may depend on the number of threads
            return self._search(lambda: monotonic() >= end)

    def _search(self, late: Callable[[], bool]) -> tuple[Array, Starts]:
        support = Candidates(self.support, self.space.problem(self.support))
        plans = starts(
            self.criterion, self.m, self.k, support, self.weights, self._fresh(0), SIZE, self.seed
        )
        costs, plans = self._refined(plans, COARSE, BLUNT, late)
        order = np.argsort(costs, kind="stable")
        plans, costs = plans[order], costs[order]
        finite = np.flatnonzero(np.isfinite(costs))
        M = self.space.at(plans.x[finite]).information(plans.repeats[finite])
        plans = (
            plans[finite[distinct(M, whitener(M[0]), 1e-3)[:ELITE]]]
            if len(finite)
            else plans[order[:1]]
        )
        costs, plans = self._refined(plans, FINE, SHARP, late)
        for turn in range(1, ROUNDS):
            if late():
                break
            tried = self._exchanged(plans, self._fresh(turn))
            found, tried = self._refined(tried, FINE, SHARP, late)
            better = found < costs * (1 - 1e-6)
            if not better.any():
                break
            costs = np.where(better, found, costs)
            plans = Starts(
                np.where(better[:, None, None], tried.x, plans.x),
                np.where(better[:, None], tried.repeats, plans.repeats),
            )
        order = np.argsort(costs, kind="stable")
        return costs[order], plans[order]

    def _fresh(self, turn: int) -> Candidates:
        """Feasible candidates of this batch's own."""
        return CandidateSource(self.space, (*self.seed, turn), workers=1).take(POOL)

    def _refined(
        self, plans: Starts, iterations: int, sharpness: tuple[float, ...], late: Callable[[], bool]
    ) -> tuple[Array, Starts]:
        """Costs and plans after a descent of all of them."""
        x, costs = refine(
            self.space, self.criterion, plans.x, plans.repeats, iterations, sharpness, late
        )
        return costs, Starts(x, plans.repeats)

    def _exchanged(self, plans: Starts, fresh: Candidates) -> Starts:
        """Plans with repetitions moved and places exchanged for fresh candidates, or each other's, where that helps."""
        own = plans.x.reshape(-1, plans.x.shape[-1])
        pool = Candidates(own, self.space.problem(own)) + fresh
        places = np.arange(len(own)).reshape(plans.repeats.shape)
        blocks = pool.problem.blocks(places)
        repeats = [
            best_repeats(self.criterion, *plan) for plan in zip(blocks, plans.repeats, strict=True)
        ]
        places, times = exchanged(pool.problem, self.criterion, places, np.array(repeats))
        return Starts(pool.x[places], times)
